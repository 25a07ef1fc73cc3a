"""A parameter study: one basis, then seconds a case.

Values of a scene are changed by their path in the file. A case lives in the basis that is there if the change leaves alone what a basis
is made of: signals, amplitudes, gravity, gaps, preloads and time steps do. One that does not, a material, a support's stiffness or the
mesh, gets a basis of its own, unless the basis comes from a file, which belongs to one model and is refused for another.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene, prepare
from uplift.drivers.analysis.basis import basis_notes, basis_of
from uplift.drivers.analysis.reduced_methods import start_in_basis
from uplift.drivers.report import plots
from uplift.drivers.results.folder import all_or_nothing, versions, write_summary
from uplift.drivers.scene.scene import Scene
from uplift.drivers.scene.vary import Variation, cases_of
from uplift.meshes.checked import ModelError
from uplift.meshes.findings import say
from uplift.solvers.bases.krylov import KrylovBasis
from uplift.solvers.bases.project import ReducedModel, project
from uplift.solvers.bases.reduced_march import march as reduced_march
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.basis_file import fingerprint, load_outside
from uplift.solvers.errors import SolverError

SECONDS = "seconds"


class _Stage:
    """The model of the case at hand and the bases made so far; `with` frees what is assembled."""

    def __init__(self, comm: Any, tolerance: float, path: Path | None) -> None:
        self.comm, self.tolerance, self.path = comm, tolerance, path
        self.assembly: AssembledScene | None = None
        self.model: ReducedModel | None = None
        self.bases: dict[str, tuple[KrylovBasis, KrylovSettings]] = {}

    def __enter__(self) -> _Stage:
        return self

    def __exit__(self, *args: object) -> None:
        if self.assembly is not None:
            self.assembly.__exit__(*args)

    @property
    def probe_names(self) -> tuple[str, ...]:
        """Names of the probes' displacements."""
        assert self.assembly is not None
        return self.assembly.operators.probes.names

    def set(self, scene: Scene) -> ReducedModel:
        """Return the reduced model of a scene, from what is there as far as that goes (collective)."""
        if self.assembly is not None and self.model is not None and _same_but_for_signals(self.assembly.scene, scene):
            return replace(self.model, histories=_histories(self.assembly, scene))
        if self.assembly is not None:
            self.assembly.__exit__()
            self.assembly = None
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


def _histories(assembly: AssembledScene, scene: Scene) -> tuple[Callable[[np.ndarray], np.ndarray], ...]:
    """Return the load histories of the assembled model with the signals of `scene` in place of its own."""
    signals = {id(own.signal): new.signal for own, new in zip(assembly.scene.model.motions, scene.model.motions, strict=True)}
    return tuple(signals.get(id(load.history), load.history) for load in assembly.operators.loads)


def run_study(
    scene: Scene, folder: Path, variations: list[Variation], tolerance: float, path: Path | None, comm: Any
) -> tuple[list[str], list[list[float]], dict[str, Any]]:
    """Run every case with exact uplift (collective); return the names of the columns, a row for each case and facts for the summary.

    A case that has no answer gets a row of nan, and the log says why.
    """
    cases = cases_of(scene, folder, variations)
    begin = time.perf_counter()
    columns: list[str] = []
    rows: list[list[float]] = []
    failures = 0
    with _Stage(comm, tolerance, path) as stage:
        for values, case in cases:
            start = time.perf_counter()
            try:
                names, found = _extremes(stage.set(case), case, stage.probe_names)
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
    return [*(v.key for v in variations), *columns, SECONDS], rows, facts


def _extremes(model: ReducedModel, scene: Scene, probe_names: tuple[str, ...]) -> tuple[list[str], list[float]]:
    settings = scene.transient
    assert settings is not None
    start = start_in_basis(settings, model, exact_uplift=True)
    run = reduced_march(
        model, settings.scheme, settings.step, settings.steps, every=settings.every, start=start, exact_uplift=True
    )
    probes = run.coordinates @ model.probes.T
    names, found = [], []
    for i, name in enumerate(probe_names):
        names += [f"min {name} [m]", f"max {name} [m]"]
        found += [float(probes[:, i].min()), float(probes[:, i].max())]
    n_c = model.law.n_contacts
    if n_c:
        names += ["largest gap [m]", "most open contacts [%]"]
        lifted = run.release[:, :n_c] > 0
        found += [float(np.max(model.law.gap(run.release))), float(100.0 * lifted.mean(axis=1).max())]
    return names, found


def table_lines(columns: list[str], rows: list[list[float]]) -> list[str]:
    """Return the table as text."""
    widths = [max(len(name), 12) for name in columns]
    lines = ["  ".join(f"{name:>{width}}" for name, width in zip(columns, widths, strict=True))]
    lines += ["  ".join(f"{value:>{width}.6g}" for value, width in zip(row, widths, strict=True)) for row in rows]
    return lines


def write_study(
    out: Path, columns: list[str], rows: list[list[float]], facts: dict[str, Any], varied: int, title: str, *, draw: bool
) -> None:
    """Write study.csv, summary.json and study.png into `out`."""
    with all_or_nothing(out) as staging:
        with (staging / "study.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows([[repr(value) for value in row] for row in rows])
        write_summary(staging / "summary.json", facts)
        if draw:
            plots.draw_study(staging / "study.png", columns, np.array(rows), varied, title)
