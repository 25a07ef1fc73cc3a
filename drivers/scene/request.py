"""What is asked of a scene: a method, and uplift solved exactly or by the published passes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from uplift.drivers.petsc_installation import Scalars
from uplift.drivers.scene.scene import Scene
from uplift.meshes.checked import ModelError

IN_A_BASIS = ("transient", "exact", "time-frequency")
"""Methods that can run in a Krylov basis."""


@dataclass(frozen=True)
class Request:
    """What is asked of a method."""

    method: str
    passes: int | None = None
    """Number of published passes; None: uplift is solved exactly."""
    tolerance: float | None = None
    """End of the published passes, if any."""
    basis: float | None = None
    """Tolerance of the Krylov basis that the run lives in; None: it is run in all dofs."""
    basis_file: Path | None = None
    """Where the basis is read from, or written to if the file is not there yet."""

    @property
    def scalars(self) -> Scalars:
        """The build of PETSc that the method needs."""
        needs = self.method == "harmonic" or (self.method == "time-frequency" and self.basis is None)
        return "complex" if needs else "real"

    def check(self, scene: Scene) -> None:
        """Raise `ModelError` if the scene does not say what the method needs, or holds what the passes cannot do."""
        if self.basis is not None and self.method not in IN_A_BASIS:
            raise ModelError("--basis", "expected with the method transient, exact or time-frequency; it takes the place of the modes")
        if self.basis is None and self.basis_file is not None:
            raise ModelError("--basis-file", "expected together with --basis TOL")
        section = self._section()
        if section and getattr(scene, section) is None:
            raise ModelError(section, f"missing; the method {self.method} needs the section [{section}]")
        if self.method == "modal" and scene.modal is None:
            raise ModelError("modal", "missing; the method modal needs the section [modal]")
        if not scene.model.probes:
            raise ModelError("probes", "expected at least one [[probes]] with a name and a point")
        if self.passes and self.method in ("static", "harmonic", "exact"):
            raise ModelError("run.iterations", f"the method {self.method} knows no published passes")
        if self.method == "exact" and any(s.unilateral and s.mass > 0 for s in scene.model.supports):
            raise ModelError("supports.mass", "the method exact takes joints without mass: set it to 0, or take the method transient")
        if any(condition.moves for condition in scene.model.initial):
            self._check_initial(scene)
        if self.passes and any(s.follows_sideways for s in scene.model.supports):
            raise ModelError("supports", "the published passes keep sideways forces: set sideways = \"bonded\", or leave out --iterations")

    def _check_initial(self, scene: Scene) -> None:
        """Raise `ModelError` if the method starts from no state that initial conditions could be added to."""
        if self.method in ("static", "harmonic"):
            raise ModelError("initial", f"the method {self.method} has no initial conditions: take transient, exact or modal")
        if self.method == "time-frequency":
            why = "the window of the published passes is periodic" if self.passes else "the sweep starts from a state of rest"
            raise ModelError("initial", f"{why}, without initial conditions: take the method transient, exact or modal")
        if scene.transient is not None and scene.transient.start == "settled":
            raise ModelError("initial", "expected [transient] start = 'rest' or 'static' with initial conditions, got 'settled'")

    def check_held(self, scene: Scene, unrestrained: tuple[str, ...]) -> None:
        """Raise `ModelError` if the method needs a static state and nothing holds the plate against the motions `loose`."""
        moving = self.method == "harmonic" or (
            self._from_rest(scene) and not (self.method == "modal" and scene.modal and scene.modal.shift == 0)
        )
        if unrestrained and not moving:
            raise ModelError(
                "supports", f"nothing holds the plate against {' and '.join(unrestrained)}: it has no static state; hold it by a spring, "
                "or let a transient run begin with start = 'rest'"
            )

    def needs_rest(self, scene: Scene) -> bool:
        """Return whether the run begins, or ends, with the state of rest in which the contacts that pull are open."""
        begins = self._section() == "transient" and scene.transient is not None and scene.transient.start == "static"
        return self.passes is None and (self.method == "static" or begins)

    def _section(self) -> str:
        """Return the section of the scene that the method reads, if any."""
        if self.method in ("static", "harmonic"):
            return "harmonic" if self.method == "harmonic" else ""
        return "fourier" if self.method == "time-frequency" and self.passes else "transient"

    def _from_rest(self, scene: Scene) -> bool:
        return self._section() == "transient" and scene.transient is not None and scene.transient.start == "rest"
