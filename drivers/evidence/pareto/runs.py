"""The runs of the study of error against run time, each timed by phase on a model that is assembled once."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene, Clock, prepare
from uplift.drivers.evidence.pareto.cases import (
    AS_PUBLISHED,
    CORRECTED,
    FOURIER_2,
    INSTANTS,
    LAPLACE,
    NEWMARK_2,
    SCHEMES,
    Mesh,
    Run,
    edge_shares,
    foot,
    rectangle,
    spread,
)
from uplift.drivers.evidence.pareto.errors import Trace, open_time
from uplift.drivers.scene.scene import Scene
from uplift.forms.operators import Operators
from uplift.meshes.checked import ModelError
from uplift.solvers.bases.basis import Basis
from uplift.solvers.bases.krylov import krylov_basis
from uplift.solvers.bases.modes import modes
from uplift.solvers.bases.project import project
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.bases.static_answers import with_static_answers
from uplift.solvers.contact.published_passes import Passes, published_passes
from uplift.solvers.errors import SolverError
from uplift.solvers.frequency_domain.window import Window
from uplift.solvers.history import History
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import stepper_of, transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.scheme import Scheme

PASSES, END = 400, 1e-8
"""Published passes at most, and where they end: change of the displacements and tension left, relative."""

QUICK, AGAIN = 1.0, 3
"""A run that takes less than so many seconds is made so many times, and the one of median length counts."""

FACTOR_STEP = 0.005
"""s: step of the effective matrix whose factorisation is the unit of run time."""


@dataclass(frozen=True)
class Outcome:
    """What one run gave."""

    run: Run
    dofs: int
    contacts: int
    trace: Trace | None
    """None where the run failed; `ended` says how."""
    seconds: dict[str, float] = field(default_factory=dict)
    """Wall seconds by phase, from the assembled model to the histories."""
    vectors: int | None = None
    """Size of the basis."""
    blocks: int | None = None
    """Blocks of a Krylov basis."""
    passes: int | None = None
    ended: str = ""
    bonded: Trace | None = None
    """The first pass, every contact bonded."""

    @property
    def total(self) -> float:
        """Wall seconds of all phases."""
        return sum(self.seconds.values())


@dataclass
class Model:
    """A case on one mesh, assembled, and what is observed of it; `with` frees it."""

    assembly: AssembledScene
    duration: float
    """s."""
    rows: np.ndarray
    """Displacements of the first probe."""
    contacts: np.ndarray
    """The observed contacts: those at the supports of the scene as published, which all meshes have."""
    share: np.ndarray
    """Length in m that each of them stands for; 1 where supports are points."""

    @property
    def operators(self) -> Operators:
        """The operators of the model."""
        return self.assembly.operators

    def trace(self, history: History, step: float) -> Trace:
        """Return what is compared of a history with every step archived from time 0 on."""
        law = self.operators.contacts.law
        last = round(self.duration / step) + 1
        tension = law.tension(history.elongation[:last])
        force = law.compression(tension, history.release[:last])[:, self.contacts] / self.share
        every = round(INSTANTS / step)
        return Trace(history.probes[:last:every, self.rows], force[::every], open_time(tension[:, self.contacts], step))

    def __enter__(self) -> Model:
        """Return itself."""
        return self

    def __exit__(self, *args: object) -> None:
        """Free the operators."""
        self.assembly.__exit__(*args)


def assemble(scene: Scene, case: str, mesh: Mesh, comm: Any) -> Model:
    """Mesh and assemble a case (collective)."""
    assert scene.transient is not None
    assembly = prepare(scene if case == AS_PUBLISHED else spread(scene, mesh), comm)
    operators, unrestrained = assembly.operators, assembly.plate.unrestrained
    if unrestrained:
        assembly.__exit__()
        raise ModelError("supports", f"nothing holds the plate against {' and '.join(unrestrained)}: it has no static state")
    probe = scene.model.probes[0].name
    rows = [i for i, name in enumerate(operators.probes.names) if name.startswith(f"{probe}.D")]
    contacts = np.arange(operators.contacts.law.n_contacts)
    share = np.ones(len(contacts))
    if case != AS_PUBLISHED:
        own = np.array([point[:2] for point in foot(scene).points])
        contacts = np.linalg.norm(operators.contacts.points[None, :, :2] - own[:, None, :], axis=2).argmin(axis=1)
        plate = rectangle(assembly.scene)
        nodes, shares = edge_shares(plate.width, plate.nx, mesh.degree)
        share = np.array([shares[np.argmin(np.abs(nodes - x))] for x in own[:, 0]])
    return Model(assembly, scene.transient.duration, np.array(rows, dtype=int), contacts, share)


def check(scene: Scene) -> None:
    """Raise `ModelError` for a scene that the study cannot compare."""
    if scene.transient is None:
        raise ModelError("transient", "missing; the study needs the section [transient]")
    rectangle(scene)
    if not any(support.unilateral for support in scene.model.supports):
        raise ModelError("supports", "expected at least one unilateral support")
    if any(support.follows_sideways for support in scene.model.supports):
        raise ModelError("supports", "the published passes cannot release a support sideways; the study needs sideways = 'bonded'")
    if abs(scene.transient.duration / INSTANTS - round(scene.transient.duration / INSTANTS)) > 1e-9:
        raise ModelError("transient.duration", f"expected a multiple of {INSTANTS:g} s, the instants at which histories are compared")


def one_factorisation(model: Model) -> float:
    """Return the seconds of one factorisation, symbolic and numerical, of the effective matrix of Newmark's method: the median of five."""
    seconds = []
    for _ in range(5):
        with Newmark(model.operators, Scheme(), FACTOR_STEP) as method:
            seconds.append(method.solver.factor_seconds)
    return float(np.median(seconds))


def execute(model: Model, run: Run) -> Outcome:
    """Make one run, again where it is quick, and return the one of median length (collective)."""
    outcomes = [execute_once(model, run)]
    if outcomes[0].total < QUICK and outcomes[0].trace is not None:
        outcomes += [execute_once(model, run) for _ in range(AGAIN - 1)]
    return sorted(outcomes, key=lambda outcome: outcome.total)[len(outcomes) // 2]


def execute_once(model: Model, run: Run) -> Outcome:
    """Make one run once (collective); what the method or its solver refuses becomes the way it ended."""
    clock = Clock()
    method: Callable[[Model, Run, Clock], tuple[History | None, dict[str, Any]]]
    if run.method in SCHEMES or run.method == NEWMARK_2:
        method = _stepped
    elif run.method == LAPLACE:
        method = _laplace
    elif run.by_sweep:
        method = _fourier
    else:
        method = _on_a_basis
    try:
        history, more = method(model, run, clock)
    except (SolverError, ModelError) as error:
        history, more = None, {"ended": str(error)}
    bonded = more.pop("first", None)
    return Outcome(
        run, model.operators.n, model.operators.contacts.law.n_contacts,
        None if history is None else model.trace(history, run.step), clock.seconds,
        bonded=None if bonded is None else model.trace(bonded, run.step), **more,
    )


def _steps(model: Model, run: Run) -> int:
    return round(model.duration / run.step)


def _ending(passes: Passes) -> dict[str, Any]:
    return {"passes": passes.number, "ended": passes.ended, "first": passes.histories[0]}


def _stepped(model: Model, run: Run, clock: Clock) -> tuple[History | None, dict[str, Any]]:
    exact = run.method != NEWMARK_2
    scheme, operators = SCHEMES.get(run.method, Scheme()), model.operators
    with clock.phase("start"):
        start = static_state(operators, exact_uplift=exact)
    with start:
        begin = time.perf_counter()
        with Newmark(operators, scheme, run.step, exact_uplift=exact) as method:
            clock.add("factorisation", method.solver.factor_seconds)
            clock.add("compliance", time.perf_counter() - begin - method.solver.factor_seconds)
            with clock.phase("march"):
                if exact:
                    return transient(method, start, _steps(model, run)), {}
                passes = published_passes(
                    lambda release: transient(method, start, _steps(model, run), release=release), operators.contacts.law, 2
                )
    return passes.final, _ending(passes)


def _laplace(model: Model, run: Run, clock: Clock) -> tuple[History | None, dict[str, Any]]:
    from uplift.solvers.frequency_domain.laplace import laplace_run

    with clock.phase("start"):
        start = static_state(model.operators, exact_uplift=True)
    with start:
        result = laplace_run(model.operators, Scheme(), run.step, _steps(model, run), start)
    clock.add("factorisation", result.factor_seconds)
    clock.add("sweep", result.sweep_seconds - result.factor_seconds)
    clock.add("march", result.march_seconds)
    return result.history, {}


def _fourier(model: Model, run: Run, clock: Clock) -> tuple[History | None, dict[str, Any]]:
    from uplift.solvers.frequency_domain.harmonic import FourierResponse, harmonic_sweep

    assert run.window is not None and run.band is not None
    window = Window(run.window, round(run.window / run.step), run.band)
    with clock.phase("sweep"):
        transfer = harmonic_sweep(model.operators, 2 * np.pi * window.frequencies)
    clock.seconds["sweep"] -= transfer.factor_seconds
    clock.add("factorisation", transfer.factor_seconds)
    two = run.method == FOURIER_2
    with clock.phase("passes"):
        response = FourierResponse(model.operators, window, transfer)
        law = model.operators.contacts.law
        passes = published_passes(response.history, law, 2 if two else PASSES, tolerance=None if two else END, keep_all=two)
    return passes.final if two or passes.ended == "converged" else None, _ending(passes)


def basis_of(operators: Operators, run: Run) -> tuple[Basis, int | None]:
    """Return the basis of a run and, of a Krylov basis, the number of its blocks (collective)."""
    if run.tolerance is not None:
        grown = krylov_basis(operators, KrylovSettings(tolerance=run.tolerance))
        return grown, len(grown.growth.sizes)
    found = modes(operators, number=run.size).basis
    return (with_static_answers(operators, found) if run.method == CORRECTED else found), None


def _on_a_basis(model: Model, run: Run, clock: Clock) -> tuple[History | None, dict[str, Any]]:
    with clock.phase("basis"):
        basis, blocks = basis_of(model.operators, run)
    with clock.phase("projection"):
        small = project(model.operators, basis)
    with small:
        with clock.phase("start"):
            start = static_state(small, exact_uplift=True)
        with clock.phase("march"), start, stepper_of(small, Scheme(), run.step, exact_uplift=True) as stepper:
            history = transient(stepper, start, _steps(model, run))
    return history, {"vectors": basis.size, "blocks": blocks}


def run_all(
    scene: Scene, table: Sequence[Run], comm: Any, progress: Callable[[Outcome], None] = lambda _: None
) -> tuple[list[Outcome], dict[tuple[str, Mesh], float]]:
    """Make the runs, mesh by mesh, and return their outcomes and one factorisation's seconds by case and mesh (collective)."""
    outcomes: list[Outcome] = []
    units: dict[tuple[str, Mesh], float] = {}
    for case, mesh in dict.fromkeys((run.case, run.mesh) for run in table):
        with assemble(scene, case, mesh, comm) as model:
            units[case, mesh] = one_factorisation(model)
            for run in table:
                if (run.case, run.mesh) == (case, mesh):
                    outcomes.append(execute(model, run))
                    progress(outcomes[-1])
    return outcomes, units
