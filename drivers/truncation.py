"""The error of a modal run against the number of modes, with and without static correction.

With exact uplift, modes alone are of no use: a release force must lift the plate off its joints, and what joints of 1e15 N/m do lies in
the very last modes. The static answers supply it. Where a basis already holds all modes of the plate but not those of the joints, what
an answer still adds is below the round-off of the modes; the error then rises again, before the last modes make it vanish.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from drivers.analysis import Plant
from drivers.modes import Wanted, find_modes
from drivers.output import all_or_nothing, versions, write_columns, write_summary
from drivers.scene import Transient
from meshes.checked import ModelError
from solvers import newmark, reduced
from solvers.errors import SolverError
from solvers.history import History
from solvers.modal import Modes, dofs_with_mass
from solvers.reduced import Basis

log = logging.getLogger(__name__)

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


def tabulate_truncation(plant: Plant, folder: Path, *, plots: bool) -> list[str]:
    """Run all levels, write their files into `folder` on rank 0, and return the lines to print (collective).

    Raises `ModelError` where the scene has no [transient] or nothing holds the plate.
    """
    settings = plant.scene.transient
    if settings is None:
        raise ModelError("transient", "missing; truncation needs the section [transient]")
    available = dofs_with_mass(plant.operators)
    counts = mode_counts(available)
    with plant.clock.phase("modes"):
        shift = plant.scene.modal.shift if plant.scene.modal else 0.0
        found = find_modes(plant, Wanted(counts[-1], None, shift))
        if found.rigid:
            raise ModelError("modal", "nothing holds the plate, so it has no static state to start from; hold it by supports or springs")
    result = measure(plant, settings, found, counts)
    if plant.operators.comm.rank == 0:
        with plant.clock.phase("output"), all_or_nothing(folder) as staging:
            write_columns(staging / "truncation.csv", result.columns())
            write_summary(staging / "summary.json", _summary(plant, found, result))
            if plots:
                _draw(staging / "truncation.png", plant, result)
    probes = ", ".join(dict.fromkeys(name.split(".")[0] for name in plant.operators.probes.names))
    return [
        f"{plant.scene.title or 'Uplift'}: {available} modes in all",
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


def measure(plant: Plant, settings: Transient, found: Modes, counts: list[int]) -> Truncation:
    """Run the scene in all dofs and on the first modes of each count, without and with correction (collective)."""
    operators, vectors = plant.operators, found.basis.vectors
    with plant.clock.phase("run in all dofs"):
        physical, seconds = _timed(lambda: _physical(plant, settings), operators.comm)
    levels = []
    for count in counts:
        modal = Basis(vectors[:, :count], operators.comm)
        for corrected in (False, True):
            with plant.clock.phase("static correction"):
                basis = reduced.with_static_answers(operators, modal) if corrected else modal
            displacement = contact = spent = float("nan")
            try:
                with plant.clock.phase("modal runs"):
                    history, spent = _timed(partial(_modal, plant, settings, basis), operators.comm)
                displacement = _error(history.probes, physical.probes)
                contact = _error(_contact_forces(plant, history), _contact_forces(plant, physical))
            except SolverError as error:
                log.warning("%d modes %s static correction: %s", count, "with" if corrected else "without", error)
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


def _physical(plant: Plant, settings: Transient) -> History:
    operators = plant.operators
    with (
        newmark.static_state(operators, exact_uplift=True) as start,
        newmark.Newmark(operators, settings.scheme, settings.step, exact_uplift=True) as method,
    ):
        return newmark.transient(method, start, settings.steps, every=settings.every)


def _modal(plant: Plant, settings: Transient, basis: Basis) -> History:
    model = reduced.project(plant.operators, basis)
    start = reduced.static_state(model, exact_uplift=True)
    run = reduced.march(
        model, settings.scheme, settings.step, settings.steps, every=settings.every, start=start, exact_uplift=True
    )
    return run.history(model)


def _contact_forces(plant: Plant, history: History) -> np.ndarray:
    """Return the contact forces (nt, n_c) N, compression positive."""
    law = plant.operators.contacts.law
    return law.compression(law.tension(history.elongation), history.release)


def _error(values: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest difference relative to the largest exact value; nan where there is none but zero."""
    largest = float(np.max(np.abs(exact), initial=0.0))
    return float(np.max(np.abs(values - exact)) / largest) if largest > 0 else float("nan")


def _draw(path: Path, plant: Plant, result: Truncation) -> None:
    from drivers import plots

    panels = {}
    for name, label in (("displacement", "largest error of the probes' displacements"), ("contact", "largest error of the contact forces")):
        errors = np.array([[getattr(r, name) for r in pair] for pair in result.pairs()])
        if np.isfinite(errors).any():
            panels[label] = {"modes alone": errors[:, 0], "with static correction": errors[:, 1]}
    counts = np.array([pair[0].modes for pair in result.pairs()])
    title = f"{plant.scene.title or 'Uplift'}\nmodal runs against the run in all dofs, uplift exact at every step"
    plots.draw_truncation(path, counts, panels, title)


def _summary(plant: Plant, found: Modes, result: Truncation) -> dict[str, Any]:
    columns = {name: [None if v != v else v for v in column.tolist()] for name, column in result.columns().items()}
    return {
        "title": plant.scene.title,
        "scene": plant.scene.source,
        "start": "static, uplift exact",
        "dofs": plant.operators.n,
        "mass_kg": plant.assembled.total_mass,
        "ranks": plant.operators.comm.size,
        "steps": result.steps,
        "runs": columns,
        "seconds_in_all_dofs": result.seconds,
        "highest_frequency_Hz": float(found.frequencies[-1]),
        "largest_residual": float(found.residuals.max()),
        "orthonormality": found.orthonormality,
        "sturm_count": found.sturm.inside,
        "seconds": plant.clock.seconds,
        "versions": versions(),
    }
