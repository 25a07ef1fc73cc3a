"""Meshes that a user brings: a file of triangles or quadrilaterals with named groups, .msh (read by gmsh) or .med (by meshio)."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uplift.meshes.checked import Checked, ModelError, quantity
from uplift.meshes.gmsh_session import gmsh_session
from uplift.meshes.plate import LARGEST, Point

SUFFIXES = (".msh", ".med")

ORDERS = {2: 1, 3: 1, 9: 2, 10: 2}
"""Order of triangles and quadrilaterals by gmsh's number of an element type."""

TRIANGLES = (2, 9)
"""Of these the triangles."""


@dataclass(frozen=True)
class MeshFile(Checked):
    """A mesh in a file; its groups of surfaces, edges and points keep their names."""

    path: Path
    degree: int | None = quantity("polynomial degree of the displacement", default=None, at_least=1, at_most=3)

    def check(self) -> None:
        """Refuse what is not there or is no format with named groups."""
        if self.path.suffix.lower() not in SUFFIXES:
            raise ModelError("file", f"expected a file name ending in {' or '.join(SUFFIXES)}, got {self.path.name!r}")
        try:
            there = self.path.is_file()
        except OSError:  # such as a name that is too long
            there = False
        if not there:
            raise ModelError("file", f"there is no file {self.path!s:.200}")

    @property
    def corners(self) -> dict[str, Point]:
        """No points are known before the file is read."""
        return {}

    @property
    def edges(self) -> dict[str, tuple[Point, Point]]:
        """No edges are known before the file is read."""
        return {}


LINES = {1: 1, 2: 8}
"""gmsh's number of a line by its order."""

MESHIO = {"vertex": (0, 15), "line": (1, 1), "line3": (1, 8), "triangle": (2, 2), "triangle6": (2, 9), "quad": (2, 3), "quad9": (2, 10)}
"""Dimension and gmsh's number of the element types that meshio names so."""

Entities = dict[str, list[tuple[int, int]]]


@contextmanager
def imported_model(source: MeshFile) -> Iterator[tuple[Any, Entities, int]]:
    """Give the gmsh model of the file, the entities of each named group and the order of the cells.

    Call on one rank only; gmsh is closed on leaving. Raises `ModelError` for a file that cannot be read or holds no surface,
    or cells of several kinds.
    """
    with gmsh_session() as gmsh:
        groups = _read_med(gmsh, source.path) if source.path.suffix.lower() == ".med" else _read_msh(gmsh, source.path)
        model = gmsh.model
        kinds = {int(kind) for dimension, tag in model.getEntities(2) for kind in model.mesh.getElementTypes(dimension, tag)}
        if not kinds:
            raise ModelError("mesh.file", f"{source.path} holds no triangles or quadrilaterals")
        if len(kinds) > 1 or not kinds <= set(ORDERS):
            names = " and ".join(str(model.mesh.getElementProperties(kind)[0]) for kind in sorted(kinds))
            raise ModelError("mesh.file", f"{source.path} holds {names} cells; expected triangles alone or quadrilaterals alone")
        check_cells(model, source.path, kinds)
        _check_nodes(model, source.path, kinds)
        _check_edges(model, source.path, groups, kinds)
        yield model, groups, ORDERS[kinds.pop()]


READER = """
import sys, gmsh
gmsh.initialize([], False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.open(sys.argv[1])
gmsh.model.mesh.getNodes()
gmsh.model.mesh.getElements()
"""


def _try_in_child(path: Path) -> None:
    """Raise `ModelError` where gmsh does not survive the file, which it reads without looking: found out by another process."""
    launcher = ("OMPI_", "PMIX", "PMI_", "PRTE")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(launcher)}
    patience = 60.0 + path.stat().st_size / 1e6
    try:
        done = subprocess.run([sys.executable, "-c", READER, str(path)], env=environment, capture_output=True, timeout=patience)
    except subprocess.TimeoutExpired:
        raise ModelError("mesh.file", f"{path} cannot be read as a mesh: gmsh does not come to an end") from None
    if done.returncode < 0:
        raise ModelError("mesh.file", f"{path} cannot be read as a mesh: gmsh breaks down on it")


def check_cells(model: Any, path: Path, kinds: set[int]) -> None:
    """Refuse cells on nodes that are not there, on one node twice, and one cell twice, with which no mesh can be distributed."""
    known, coordinates = model.mesh.getNodes()[:2]
    if not np.all(np.abs(coordinates) <= LARGEST):
        raise ModelError("mesh.file", f"{path} holds a node farther than {LARGEST:g} m from the origin, or nowhere")
    for kind in kinds:
        corners = 3 if kind in TRIANGLES else 4
        tags, nodes = model.mesh.getElementsByType(kind)
        cells = np.sort(np.reshape(nodes, (len(tags), -1)), axis=1)
        if not np.all(np.isin(cells, known)):
            raise ModelError("mesh.file", f"{path} holds a cell on a node that is not there")
        if cells.shape[1] < corners or np.any(cells[:, 1:] == cells[:, :-1]):
            raise ModelError("mesh.file", f"{path} holds a cell with one node twice")
        if len(np.unique(cells, axis=0)) < len(cells):
            raise ModelError("mesh.file", f"{path} holds one cell twice")


def _check_nodes(model: Any, path: Path, kinds: set[int]) -> None:
    """Refuse nodes of no cell: the distribution of a mesh writes past its memory where there are some."""
    used = np.unique(np.concatenate([model.mesh.getElementsByType(kind)[1] for kind in kinds]))
    lonely = np.setdiff1d(model.mesh.getNodes()[0], used)
    if len(lonely):
        raise ModelError("mesh.file", f"{path} holds {len(lonely)} nodes that belong to no cell, the first is {lonely[0]}; remove them")


def _check_edges(model: Any, path: Path, groups: Entities, kinds: set[int]) -> None:
    """Refuse lines of a named group that are not of the order of the cells or do not lie on nodes of cells."""
    used = np.unique(np.concatenate([model.mesh.getElementsByType(kind)[1] for kind in kinds]))
    line = LINES[max(ORDERS[kind] for kind in kinds)]
    for name, entities in groups.items():
        for dimension, tag in entities:
            if dimension != 1:
                continue
            found, _, nodes = model.mesh.getElements(dimension, tag)
            if any(int(kind) != line for kind in found):
                raise ModelError("mesh.file", f"{path} holds lines in the group {name!r} that are not of the order of the cells")
            if not all(np.all(np.isin(part, used)) for part in nodes):
                raise ModelError("mesh.file", f"{path} holds a line in the group {name!r} that lies on no cell")


def _unreadable(path: Path, error: Exception) -> ModelError:
    return ModelError("mesh.file", f"{path} cannot be read as a mesh: {' '.join(str(error).split())[:200] or type(error).__name__}")


def _read_msh(gmsh: Any, path: Path) -> Entities:
    _try_in_child(path)
    try:
        gmsh.open(str(path))
    except Exception as error:  # gmsh raises plain exceptions, of a class that differs between releases
        raise _unreadable(path, error) from None
    model = gmsh.model
    groups: Entities = {}
    for dimension, tag in model.getPhysicalGroups():
        name = model.getPhysicalName(dimension, tag)
        if name and dimension <= 2:
            groups.setdefault(name, []).extend((dimension, int(e)) for e in model.getEntitiesForPhysicalGroup(dimension, tag))
    return {name: [entity for entity in entities if entity[0] == max(entities)[0]] for name, entities in groups.items()}


def _read_med(gmsh: Any, path: Path) -> Entities:
    """Read a MED file into discrete entities, one for each family of cells and for each family of a single node."""
    import meshio

    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio raises whatever HDF5 does, and exits on what it does not know
        raise _unreadable(path, error if isinstance(error, Exception) else ValueError("not a MED file")) from None
    model = gmsh.model
    model.add("imported")
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    groups: Entities = {}
    home = model.addDiscreteEntity(2, 1)  # nodes live in the first entity, cells in one of their family
    model.mesh.addNodes(2, home, np.arange(1, len(points) + 1), points.ravel())
    names, number = {int(k): v for k, v in (getattr(mesh, "cell_tags", None) or {}).items()}, 1
    for block, families in zip(mesh.cells, mesh.cell_data.get("cell_tags", [np.zeros(len(b.data), int) for b in mesh.cells]), strict=True):
        if block.type not in MESHIO:
            raise ModelError("mesh.file", f"{path} holds {block.type} cells; expected triangles alone or quadrilaterals alone")
        dimension, kind = MESHIO[block.type]
        for family in np.unique(families):
            number += 1
            model.addDiscreteEntity(dimension, number)
            model.mesh.addElementsByType(number, kind, [], block.data[families == family].ravel() + 1)
            for name in names.get(int(family), []):
                groups.setdefault(name, []).append((dimension, number))
    at = np.asarray(mesh.point_data.get("point_tags", np.zeros(len(points))))
    for family, members in (getattr(mesh, "point_tags", None) or {}).items():
        node = np.flatnonzero(at == family)
        if len(node) == 1:
            number += 1
            model.addDiscreteEntity(0, number)
            model.mesh.addElementsByType(number, 15, [], node + 1)
            for name in members:
                groups.setdefault(name, []).append((0, number))
    return {name: [entity for entity in entities if entity[0] == max(entities)[0]] for name, entities in groups.items()}
