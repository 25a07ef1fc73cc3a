"""A distributed mesh together with the names of its groups."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from uplift.meshes.checked import ModelError
from uplift.meshes.compat import distribute
from uplift.meshes.imported import MeshFile, imported_model
from uplift.meshes.panels import Panels
from uplift.meshes.panels_gmsh import panels_model
from uplift.meshes.plate import gmsh_model
from uplift.meshes.sources import MeshSource

SIDES = {"triangle": ((1, 2), (0, 2), (0, 1)), "quadrilateral": ((0, 1), (0, 2), (1, 3), (2, 3))}
"""Corners at the ends of each side of a cell, in the numbering of dolfinx."""

Entities = dict[str, list[tuple[int, int]]]
"""Group -> its entities (dimension, tag) in gmsh."""


@dataclass(frozen=True)
class TaggedMesh:
    """A dolfinx mesh and its named groups, the same names on every rank."""

    mesh: Any
    cell_tags: Any
    facet_tags: Any
    groups: dict[str, tuple[int, tuple[int, ...]]]
    """Name -> (dimension, tags) of the groups of cells (2) and edges (1)."""
    points: dict[str, np.ndarray]
    """Name -> coordinates (3,) in m of the groups that hold a single point."""

    def facets(self, name: str) -> np.ndarray:
        """Return the local facets of the edge group `name`, sorted (empty on a rank that has none)."""
        return self._members(name, 1, self.facet_tags)

    def cells(self, name: str) -> np.ndarray:
        """Return the local cells of the surface group `name`, sorted (empty on a rank that has none)."""
        return self._members(name, 2, self.cell_tags)

    def dimension(self, name: str) -> int:
        """Return the dimension of the group: 2 for cells, 1 for edges, 0 for a point. Raises `ModelError` for an unknown name."""
        if name in self.groups:
            return self.groups[name][0]
        if name in self.points:
            return 0
        known = ", ".join([*self.groups, *self.points])
        raise ModelError("", f"no group {name!r} in the mesh (there are: {known})")

    def _members(self, name: str, dimension: int, tags: Any) -> np.ndarray:
        here, numbers = self.groups.get(name, (-1, ()))
        if here != dimension:
            known = ", ".join(n for n, (d, _) in self.groups.items() if d == dimension)
            raise ModelError("", f"no {'edge' if dimension == 1 else 'surface'} group {name!r} in the mesh (there are: {known})")
        return np.unique(np.concatenate([tags.find(number) for number in numbers]))

    def sides(self, name: str) -> list[tuple[int, int, int]]:
        """Return (facet, cell, side of the cell) of each cell at each facet of the edge group `name` that this rank owns."""
        topology = self.mesh.topology
        for pair in ((1, 2), (2, 1)):
            topology.create_connectivity(*pair)
        to_cells, to_facets = topology.connectivity(1, 2), topology.connectivity(2, 1)
        owned = self.facets(name)
        owned = owned[owned < topology.index_map(1).size_local]
        return [
            (int(facet), int(cell), int(np.flatnonzero(to_facets.links(cell) == facet)[0]))
            for facet in owned for cell in to_cells.links(facet)
        ]

    def point(self, name: str) -> np.ndarray:
        """Return the coordinates (3,) in m of the point group `name`."""
        if name not in self.points:
            raise ModelError("", f"no point group {name!r} in the mesh (there are: {', '.join(self.points)})")
        return self.points[name]


def from_gmsh(comm: Any, model: Any | None, gdim: int = 2, groups: Entities | None = None) -> TaggedMesh:
    """Distribute the gmsh model of rank 0 (None on the other ranks) with its group names (collective).

    `groups` are the entities (dimension, tag) of each named group, on rank 0; without them they are the model's physical groups.
    An entity may belong to several groups. A group that holds a single node is a point.
    """
    tags: dict[str, tuple[int, tuple[int, ...]]] = {}
    points: dict[str, np.ndarray] = {}
    if comm.rank == 0:
        assert model is not None
        tags, points = _number_entities(model, physical_groups(model) if groups is None else groups)
    tags, points = comm.bcast((tags, points), root=0)
    mesh, cell_tags, facet_tags = distribute(model, comm, gdim)
    return TaggedMesh(mesh, cell_tags, facet_tags, tags, points)


def physical_groups(model: Any) -> Entities:
    """Return the entities of the physical groups of a gmsh model by name."""
    groups: Entities = {}
    for dimension, tag in model.getPhysicalGroups():
        members = [(dimension, int(entity)) for entity in model.getEntitiesForPhysicalGroup(dimension, tag)]
        groups.setdefault(model.getPhysicalName(dimension, tag), []).extend(members)
    return groups


def _number_entities(
    model: Any, groups: Entities
) -> tuple[dict[str, tuple[int, tuple[int, ...]]], dict[str, np.ndarray]]:
    """Give each surface, and each curve that has a name, a number of its own, so that a cell has one tag and any number of names."""
    tags: dict[str, tuple[int, tuple[int, ...]]] = {}
    points: dict[str, np.ndarray] = {}
    for name, entities in groups.items():
        dimension = max(d for d, _ in entities)
        if dimension > 0:
            tags[name] = dimension, tuple(tag for d, tag in entities if d == dimension)
            continue
        nodes = {int(n) for _, tag in entities for kind in model.mesh.getElements(0, tag)[2] for n in kind}
        if len(nodes) == 1:
            points[name] = np.array(model.mesh.getNode(nodes.pop())[0])
    model.removePhysicalGroups()
    curves = sorted({tag for dimension, numbers in tags.values() if dimension == 1 for tag in numbers})
    for dimension, numbers in ((2, [tag for _, tag in model.getEntities(2)]), (1, curves)):
        for tag in numbers:
            if len(model.mesh.getElementTypes(dimension, tag)):
                model.addPhysicalGroup(dimension, [tag], tag)
    return tags, points


@contextmanager
def opened(source: MeshSource) -> Iterator[tuple[Any, Entities | None, int]]:
    """Give the gmsh model of a mesh of the first order (or of the order of its file), its groups and the order, on one rank."""
    if isinstance(source, MeshFile):
        with imported_model(source) as (model, entities, order):
            yield model, entities, order
    elif isinstance(source, Panels):
        with panels_model(source) as (model, entities):
            yield model, entities, 1
    else:
        with gmsh_model(source) as model:
            yield model, None, 1


def build_mesh(comm: Any, source: MeshSource, layout: Callable[[bool, int], tuple[int, int]]) -> TaggedMesh:
    """Mesh `source` on rank 0 and distribute it over `comm` (collective).

    `layout(flat, order)`, called on all ranks, is told whether all nodes lie in the plane Z = 0 and the order of the cells, and says
    whether the mesh shall be one in the plane (2) or in space (3) and of which order. Errors of rank 0 are raised on all ranks.
    """
    with ExitStack() as stack:
        model, entities = None, None
        known: tuple[bool, int, tuple[str, str] | None] = False, 0, None
        if comm.rank == 0:
            try:
                model, entities, order = stack.enter_context(opened(source))
                known = _flat(model), order, None
            except ModelError as error:
                known = False, 0, (error.key, error.message)
        flat, order, wrong = comm.bcast(known, root=0)
        if wrong is not None:
            raise ModelError(*wrong)
        gdim, wanted = layout(flat, order)
        if model is not None and wanted != order:
            model.mesh.setOrder(wanted)
        tagged = from_gmsh(comm, model, gdim, entities)
        tagged.points.update({name: np.array(point) for name, point in source.corners.items()})
        return tagged


def _flat(model: Any) -> bool:
    coordinates = model.mesh.getNodes()[1].reshape(-1, 3)
    return bool(np.max(np.abs(coordinates[:, 2])) <= 1e-9 * np.ptp(coordinates, axis=0).max())


def extent_of(points: np.ndarray, comm: Any) -> float:
    """Return the longest side in m of the box that holds the points (n, 3) of all ranks, some of which may have none (collective)."""
    ends = np.concatenate([points.max(axis=0), -points.min(axis=0)]) if len(points) else np.full(6, -np.inf)
    highest = np.empty_like(ends)
    comm.Allreduce(ends, highest, op=MPI.MAX)
    return float(np.max(highest[:3] + highest[3:]))
