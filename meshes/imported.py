"""Meshes that a user brings: a file of triangles or quadrilaterals with named groups, .msh (read by gmsh) or .med (by meshio)."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshes.checked import Checked, ModelError, quantity
from meshes.plate import Point, gmsh_session

SUFFIXES = (".msh", ".med")

ORDERS = {2: 1, 3: 1, 9: 2, 10: 2}
"""Order of triangles and quadrilaterals by gmsh's number of an element type."""


@dataclass(frozen=True)
class MeshFile(Checked):
    """A mesh in a file; its groups of surfaces, edges and points keep their names."""

    path: Path
    degree: int | None = quantity("polynomial degree of the displacement", default=None, at_least=1, at_most=3)

    def check(self) -> None:
        """Refuse what is not there or is no format with named groups."""
        if self.path.suffix.lower() not in SUFFIXES:
            raise ModelError("file", f"expected a file name ending in {' or '.join(SUFFIXES)}, got {self.path.name!r}")
        if not self.path.is_file():
            raise ModelError("file", f"there is no file {self.path}")

    @property
    def corners(self) -> dict[str, Point]:
        """No points are known before the file is read."""
        return {}

    @property
    def edges(self) -> dict[str, tuple[Point, Point]]:
        """No edges are known before the file is read."""
        return {}


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
        yield model, groups, ORDERS[kinds.pop()]


def _unreadable(path: Path, error: Exception) -> ModelError:
    return ModelError("mesh.file", f"{path} cannot be read as a mesh: {' '.join(str(error).split())[:200] or type(error).__name__}")


def _read_msh(gmsh: Any, path: Path) -> Entities:
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
