"""The methods of the program as functions for scripts and notebooks; see docs/library.md."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from uplift.forms.operators import Operators
from uplift.meshes.checked import ModelError
from uplift.solvers.history import History
from uplift.solvers.time_domain.scheme import Scheme

if TYPE_CHECKING:
    from uplift.drivers.scene.scene import Scene
    from uplift.solvers.bases.krylov import KrylovBasis
    from uplift.solvers.bases.modes import Modes

STARTS = ("static", "rest")


@dataclass(frozen=True)
class Histories:
    """Histories by name, the same on every rank."""

    times: np.ndarray
    """(nt,) s."""
    values: dict[str, np.ndarray]
    """(nt,) each: "P3.DX", "P3.DX acceleration", "RESS1 force", "RESS1 gap", "base shear"."""
    units: dict[str, str]
    """SI unit of each."""
    history: History
    """The history as the solvers give it."""

    def __getitem__(self, name: str) -> np.ndarray:
        """Return one history by its name."""
        return self.values[name]


@contextmanager
def assemble(scene: Scene, comm: Any | None = None) -> Iterator[Operators]:
    """Give the model of a scene, meshed and assembled on all ranks of `comm` (default: of the world), and free it (collective)."""
    from mpi4py import MPI

    from uplift.drivers.analysis.assembled_scene import prepare

    with prepare(scene, comm or MPI.COMM_WORLD) as assembly:
        yield assembly.operators


def transient(
    model: Operators,
    scheme: Scheme | None = None,
    *,
    step: float,
    steps: int,
    every: int = 1,
    start: str = "static",
    exact_uplift: bool = True,
) -> Histories:
    """March a model through `steps` steps of `step` s with exact uplift, or with every contact bonded (collective).

    `scheme` is the average-acceleration rule unless given; `start` is "static", the answer to the static loads, or "rest". Every
    `every`-th step is kept. Many parameters because all but the step and the number of steps may be left out.
    """
    from uplift.solvers.time_domain.march import stepper_of, transient

    with _start(model, start, exact_uplift) as state, stepper_of(model, scheme or Scheme(), step, exact_uplift=exact_uplift) as stepper:
        return _named(model, transient(stepper, state, steps, every=every))


def time_frequency(
    model: Operators, scheme: Scheme | None = None, *, step: float, steps: int, every: int = 1, start: str = "static"
) -> Histories:
    """Answer as `transient` does, by one sweep over Laplace points and a march over the contact forces (collective).

    In all dofs the sweep needs complex PETSc; raises `ModelError` where this process has the real one, and says what does.
    """
    from petsc4py import PETSc

    from uplift.solvers.frequency_domain.laplace import laplace_run

    if model.reduction is None and not np.issubdtype(PETSc.ScalarType, np.complexfloating):
        raise ModelError(
            "time_frequency", "needs complex PETSc in all dofs, and this process has the real one: begin the script with "
            "uplift.choose_scalars('complex'), or project the model on a basis (uplift.krylov_basis), where the sweep runs here"
        )
    with _start(model, start, True) as state:
        return _named(model, laplace_run(model, scheme or Scheme(), step, steps, state, every=every).history)


def modes(model: Operators, *, number: int | None = None, band: tuple[float, float] | None = None, shift: float = 0.0) -> Modes:
    """Return the `number` lowest modes, every contact bonded, or all between two frequencies in Hz (collective)."""
    from uplift.solvers.bases.modes import modes

    return modes(model, number=number, band=band, shift=shift)


def krylov_basis(model: Operators, *, tolerance: float = 1e-6, band: float = 25.0, shift: float = 0.0) -> KrylovBasis:
    """Return a Krylov basis grown to a relative residual of `tolerance` up to `band` Hz (collective)."""
    from uplift.solvers.bases.krylov import krylov_basis
    from uplift.solvers.bases.settings import KrylovSettings

    return krylov_basis(model, KrylovSettings(tolerance=tolerance, band=band, shift=shift))


def _start(model: Operators, start: str, exact_uplift: bool) -> Any:
    from uplift.solvers.time_domain.initial import static_state
    from uplift.solvers.time_domain.state import at_rest

    if start not in STARTS:
        raise ModelError("start", f"expected one of {', '.join(map(repr, STARTS))}, got {start!r}")
    return at_rest(model) if start == "rest" else static_state(model, exact_uplift=exact_uplift)


def _named(model: Operators, history: History) -> Histories:
    values: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    for group in model.outputs.groups:
        if group.name == "elongation":
            continue
        values |= dict(zip(group.names, history.group(group.name).T, strict=True))
        units |= dict(zip(group.names, group.units, strict=True))
    if history.accelerations is not None:
        for name, unit, column in zip(model.probes.names, model.probes.units, history.accelerations.T, strict=True):
            values[f"{name} acceleration"], units[f"{name} acceleration"] = column, f"{unit}/s2"
    law = model.contacts.law
    force, gap = law.compression(law.tension(history.elongation), history.release), history.openings(law)
    for number, name in enumerate(model.contacts.names):
        values |= {f"{name} force": force[:, number], f"{name} gap": gap[:, number]}
        units |= {f"{name} force": "N", f"{name} gap": "m"}
    return Histories(history.times, values, units, history)
