"""Meshes that a user brings: a file of triangles or quadrilaterals with named groups, .msh or .med."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import uplift
from uplift.meshes.cell_shapes import check_places, check_shapes, say_overlaps
from uplift.meshes.checked import Checked, ModelError, quantity
from uplift.meshes.discrete import Entities, discrete_model
from uplift.meshes.file_groups import plain_mesh
from uplift.meshes.findings import say
from uplift.meshes.gmsh_session import gmsh_session
from uplift.meshes.joining import check_hanging, check_joined, merged
from uplift.meshes.plain import ORDERS, PlainMesh, place_in_words, sides_of
from uplift.meshes.plate import Point

SUFFIXES = (".msh", ".med")

HEADS = {".msh": (b"$MeshFormat", b"$Comments"), ".med": (b"\x89HDF\r\n\x1a\n",)}
"""How a file of each suffix begins. gmsh takes any other file for a script, and runs it."""

REMEDY = 'merge = true under [mesh] joins them, cracks = ["GROUP"] keeps those of a group apart'


@dataclass(frozen=True)
class MeshFile(Checked):
    """A mesh in a file; its groups of surfaces, edges and points keep their names."""

    path: Path
    degree: int | None = quantity("polynomial degree of the displacement", default=None, at_least=1, at_most=3)
    merge: bool = quantity("join nodes at one place, as of parts that were meshed apart", default=False)
    cracks: tuple[str, ...] = quantity("groups at whose nodes the mesh is meant to be open: nodes at one place stay apart", default=())

    def check(self) -> None:
        """Refuse what is not there or is no format with named groups."""
        if self.path.suffix.lower() not in SUFFIXES:
            raise ModelError("file", f"expected a file name ending in {' or '.join(SUFFIXES)}, got {self.path.name!r:.200}")
        try:
            there = self.path.is_file()
        except (OSError, ValueError):  # such as a name that is too long, or holds a null
            there = False
        if not there:
            raise ModelError("file", f"there is no file {self.path!s:.200}")
        if self.merge and self.cracks:
            raise ModelError("cracks", "expected either merge = true or cracks, not both")

    @property
    def corners(self) -> dict[str, Point]:
        """No points are known before the file is read."""
        return {}

    @property
    def edges(self) -> dict[str, tuple[Point, Point]]:
        """No edges are known before the file is read."""
        return {}


@contextmanager
def imported_model(source: MeshFile) -> Iterator[tuple[Any, Entities, int]]:
    """Give a gmsh model of the file, the entities of each named group and the order of the cells.

    Call on one rank only; gmsh is closed on leaving. Raises `ModelError` for a file that cannot be read or holds no surface, cells of
    several kinds, or cells that no element can live on.
    """
    mesh = read_mesh_file(source)
    with gmsh_session() as gmsh:
        yield gmsh.model, discrete_model(gmsh.model, mesh), ORDERS[mesh.kind]


def read_mesh_file(source: MeshFile) -> PlainMesh:
    """Return the checked mesh of a file. Raises `ModelError` with the reason where there is none in it."""
    try:
        mesh = _used_nodes(plain_mesh(_contents(source.path)), source.path)
        check_places(mesh, "mesh.file")
        if source.merge:
            mesh = merged(mesh)
        _check_cells(mesh)
        check_shapes(mesh, "mesh.file")
        check_joined(mesh, source.cracks, "mesh.file", REMEDY)
        check_hanging(mesh, source.cracks, "mesh.file")
        _check_lines(mesh)
    except ModelError as error:
        raise ModelError(error.key, f"{source.path}: {error.message}") from None
    say_overlaps(mesh)
    return mesh


def _contents(path: Path) -> dict[str, np.ndarray]:
    """Read the file in another process, which may break down on it, run on or ask for all memory; return its arrays."""
    suffix = path.suffix.lower()
    with path.open("rb") as file:
        head = file.read(16)
    if not head.startswith(HEADS[suffix]):
        expected = "$MeshFormat" if suffix == ".msh" else "the signature of HDF5"
        raise ModelError("mesh.file", f"cannot be read as a mesh: it begins with {head[:12]!r} and not with {expected}")
    launcher = ("OMPI_", "PMIX", "PMI_", "PRTE", "PYTHON")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(launcher)}
    environment |= {"PYTHONPATH": str(Path(str(uplift.__file__)).parent), "OPENBLAS_NUM_THREADS": "1"}
    patience = 60.0 + path.stat().st_size / 1e6
    with tempfile.TemporaryDirectory() as folder:
        # Under another name in a folder of its own: nothing that lies beside the file, such as gmsh's .opt, is read with it.
        alias, out = Path(folder) / f"mesh{suffix}", Path(folder) / "mesh.npz"
        alias.symlink_to(path.absolute())
        command = [sys.executable, "-m", "uplift.meshes.file_reader", str(alias), str(out)]
        try:
            done = subprocess.run(command, env=environment, cwd=folder, capture_output=True, timeout=patience)
        except subprocess.TimeoutExpired:
            raise ModelError("mesh.file", "cannot be read as a mesh: reading it does not come to an end") from None
        if done.returncode:
            words = done.stdout.decode("utf-8", "replace").strip().splitlines()
            why = words[-1] if done.returncode == 1 and words else "the reader breaks down on it"
            raise ModelError("mesh.file", f"cannot be read as a mesh: {why}")
        with np.load(out) as arrays:
            return {name: arrays[name] for name in arrays.files}


def _used_nodes(mesh: PlainMesh, path: Path) -> PlainMesh:
    """Return the mesh without nodes of no cell, such as the centres of arcs, of which it says how many there were."""
    used = np.unique(mesh.cells)
    lonely = np.setdiff1d(np.arange(len(mesh.points)), used)
    if not len(lonely):
        return mesh
    if mesh.lines.size and not np.isin(mesh.lines, used).all():
        for name, members in mesh.line_groups.items():
            if not np.isin(mesh.lines[members], used).all():
                raise ModelError("mesh.file", f"a line of the group {name!r} lies on no cell")
    say("mesh", f"{path.name}: {len(lonely)} nodes of no cell are left out, the first at {place_in_words(mesh.points[lonely[0]])}",
        severity="note")
    index = np.full(len(mesh.points), -1)
    index[used] = np.arange(len(used))
    points = {name: index[nodes][index[nodes] >= 0] for name, nodes in mesh.point_groups.items()}
    return replace(
        mesh, points=mesh.points[used], cells=index[mesh.cells], lines=index[mesh.lines],
        point_groups={name: nodes for name, nodes in points.items() if len(nodes)},
    )


def _check_cells(mesh: PlainMesh) -> None:
    """Refuse cells with one node twice, and one cell twice, with which no mesh can be distributed."""
    cells = np.sort(mesh.cells, axis=1)
    if np.any(cells[:, 1:] == cells[:, :-1]):
        raise ModelError("mesh.file", "a cell has one node twice")
    _, counts = np.unique(cells, axis=0, return_counts=True)
    if np.any(counts > 1):
        raise ModelError("mesh.file", f"{int(np.sum(counts > 1))} cells are there twice, on the same nodes")


def _check_lines(mesh: PlainMesh) -> None:
    """Refuse lines of a group that are no side of a cell."""
    if not len(mesh.lines):
        return
    span = np.int64(len(mesh.points))
    ends, lines = sides_of(mesh.corners)[0], np.sort(mesh.lines[:, :2], axis=1)
    there = np.isin(lines[:, 0].astype(np.int64) * span + lines[:, 1], ends[:, 0].astype(np.int64) * span + ends[:, 1])
    for name, members in mesh.line_groups.items():
        lost = members[~there[members]]
        if len(lost):
            place = place_in_words(mesh.points[mesh.lines[lost[0], :2]].mean(axis=0))
            raise ModelError("mesh.file", f"{len(lost)} lines of the group {name!r} are no side of a cell, the first around {place}")
