"""What a benchmark is, and how its scenes are run: from a scene's table to frequencies, displacements and responses."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import AssembledScene, prepare
from uplift.drivers.analysis.harmonic import probe_responses
from uplift.drivers.analysis.modes import find_modes, wanted_modes
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene
from uplift.forms.shells.kinematics import degree_of
from uplift.meshes.tagged import TaggedMesh
from uplift.solvers.bases.modes import Modes
from uplift.solvers.history import History

TARGETS = Path(__file__).parents[1] / "reference" / "benchmarks.csv"

LIMIT = 0.01
"""Admissible difference from a target, relative, where a case does not say otherwise."""


@dataclass(frozen=True)
class Check:
    """A value beside its target."""

    quantity: str
    unit: str
    value: float
    target: float
    limit: float = LIMIT
    """Admissible difference, relative."""
    note: str = ""
    """What the target is, where that is not the source of the case."""

    scale: float | None = None
    """What the difference is relative to, where that is not the target."""

    @property
    def difference(self) -> float:
        """Relative difference of the value from its target."""
        return (self.value - self.target) / (self.scale or self.target)

    @property
    def met(self) -> bool:
        """Whether the difference is within its limit."""
        return abs(self.difference) <= self.limit


@dataclass(frozen=True)
class Outcome:
    """What one mesh gave."""

    mesh: str
    dofs: int
    checks: tuple[Check, ...]


@dataclass(frozen=True)
class Benchmark:
    """A case: what it is, where its targets come from, and the function that runs it."""

    title: str
    source: str
    run: Callable[[Runner], list[Outcome]]
    remark: str = ""


def targets(case: str) -> dict[str, float]:
    """Return the published targets of a case by quantity."""
    with TARGETS.open(encoding="utf-8", newline="") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return {row["quantity"]: float(row["target"]) for row in rows if row["case"] == case}


@dataclass
class Runner:
    """Runs scenes that are given as tables; mesh files are written to and read from `folder`, the same on all ranks (collective)."""

    comm: Any
    folder: Path
    quick: bool = False
    """Whether cases with several meshes shall run the smaller ones only."""

    def file(self, name: str, write: Callable[..., None], *arguments: Any) -> dict[str, Any]:
        """Write a mesh file on rank 0 by `write(path, *arguments)` unless it is there; return the section [mesh] that reads it."""
        if self.comm.rank == 0 and not (self.folder / name).exists():
            write(self.folder / name, *arguments)
        self.comm.barrier()
        return {"file": name}

    def assembly(self, table: dict[str, Any]) -> AssembledScene:
        """Return the assembled scene."""
        return prepare(build_scene(table, self.folder), self.comm)

    def modes(self, table: dict[str, Any]) -> tuple[Modes, str, int]:
        """Return the modes that the scene asks for, its mesh in words and its dofs."""
        with self.assembly(table) as assembly:
            return find_modes(assembly, wanted_modes(assembly.scene, None, None)), mesh_in_words(assembly), assembly.operators.n

    def history(self, table: dict[str, Any], method: str) -> tuple[dict[str, np.ndarray], History, str, int]:
        """Return the probes' histories by name, all histories of the method, the mesh in words and the dofs."""
        with self.assembly(table) as assembly:
            history = analyse(assembly, Request(method)).final
            probes = dict(zip(assembly.operators.probes.names, history.probes.T, strict=True))
            return probes, history, mesh_in_words(assembly), assembly.operators.n

    def static(self, table: dict[str, Any]) -> tuple[dict[str, float], str, int]:
        """Return the static displacements of the probes by name, the mesh in words and the dofs."""
        probes, _, mesh, dofs = self.history(table, "static")
        return {name: float(values[0]) for name, values in probes.items()}, mesh, dofs

    def harmonic(self, table: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, str, int]:
        """Return the frequencies (n_f,) Hz, the complex answers (n_f, n_probes) to the first load, mesh and dofs."""
        with self.assembly(table) as assembly:
            assert assembly.scene.harmonic is not None
            _, answers = probe_responses(assembly)
            return assembly.scene.harmonic.points, answers[:, :, 0], mesh_in_words(assembly), assembly.operators.n


def mesh_in_words(assembly: AssembledScene) -> str:
    """Return kinematics, number and shape of the cells, and the degree of the displacement (collective)."""
    tagged: TaggedMesh = assembly.tagged
    cell = tagged.mesh.topology.cell_type.name
    number = tagged.mesh.topology.index_map(2).size_global
    return f"{assembly.plate.kind}, {number} {cell}s of degree {degree_of(assembly.plate.kind, assembly.scene.plate.degree, cell)}"
