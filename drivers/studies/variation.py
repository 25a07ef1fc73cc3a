"""A parameter study: one basis, then seconds a case.

Values of a scene are changed by their path in the file. A case lives in the basis that is there if the change leaves alone what a basis
is made of: signals, amplitudes, gravity, gaps, preloads and time steps do. One that does not, a material, a support's stiffness or the
mesh, gets a basis of its own, unless the basis comes from a file, which belongs to one model and is refused for another.
"""

from __future__ import annotations

import csv
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene, prepare
from uplift.drivers.analysis.basis import basis_notes, basis_of
from uplift.drivers.analysis.initial_state import start_state
from uplift.drivers.analysis.task import Task
from uplift.drivers.report.pictures import draw as draw_picture
from uplift.drivers.results.folder import all_or_nothing, versions, write_summary
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import Scene
from uplift.drivers.scene.vary import Variation, cases_of
from uplift.drivers.studies.study_plots import draw_study
from uplift.forms.operators import Operators
from uplift.meshes.checked import ModelError
from uplift.meshes.findings import say
from uplift.solvers.bases.krylov import KrylovBasis
from uplift.solvers.bases.project import project
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.basis_file import fingerprint, load_outside
from uplift.solvers.errors import SolverError
from uplift.solvers.time_domain.march import stepper_of, transient

SECONDS = "seconds"


class _Stage:
    """The model of the case at hand and the bases made so far; `with` frees what is assembled."""

    def __init__(self, comm: Any, tolerance: float, path: Path | None) -> None:
        self.comm, self.tolerance, self.path = comm, tolerance, path
        self.assembly: AssembledScene | None = None
        self.model: Operators | None = None
        self.bases: dict[str, tuple[KrylovBasis, KrylovSettings]] = {}

    def __enter__(self) -> _Stage:
        return self

    def __exit__(self, *args: object) -> None:
        self._free()

    def _free(self) -> None:
        for owner in (self.model, self.assembly):
            if owner is not None:
                owner.__exit__()
        self.model = self.assembly = None

    def set(self, scene: Scene) -> Operators:
        """Return the reduced model of a scene, from what is there as far as that goes (collective)."""
        if self.assembly is not None and self.model is not None and _same_but_for_signals(self.assembly.scene, scene):
            return _with_signals(self.model, self.assembly.scene, scene)
        self._free()
        self.assembly = prepare(scene, self.comm)
        self.model = project(self.assembly.operators, self._basis(self.assembly))
        return self.model

    def _basis(self, assembly: AssembledScene) -> KrylovBasis:
        mark = fingerprint(assembly.operators)
        if mark in self.bases:
            basis, settings = self.bases[mark]
            if load_outside(assembly.operators, basis, settings) is None:
                return basis
        if self.bases and self.path is not None:
            words = "a case has another stiffness, mass, damping, contacts or shape of loads; without the file it gets a basis of its own"
            raise ModelError("--basis-file", f"{self.path} serves one model: {words}")
        self.bases[mark] = basis_of(assembly, self.tolerance, self.path)
        return self.bases[mark][0]


def _same_but_for_signals(one: Scene, other: Scene) -> bool:
    same = one.plate == other.plate and replace(one.model, motions=()) == replace(other.model, motions=())
    return same and [m.direction for m in one.model.motions] == [m.direction for m in other.model.motions]


def _with_signals(model: Operators, own: Scene, scene: Scene) -> Operators:
    """Return the model of the scene `own` with the signals of `scene` in place of its own."""
    signals = {id(old.signal): new.signal for old, new in zip(own.model.motions, scene.model.motions, strict=True)}
    return replace(model, loads=[replace(load, history=signals.get(id(load.history), load.history)) for load in model.loads])


@dataclass(frozen=True)
class StudyTable:
    """The extremes of all cases."""

    title: str
    varied: int
    """Number of values that are varied."""
    columns: list[str]
    """Names: the varied values, the extremes, the seconds."""
    rows: list[list[float]]
    """One a case, nan where it has no answer."""
    facts: dict[str, Any]
    """For the summary."""

    def lines(self) -> list[str]:
        """Return the table as text."""
        widths = [max(len(name), 12) for name in self.columns]
        lines = ["  ".join(f"{name:>{width}}" for name, width in zip(self.columns, widths, strict=True))]
        lines += ["  ".join(f"{value:>{width}.6g}" for value, width in zip(row, widths, strict=True)) for row in self.rows]
        return lines


def run_study(scene: Scene, variations: list[Variation], tolerance: float, path: Path | None, comm: Any) -> StudyTable:
    """Run every case with exact uplift in bases to `tolerance`, kept in the file `path` (collective).

    A case that has no answer gets a row of nan, and the log says why.
    """
    cases = cases_of(scene, variations)
    begin = time.perf_counter()
    columns: list[str] = []
    rows: list[list[float]] = []
    failures = 0
    with _Stage(comm, tolerance, path) as stage:
        for values, case in cases:
            start = time.perf_counter()
            try:
                model = stage.set(case)
                assert stage.assembly is not None
                names, found = _extremes(stage.assembly, model, case)
                columns = columns or names
            except SolverError as error:
                failures += 1
                say("failed case", f"{', '.join(f'{v.key} = {x:g}' for v, x in zip(variations, values, strict=True))}: {error}")
                found = []
            rows.append([*values, *found, time.perf_counter() - start])
        notes = [basis_notes(*pair) for pair in stage.bases.values()]
    width = len(variations) + len(columns) + 1
    rows = [row if len(row) == width else [*row[: len(variations)], *[float("nan")] * len(columns), row[-1]] for row in rows]
    facts = {"cases": len(rows), "failed": failures, "bases": notes, "seconds": time.perf_counter() - begin, "versions": versions()}
    return StudyTable(scene.title, len(variations), [*(v.key for v in variations), *columns, SECONDS], rows, facts)


def _extremes(assembly: AssembledScene, model: Operators, scene: Scene) -> tuple[list[str], list[float]]:
    """Return the names and the values of the extremes of a case, whose model in the basis is given."""
    task = Task(replace(assembly, scene=scene), model, Request("transient"))
    settings = task.settings
    with start_state(task) as start, stepper_of(model, settings.scheme, settings.step, exact_uplift=True) as stepper:
        history = transient(stepper, start, settings.steps, every=settings.every)
    probes, names, found = history.probes, [], []
    for i, name in enumerate(model.probes.names):
        names += [f"min {name} [m]", f"max {name} [m]"]
        found += [float(probes[:, i].min()), float(probes[:, i].max())]
    if model.contacts.names:
        gap = history.openings(model.contacts.law)
        names += ["largest gap [m]", "most open contacts [%]"]
        found += [float(np.max(gap)), float(100.0 * (gap > 0).mean(axis=1).max())]
    return names, found


def write_study(out: Path, study: StudyTable, *, draw: bool) -> None:
    """Write study.csv, summary.json and study.png into `out`."""
    with all_or_nothing(out) as staging:
        with (staging / "study.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(study.columns)
            writer.writerows([[repr(value) for value in row] for row in study.rows])
        write_summary(staging / "summary.json", study.facts)
        if draw:
            draw_picture(draw_study, staging / "study.png", study.columns, np.array(study.rows), study.varied, study.title)
