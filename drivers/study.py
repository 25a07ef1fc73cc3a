"""A parameter study: one basis, then seconds a case.

Values of a scene are changed by their path in the file. A case lives in the basis that is there if the change leaves alone what a basis
is made of: signals, amplitudes, gravity, gaps, preloads and time steps do. One that does not, a material, a support's stiffness or the
mesh, gets a basis of its own, unless the basis comes from a file, which belongs to one model and is refused for another.
"""

from __future__ import annotations

import copy
import csv
import itertools
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from drivers import plots
from drivers.analysis import Plant, prepare
from drivers.output import all_or_nothing, versions, write_summary
from drivers.reduced_methods import basis_notes, basis_of, start_in_basis
from drivers.request import Request
from drivers.scene import Scene, build_scene
from meshes.checked import ModelError
from solvers import reduced
from solvers.basis_file import fingerprint, load_outside
from solvers.errors import SolverError
from solvers.krylov import KrylovBasis
from solvers.parameters import KrylovSettings

log = logging.getLogger(__name__)

SECONDS = "seconds"

MANY = 100_000
"""More cases than this are a slip of the pen."""


@dataclass(frozen=True)
class Variation:
    """A value of the scene, by its path in the file, and what it is set to."""

    key: str
    values: tuple[float, ...]


def variation(text: str) -> Variation:
    """Read `key=first:last:number` (equidistant) or `key=a,b,c`. Raises `ModelError` for anything else."""
    key, _, spec = text.partition("=")
    try:
        if ":" in spec:
            first, last, number = spec.split(":")
            values = tuple(np.linspace(float(first), float(last), int(number)).tolist())
        else:
            values = tuple(float(part) for part in spec.split(","))
    except ValueError:
        values = ()
    if not key.strip() or not values or not np.all(np.isfinite(values)):
        raise ModelError("--vary", f"expected KEY=FIRST:LAST:NUMBER or KEY=A,B,..., as load.amplitude=0.5:8:16, got {text!r}")
    return Variation(key.strip(), values)


def changed(table: dict[str, Any], key: str, value: float) -> None:
    """Set the entry of a scene's table at a dotted path; tables of an array go by their name, or by their number from 1.

    Raises `ModelError` if there is no such table, or if the entry is there and no number.
    """
    *path, last = key.split(".")
    here: Any = table
    for depth, part in enumerate(path):
        if isinstance(here, list):
            named = [entry for number, entry in enumerate(here, start=1) if part in (entry.get("name"), str(number))]
            here = named[0] if named else None
        else:
            here = here.get(part)
        if not isinstance(here, (dict, list)):
            raise ModelError("--vary", f"{key}: the scene has no {'.'.join(path[: depth + 1])}")
    if isinstance(here, list):
        raise ModelError("--vary", f"{key}: {'.'.join(path)} has several entries; name one of them: {', '.join(_names(here))}")
    old = here.get(last, 0.0)
    if isinstance(old, bool) or not isinstance(old, (int, float)):
        raise ModelError("--vary", f"{key}: expected the path of a number, found {old!r:.40}")
    here[last] = int(value) if isinstance(old, int) and float(value).is_integer() else value


def _names(entries: list[dict[str, Any]]) -> list[str]:
    return [str(entry.get("name", number)) for number, entry in enumerate(entries, start=1)]


def cases_of(scene: Scene, folder: Path, variations: list[Variation]) -> list[tuple[tuple[float, ...], Scene]]:
    """Return the values and the scene of every combination, all of them checked. Raises `ModelError` for one that cannot be."""
    if np.prod([float(len(v.values)) for v in variations]) > MANY:
        raise ModelError("--vary", f"expected at most {MANY} cases")
    cases = []
    for values in itertools.product(*(v.values for v in variations)):
        table = copy.deepcopy(scene.source)
        for v, value in zip(variations, values, strict=True):
            changed(table, v.key, value)
        made = build_scene(table, folder)
        Request("transient", basis=0.5).check(made)
        cases.append((values, made))
    return cases


class _Stage:
    """The model of the case at hand and the bases made so far; `with` frees what is assembled."""

    def __init__(self, comm: Any, tolerance: float, path: Path | None) -> None:
        self.comm, self.tolerance, self.path = comm, tolerance, path
        self.plant: Plant | None = None
        self.model: reduced.ReducedModel | None = None
        self.bases: dict[str, tuple[KrylovBasis, KrylovSettings]] = {}

    def __enter__(self) -> _Stage:
        return self

    def __exit__(self, *args: object) -> None:
        if self.plant is not None:
            self.plant.__exit__(*args)

    @property
    def probe_names(self) -> tuple[str, ...]:
        """Names of the probes' displacements."""
        assert self.plant is not None
        return self.plant.operators.probes.names

    def set(self, scene: Scene) -> reduced.ReducedModel:
        """Return the reduced model of a scene, from what is there as far as that goes (collective)."""
        if self.plant is not None and self.model is not None and _same_but_for_signals(self.plant.scene, scene):
            return replace(self.model, histories=_histories(self.plant, scene))
        if self.plant is not None:
            self.plant.__exit__()
            self.plant = None
        self.plant = prepare(scene, self.comm)
        self.model = reduced.project(self.plant.operators, self._basis(self.plant))
        return self.model

    def _basis(self, plant: Plant) -> KrylovBasis:
        mark = fingerprint(plant.operators)
        if mark in self.bases:
            basis, settings = self.bases[mark]
            if load_outside(plant.operators, basis, settings) is None:
                return basis
        if self.bases and self.path is not None:
            words = "a case has another stiffness, mass, damping, contacts or shape of loads; without the file it gets a basis of its own"
            raise ModelError("--basis-file", f"{self.path} serves one model: {words}")
        self.bases[mark] = basis_of(plant, self.tolerance, self.path)
        return self.bases[mark][0]


def _same_but_for_signals(one: Scene, other: Scene) -> bool:
    same = one.plate == other.plate and replace(one.model, motions=()) == replace(other.model, motions=())
    return same and [m.direction for m in one.model.motions] == [m.direction for m in other.model.motions]


def _histories(plant: Plant, scene: Scene) -> tuple[Callable[[np.ndarray], np.ndarray], ...]:
    """Return the load histories of the assembled model with the signals of `scene` in place of its own."""
    signals = {id(own.signal): new.signal for own, new in zip(plant.scene.model.motions, scene.model.motions, strict=True)}
    return tuple(signals.get(id(load.history), load.history) for load in plant.operators.loads)


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
                log.warning("%s: %s", ", ".join(f"{v.key} = {x:g}" for v, x in zip(variations, values, strict=True)), error)
                found = []
            rows.append([*values, *found, time.perf_counter() - start])
        notes = [basis_notes(*pair) for pair in stage.bases.values()]
    width = len(variations) + len(columns) + 1
    rows = [row if len(row) == width else [*row[: len(variations)], *[float("nan")] * len(columns), row[-1]] for row in rows]
    facts = {"cases": len(rows), "failed": failures, "bases": notes, "seconds": time.perf_counter() - begin, "versions": versions()}
    return [*(v.key for v in variations), *columns, SECONDS], rows, facts


def _extremes(model: reduced.ReducedModel, scene: Scene, probe_names: tuple[str, ...]) -> tuple[list[str], list[float]]:
    settings = scene.transient
    assert settings is not None
    start = start_in_basis(settings, model, exact_uplift=True)
    run = reduced.march(
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
