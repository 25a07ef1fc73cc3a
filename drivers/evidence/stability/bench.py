"""What the cases of the stability table are made of: runs of varied scenes, the independent model beside them, refusals and warnings."""

from __future__ import annotations

import json
import logging
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from petsc4py import PETSc

from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import Analysis, AssembledScene, prepare
from uplift.drivers.evidence.stability.oracle import EXTENDED, DensePlate, Motion
from uplift.drivers.scene.paths import varied
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import Scene, build_scene
from uplift.solvers.history import History
from uplift.solvers.linear import DirectSolver
from uplift.solvers.time_domain.initial import static_state

ROOT = Path(__file__).parents[3]

ROUND_OFF = 1e-8
"""Limit of the comparisons with the independent model: a stiffness wrong in its seventh digit is over it."""

COMMON: dict[str, Any] = {"transient.every": 1, "transient.start": "static", "supports.mass": 0.0, "output": None}
"""Of all cases: every step is compared, from the static state, on joints without the point mass, which some cases give back."""


@dataclass(frozen=True)
class Finding:
    """What one case gave."""

    figure: float
    note: str = ""
    limit: float | None = None
    """Where the limit follows from the numbers of the case."""
    sound: bool = True
    """Whether what cannot be put in a figure, such as a warning that has to come, is as it should be."""


@dataclass(frozen=True)
class Bench:
    """The base scene and the ways to try its variations."""

    table: dict[str, Any]
    folder: Path
    comm: Any
    fault: dict[str, Any] = field(default_factory=dict)
    """Changes that only the program sees and the oracles do not: with any of them the verdicts must turn."""

    def scene(self, changes: dict[str, Any], *, true: bool = False) -> Scene:
        """Return the base scene with changes (see `uplift.drivers.evidence.survey.cases.Case`), and the fault unless it is to be `true`."""
        table = varied(varied(self.table, COMMON), changes)
        return build_scene(table if true else varied(table, self.fault), self.folder)

    @contextmanager
    def assembly(self, changes: dict[str, Any]) -> Iterator[AssembledScene]:
        """Give the assembled scene."""
        with prepare(self.scene(changes), self.comm) as assembly:
            yield assembly

    def run(self, changes: dict[str, Any], method: str = "transient") -> Run:
        """Run a method with exact uplift."""
        with self.assembly(changes) as assembly:
            history = analyse(assembly, Request(method)).final
            plain, scaled = conditions(assembly)
            words = f"condition 1e{math.log10(plain):.0f}, scaled 1e{math.log10(scaled):.0f}"
            bound = assembly.operators.n * float(np.finfo(float).eps) * scaled
            return Run(history, contact_forces(assembly, history), words, bound)

    def dense(self, changes: dict[str, Any], precision: type = EXTENDED) -> Motion:
        """March the independent model of the scene."""
        scene = self.scene(changes, true=True)
        settings = scene.transient
        assert settings is not None
        return DensePlate(scene, precision).march(settings.scheme, settings.step, settings.steps, rest=settings.start == "rest")

    def against_dense(self, changes: dict[str, Any], precision: type = EXTENDED, *, bound: bool = False) -> Finding:
        """Compare a run with the independent model on the same steps; `bound`: the limit is that of a badly conditioned step."""
        here, there = self.run(changes), self.dense(changes, precision)
        return Finding(difference(here, there), here.conditions, limit=here.bound if bound else None)

    def moved_against_dense(self, changes: dict[str, Any]) -> Finding:
        """Compare the motion from the static state, and the contact forces; the limit is what round-off of that state sets in motion."""
        with self.assembly(changes) as assembly:
            lost = float(np.finfo(float).eps) * condition(assembly.operators.stiffness, scaled=True)
        here, there = self.run(changes), self.dense(changes)
        moved = there.probes - there.probes[0]
        figure = max(relative(here.history.probes - here.history.probes[0], moved), relative(here.forces, there.forces))
        ratio = float(np.max(np.abs(there.probes[0])) / np.max(np.abs(moved)))
        return Finding(figure, f"static displacement / motion = {ratio:.0e}", limit=max(lost * ratio, ROUND_OFF))

    def static_against_dense(self, changes: dict[str, Any]) -> Finding:
        """Compare the static state; the limit is what the condition of the stiffness admits."""
        scene = self.scene(changes, true=True)
        model = DensePlate(scene)
        there = model.static()[0][model.probed].astype(float)
        with self.assembly(changes) as assembly, static_state(assembly.operators, exact_uplift=True) as state:
            here = assembly.operators.outputs.linear("probes", np.real(state.displacement.array_r))
            scaled = condition(assembly.operators.stiffness, scaled=True)
            lost = assembly.operators.n * float(np.finfo(float).eps) * scaled
        return Finding(relative(here, there), f"scaled condition 1e{math.log10(scaled):.0f}", limit=lost)

    def fourier(self, changes: dict[str, Any]) -> tuple[Analysis, str]:
        """Run the linear response of the window, every contact bonded; return the analysis and its warnings."""
        with self.assembly(changes) as assembly, warnings() as heard:
            analysis = analyse(assembly, Request("time-frequency", 1))
        return analysis, " ".join(heard)

    def refused(self, changes: dict[str, Any], words: str, **files: str) -> Finding:
        """Run a scene in a process of its own: it must end with exit code 2, one line that has the words, and no files."""
        with tempfile.TemporaryDirectory(prefix="uplift-") as name:
            folder = Path(name)
            for file, text in files.items():
                (folder / f"{file}.csv").write_text(text, encoding="utf-8")
            text = toml(varied(varied(varied(self.table, COMMON), changes), self.fault))
            (folder / "scene.toml").write_text(text, encoding="utf-8")
            command = [sys.executable, "-m", "drivers", "run", str(folder / "scene.toml"), "--no-plots", "--out", str(folder / "out")]
            clean = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX", "PMI_", "PRTE"))}
            done = subprocess.run(command, cwd=ROOT, env=clean, capture_output=True, text=True, timeout=300)
            lines = done.stderr.strip().splitlines()
            written = (folder / "out").exists() and any((folder / "out").iterdir())
        said = lines[-1].removeprefix("uplift: ").replace(f"{folder}/", "").removeprefix("scene.toml: ") if lines else "nothing"
        refused = done.returncode == 2 and len(lines) == 1 and words in said and not written
        return Finding(float(not refused), f"exit code {done.returncode}: {said}")


@dataclass(frozen=True)
class Run:
    """A run of the program."""

    history: History
    forces: np.ndarray
    """(nt, n_c) N, compression positive."""
    conditions: str
    bound: float
    """Dofs x eps x scaled condition of the matrix of a step."""


def contact_forces(assembly: AssembledScene, history: History) -> np.ndarray:
    """Return the contact forces (nt, n_c) N, compression positive."""
    law = assembly.operators.contacts.law
    return law.compression(law.tension(history.elongation), history.release)


def difference(here: Run, there: Motion) -> float:
    """Return the largest relative difference: of the static states, of the motions from them, and of the contact forces."""
    start, true_start = here.history.probes[0], there.probes[0]
    parts = [relative(here.history.probes - start, there.probes - true_start)]
    if np.any(true_start):
        parts.append(relative(start, true_start))
    if there.forces.size and np.any(there.forces):
        parts.append(relative(here.forces, there.forces))
    return max(parts)


def relative(here: np.ndarray, there: np.ndarray) -> float:
    """Return the largest difference relative to the largest value of the second."""
    return float(np.max(np.abs(here - there)) / np.max(np.abs(there)))


def conditions(assembly: AssembledScene) -> tuple[float, float]:
    """Return the condition number of the matrix of a time step, as it stands and with its diagonal scaled to one."""
    settings, operators = assembly.scene.transient, assembly.operators
    assert settings is not None
    scheme, step = settings.scheme, settings.step
    matrix = operators.mass.copy()
    matrix.scale(1 - scheme.alpha_m)
    matrix.axpy((1 - scheme.alpha_f) * scheme.beta * step**2, operators.stiffness, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    if operators.damping is not None:
        factor = (1 - scheme.alpha_f) * scheme.gamma * step
        matrix.axpy(factor, operators.damping, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    plain, scaled = condition(matrix), condition(matrix, scaled=True)
    matrix.destroy()
    return plain, scaled


def condition(matrix: Any, *, scaled: bool = False, steps: int = 40) -> float:
    """Return the condition number of a symmetric positive definite matrix by power steps of it and of its inverse, from below.

    With `scaled` it is that of D A D, D = diag(A)^-1/2: the digits that a direct solution can lose, whatever the units of the rows.
    """
    work = matrix.copy()
    if scaled:
        diagonal = work.getDiagonal()
        diagonal.array[:] = 1.0 / np.sqrt(np.abs(diagonal.array))
        work.diagonalScale(diagonal, diagonal)
        diagonal.destroy()
    vector, image = work.createVecs()
    ends = []
    with DirectSolver(work, "condition_", definite=True, what="estimate of a condition number") as solver:
        for apply in (work.mult, solver.solve):
            vector.array[:] = np.cos(1.0 + np.arange(vector.getOwnershipRange()[0], vector.getOwnershipRange()[1]) ** 2)
            for _ in range(steps):
                vector.scale(1.0 / vector.norm())
                apply(vector, image)
                ends.append(image.norm())
                image.copy(vector)
    for thing in (work, vector, image):
        thing.destroy()
    return max(ends[:steps]) * max(ends[steps:])


@contextmanager
def warnings() -> Iterator[list[str]]:
    """Collect what the drivers and solvers warn of."""
    heard: list[str] = []

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if record.levelno >= logging.WARNING:
                heard.append(record.getMessage())

    listener, loggers = Listener(), [logging.getLogger("uplift")]
    before = [(logger.handlers, logger.propagate) for logger in loggers]
    for logger in loggers:
        logger.handlers, logger.propagate = [listener], False
    try:
        yield heard
    finally:
        for logger, (handlers, propagate) in zip(loggers, before, strict=True):
            logger.handlers, logger.propagate = handlers, propagate


def toml(table: dict[str, Any]) -> str:
    """Return a TOML text of a table of numbers, texts, lists and tables."""
    return "\n".join(f"{key} = {_value(value)}" for key, value in table.items()) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return json.dumps(value)
