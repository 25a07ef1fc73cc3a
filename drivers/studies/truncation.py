"""The error of a modal run against the number of modes, with and without static correction.

With exact uplift, modes alone are of no use: a release force must lift the plate off its joints, and what joints of 1e15 N/m do lies in
the very last modes. The static answers supply it. Where a basis already holds all modes of the plate but not those of the joints, what
an answer still adds is below the round-off of the modes; the error then rises again, before the last modes make it vanish.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.analysis.modes import Wanted, find_modes
from uplift.drivers.report.pictures import draw
from uplift.drivers.results.folder import all_or_nothing, versions, write_columns, write_summary
from uplift.drivers.scene.analysis import Transient
from uplift.forms.operators import Operators
from uplift.meshes.checked import ModelError
from uplift.meshes.findings import say
from uplift.solvers.bases.basis import Basis
from uplift.solvers.bases.modes import Modes
from uplift.solvers.bases.pencil import dofs_with_mass
from uplift.solvers.bases.project import project
from uplift.solvers.bases.static_answers import with_static_answers
from uplift.solvers.errors import SolverError
from uplift.solvers.history import History
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import stepper_of, transient

COUNTS = (5, 10, 15, 20, 30, 40, 60, 80, 100, 150, 200)
"""Numbers of modes that are tried, as far as the model has them."""

SMALL = 400
"""Up to this many modes all of them are tried too; of a larger model, no more than `COUNTS` says."""

REPEATS, LONG = 3, 2.0
"""Runs shorter than so many s are timed so many times, and the shortest counts: other processes disturb short ones most."""


@dataclass(frozen=True)
class Level:
    """One modal run beside the physical one."""

    modes: int
    corrected: bool
    """Whether the static answers to the loads and to unit contact forces joined the modes."""
    vectors: int
    """Size of the basis."""
    displacement: float
    """Largest difference of any probe at any archived instant, relative to the largest displacement of a probe; nan for a failed run."""
    contact: float
    """The same of the contact forces; nan also where there are no contacts."""
    seconds: float
    """Projection, start and march, after the modes are known: the shortest of `REPEATS` runs."""


@dataclass(frozen=True)
class Truncation:
    """The physical run's seconds and all modal runs, without and with correction in turn."""

    seconds: float
    """Start, factorisation and march in all dofs, the shortest of `REPEATS` runs."""
    steps: int
    levels: list[Level]

    def pairs(self) -> list[tuple[Level, Level]]:
        """Return for each number of modes the run without and the run with correction."""
        return list(zip(self.levels[::2], self.levels[1::2], strict=True))

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns of the table, one row for each run."""
        rows = self.levels
        return {
            "modes": np.array([r.modes for r in rows]),
            "static correction": np.array([int(r.corrected) for r in rows]),
            "vectors": np.array([r.vectors for r in rows]),
            "displacement error": np.array([r.displacement for r in rows]),
            "contact force error": np.array([r.contact for r in rows]),
            "seconds": np.array([r.seconds for r in rows]),
            "seconds / seconds in all dofs": np.array([r.seconds / self.seconds for r in rows]),
        }

    def lines(self) -> list[str]:
        """Return the table as it is printed."""
        one = f"{'vectors':>10}{'displacement':>14}{'contact':>10}{'time':>8}"
        lines = [
            f"{'':>5}{'modes alone':>42}{'with static correction':>42}",
            f"{'modes':>5}{one}{one}",
        ]
        for pair in self.pairs():
            lines.append(f"{pair[0].modes:>5}" + "".join(
                f"{r.vectors:>10}{_shown(r.displacement, '.2e'):>14}{_shown(r.contact, '.2e'):>10}"
                f"{_shown(r.seconds / self.seconds, '.3f'):>8}"
                for r in pair
            ))
        return lines


def _shown(value: float, form: str) -> str:
    return "-" if np.isnan(value) else format(value, form)


def tabulate_truncation(assembly: AssembledScene, folder: Path, *, plots: bool) -> list[str]:
    """Run all levels, write their files into `folder` on rank 0, and return the lines to print (collective).

    Raises `ModelError` where the scene has no [transient] or nothing holds the plate.
    """
    settings = assembly.scene.transient
    if settings is None:
        raise ModelError("transient", "missing; truncation needs the section [transient]")
    available = dofs_with_mass(assembly.operators)
    counts = mode_counts(available)
    with assembly.clock.phase("modes"):
        shift = assembly.scene.modal.shift if assembly.scene.modal else 0.0
        found = find_modes(assembly, Wanted(counts[-1], None, shift))
        if found.rigid:
            raise ModelError("modal", "nothing holds the plate, so it has no static state to start from; hold it by supports or springs")
    result = measure(assembly, settings, found, counts)
    if assembly.operators.comm.rank == 0:
        with assembly.clock.phase("output"), all_or_nothing(folder) as staging:
            write_columns(staging / "truncation.csv", result.columns())
            write_summary(staging / "summary.json", _summary(assembly, found, result))
            if plots:
                _draw(staging / "truncation.png", assembly, result)
    probes = ", ".join(dict.fromkeys(name.split(".")[0] for name in assembly.operators.probes.names))
    return [
        f"{assembly.scene.title or 'Uplift'}: {available} modes in all",
        "uplift exact at every step, damping projected in full, from the static state",
        f"largest errors over all times of the displacements of {probes} and of the contact forces, relative to the largest in all dofs",
        f"time after the modes are known, relative to the {result.seconds:.3g} s of {result.steps:,} steps in all dofs",
        "",
        *result.lines(),
    ]


def mode_counts(available: int) -> list[int]:
    """Return the numbers of modes to try of a model that has `available` modes."""
    counts = [n for n in COUNTS if n < available]
    return [*counts, available] if available <= SMALL else counts


def measure(assembly: AssembledScene, settings: Transient, found: Modes, counts: list[int]) -> Truncation:
    """Run the scene in all dofs and on the first modes of each count, without and with correction (collective)."""
    operators, vectors = assembly.operators, found.basis.vectors
    with assembly.clock.phase("run in all dofs"):
        physical, seconds = _timed(lambda: _marched(operators, settings), operators.comm)
    levels = []
    for count in counts:
        modal = Basis(vectors[:, :count], operators.comm)
        for corrected in (False, True):
            with assembly.clock.phase("static correction"):
                basis = with_static_answers(operators, modal) if corrected else modal
            displacement = contact = spent = float("nan")
            try:
                with assembly.clock.phase("modal runs"):
                    history, spent = _timed(partial(_modal, assembly, settings, basis), operators.comm)
                displacement = _error(history.probes, physical.probes)
                contact = _error(_contact_forces(assembly, history), _contact_forces(assembly, physical))
            except SolverError as error:
                say("failed case", f"{count} modes {'with' if corrected else 'without'} static correction: {error}")
            levels.append(Level(count, corrected, basis.size, displacement, contact, spent))
    return Truncation(seconds, settings.steps, levels)


def _timed(run: Callable[[], History], comm: Any) -> tuple[History, float]:
    """Return what `run` returns and the seconds of the shortest of several runs; of one, where it is long (collective)."""
    shortest = np.inf
    for _ in range(REPEATS):
        begin = time.perf_counter()
        history = run()
        spent = comm.bcast(time.perf_counter() - begin)
        shortest = min(shortest, spent)
        if spent > LONG:
            break
    return history, shortest


def _marched(operators: Operators, settings: Transient) -> History:
    with (
        static_state(operators, exact_uplift=True) as start,
        stepper_of(operators, settings.scheme, settings.step, exact_uplift=True) as stepper,
    ):
        return transient(stepper, start, settings.steps, every=settings.every)


def _modal(assembly: AssembledScene, settings: Transient, basis: Basis) -> History:
    with project(assembly.operators, basis) as small:
        return _marched(small, settings)


def _contact_forces(assembly: AssembledScene, history: History) -> np.ndarray:
    """Return the contact forces (nt, n_c) N, compression positive."""
    law = assembly.operators.contacts.law
    return law.compression(law.tension(history.elongation), history.release)


def _error(values: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest difference relative to the largest exact value; nan where there is none but zero."""
    largest = float(np.max(np.abs(exact), initial=0.0))
    return float(np.max(np.abs(values - exact)) / largest) if largest > 0 else float("nan")


def _draw(path: Path, assembly: AssembledScene, result: Truncation) -> None:
    from uplift.drivers.studies.study_plots import draw_truncation

    panels = {}
    for name, label in (("displacement", "largest error of the probes' displacements"), ("contact", "largest error of the contact forces")):
        errors = np.array([[getattr(r, name) for r in pair] for pair in result.pairs()])
        if np.isfinite(errors).any():
            panels[label] = {"modes alone": errors[:, 0], "with static correction": errors[:, 1]}
    counts = np.array([pair[0].modes for pair in result.pairs()])
    title = f"{assembly.scene.title or 'Uplift'}\nmodal runs against the run in all dofs, uplift exact at every step"
    draw(draw_truncation, path, counts, panels, title)


def _summary(assembly: AssembledScene, found: Modes, result: Truncation) -> dict[str, Any]:
    columns = {name: [None if v != v else v for v in column.tolist()] for name, column in result.columns().items()}
    return {
        "title": assembly.scene.title,
        "scene": assembly.scene.source,
        "start": "static, uplift exact",
        "dofs": assembly.operators.n,
        "mass_kg": assembly.plate.total_mass,
        "ranks": assembly.operators.comm.size,
        "steps": result.steps,
        "runs": columns,
        "seconds_in_all_dofs": result.seconds,
        "highest_frequency_Hz": float(found.frequencies[-1]),
        "largest_residual": float(found.residuals.max()),
        "orthonormality": found.orthonormality,
        "sturm_count": found.sturm.inside,
        "seconds": assembly.clock.seconds,
        "versions": versions(),
    }
