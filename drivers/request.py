"""What is asked of a scene: a method, and uplift solved exactly or by the published passes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from drivers.runtime import Scalars
from drivers.scene import Scene
from meshes.checked import ModelError

METHODS = ("transient", "time-frequency", "modal")


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
        return "complex" if self.method == "time-frequency" and self.basis is None else "real"

    def check(self, scene: Scene) -> None:
        """Raise `ModelError` if the scene does not say what the method needs, or holds what the passes cannot do."""
        if self.basis is not None and self.method == "modal":
            raise ModelError("--basis", "takes the place of the modes; choose the method transient or time-frequency")
        if self.basis is None and self.basis_file is not None:
            raise ModelError("--basis-file", "expected together with --basis TOL")
        section = "fourier" if self.method == "time-frequency" and self.passes else "transient"
        if getattr(scene, section) is None:
            raise ModelError(section, f"missing; the method {self.method} needs the section [{section}]")
        if self.method == "modal" and scene.modal is None:
            raise ModelError("modal", "missing; the method modal needs the section [modal]")
        if self.passes and any(s.unilateral and s.sideways == "released" for s in scene.model.supports):
            raise ModelError("supports", "the published passes cannot release a support sideways; leave out --iterations")
        start = scene.transient.start if scene.transient else ""
        loose = scene.model.free_motions()
        if loose and (section == "fourier" or start != "rest" or (self.method == "modal" and scene.modal and scene.modal.shift == 0)):
            raise ModelError(
                "supports", f"nothing holds the plate against {' and '.join(loose)}: it has no static state; hold it by a spring, "
                "or let a transient run begin with start = 'rest'"
            )
        if start == "rest" and any(s.unilateral and s.settlement != 0 for s in scene.model.supports):
            raise ModelError("transient.start", "expected 'static' or 'settled' where a support has a gap or a preload")
