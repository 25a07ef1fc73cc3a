"""A distributed mesh together with the names of its groups."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from uplift.meshes.checked import ModelError
from uplift.meshes.compat import distribute
from uplift.meshes.discrete import Entities
from uplift.meshes.groups import GroupNames, groups_in_words, names_in
from uplift.meshes.imported import MeshFile, imported_model
from uplift.meshes.panels import Panels
from uplift.meshes.panels_gmsh import panels_model
from uplift.meshes.parts import MeshPart, names_of_parts, part_of_cells
from uplift.meshes.plain import mesh_of_model
from uplift.meshes.plate import gmsh_model
from uplift.meshes.sources import MeshSource

SIDES = {"triangle": ((1, 2), (0, 2), (0, 1)), "quadrilateral": ((0, 1), (0, 2), (1, 3), (2, 3))}
"""Corners at the ends of each side of a cell, in the numbering of dolfinx."""


@dataclass(frozen=True)
class TaggedMesh:
    """A dolfinx mesh and its named groups, the same names on every rank."""

    mesh: Any
    cell_tags: Any
    facet_tags: Any
    groups: dict[str, tuple[int, tuple[int, ...]]]
    """Name -> (dimension, tags) of the groups of cells (2) and edges (1)."""
    points: dict[str, np.ndarray]
    """Name -> coordinates (n, 3) in m of the groups of points."""
    parts: tuple[MeshPart, ...] = ()
    """What no side of a cell joins; empty where the mesh is one."""
    level: float = 0.0
    """Height Z in m of a mesh in the plane, whose own coordinates have Z = 0."""

    def facets(self, name: GroupNames) -> np.ndarray:
        """Return the local facets of an edge group, or of several, sorted (empty on a rank that has none)."""
        return self._members(name, 1, self.facet_tags)

    def cells(self, name: GroupNames) -> np.ndarray:
        """Return the local cells of a surface group, or of several, sorted (empty on a rank that has none)."""
        return self._members(name, 2, self.cell_tags)

    def dimension(self, name: GroupNames) -> int:
        """Return the dimension of a group: 2 for cells, 1 for edges, 0 for points.

        Raises `ModelError` for an unknown name, and for several of different dimensions.
        """
        dimensions = [self._dimension(one) for one in names_in(name)]
        if len(set(dimensions)) != 1:
            raise ModelError("", f"expected groups of one dimension, {groups_in_words(name)} are of several")
        return dimensions[0]

    def _dimension(self, name: str) -> int:
        if name in self.groups:
            return self.groups[name][0]
        if name in self.points:
            return 0
        known = ", ".join([*self.groups, *self.points])
        raise ModelError("", f"no group {name!r} in the mesh (there are: {known})" if known else f"no group {name!r}: the mesh has none")

    def _members(self, groups: GroupNames, dimension: int, tags: Any) -> np.ndarray:
        found = []
        for name in names_in(groups):
            here, numbers = self.groups.get(name, (-1, ()))
            if here != dimension:
                known = ", ".join(n for n, (d, _) in self.groups.items() if d == dimension) or "none"
                raise ModelError("", f"no {'edge' if dimension == 1 else 'surface'} group {name!r} in the mesh (there are: {known})")
            found += [tags.find(number) for number in numbers]
        return np.unique(np.concatenate(found))

    def sides(self, name: GroupNames) -> list[tuple[int, int, int]]:
        """Return (facet, cell, side of the cell) of each cell at each facet of an edge group that this rank owns."""
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

    def cell_sides(self, name: GroupNames) -> list[tuple[int, tuple[int, int]]]:
        """Return (cell, corners at the ends of its side) of each cell that this rank owns at an edge group."""
        topology = self.mesh.topology
        for pair in ((1, 2), (2, 1)):
            topology.create_connectivity(*pair)
        to_cells, to_facets = topology.connectivity(1, 2), topology.connectivity(2, 1)
        ends, owned = SIDES[self.mesh.topology.cell_name()], topology.index_map(2).size_local
        return [
            (int(cell), ends[int(np.flatnonzero(to_facets.links(cell) == facet)[0])])
            for facet in self.facets(name) for cell in to_cells.links(facet) if cell < owned
        ]

    def point(self, name: str) -> np.ndarray:
        """Return the coordinates (n, 3) in m of the point group `name`."""
        if name not in self.points:
            raise ModelError("", f"no point group {name!r} in the mesh (there are: {', '.join(self.points) or 'none'})")
        return self.points[name]


def from_gmsh(comm: Any, model: Any | None, gdim: int = 2, groups: Entities | None = None) -> TaggedMesh:
    """Distribute the gmsh model of rank 0 (None on the other ranks) with its group names (collective).

    `groups` are the entities (dimension, tag) of each named group, on rank 0; without them they are the model's physical groups.
    An entity may belong to several groups.
    """
    known: tuple[Any, ...] = ({}, {}, ())
    if comm.rank == 0:
        assert model is not None
        tags, points = _number_entities(model, physical_groups(model) if groups is None else groups)
        known = tags, points, _parts(model, tags)
    tags, points, parts = comm.bcast(known, root=0)
    mesh, cell_tags, facet_tags = distribute(model, comm, gdim)
    return TaggedMesh(mesh, cell_tags, facet_tags, tags, points, parts)


def _parts(model: Any, groups: dict[str, tuple[int, tuple[int, ...]]]) -> tuple[MeshPart, ...]:
    """Return the parts of the mesh, none where it is one; no surface of the model reaches over two."""
    mesh, surface = mesh_of_model(model)
    part = part_of_cells(mesh.corners)
    if part.max(initial=0) == 0:
        return ()
    cells = {name: np.flatnonzero(np.isin(surface, tags)) for name, (dimension, tags) in groups.items() if dimension == 2}
    names = names_of_parts(replace(mesh, cell_groups=cells), part)
    return tuple(MeshPart(name, tuple(int(t) for t in np.unique(surface[part == number]))) for number, name in enumerate(names))


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
        nodes = sorted({int(n) for _, tag in entities for kind in model.mesh.getElements(0, tag)[2] for n in kind})
        if nodes:
            points[name] = np.array([model.mesh.getNode(node)[0] for node in nodes])
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


def build_mesh(comm: Any, source: MeshSource, layout: Callable[[bool, int, float], tuple[int, int]]) -> TaggedMesh:
    """Mesh `source` on rank 0 and distribute it over `comm` (collective).

    `layout(flat, order, level)`, called on all ranks, is told whether all nodes lie in a plane Z = level and the order of the cells, and
    says whether the mesh shall be one in the plane (2) or in space (3) and of which order. Errors of rank 0 are raised on all ranks.
    """
    with ExitStack() as stack:
        model, entities = None, None
        known: tuple[float | None, int, tuple[str, str] | None] = None, 0, None
        if comm.rank == 0:
            try:
                model, entities, order = stack.enter_context(opened(source))
                known = _level(model), order, None
            except ModelError as error:
                known = None, 0, (error.key, error.message)
        level, order, wrong = comm.bcast(known, root=0)
        if wrong is not None:
            raise ModelError(*wrong)
        gdim, wanted = layout(level is not None, order, level or 0.0)
        if model is not None and wanted != order:
            model.mesh.setOrder(wanted)
        tagged = from_gmsh(comm, model, gdim, entities)
        cells = tagged.mesh.topology.index_map(2)
        if comm.allreduce(cells.size_local, op=MPI.MIN) == 0:
            raise ModelError("mpirun -n", f"{comm.size} ranks are too many for {cells.size_global} cells: some have none; take fewer ranks")
        tagged.points.update({name: np.array([point]) for name, point in source.corners.items()})
        if gdim == 3 or not level:
            return tagged
        return replace(tagged, level=level, points={name: at - np.array([0.0, 0.0, level]) for name, at in tagged.points.items()})


def _level(model: Any) -> float | None:
    """Return the height Z in m of the plane that all nodes lie in, None where there is no such plane."""
    coordinates = model.mesh.getNodes()[1].reshape(-1, 3)
    same = 1e-9 * np.ptp(coordinates, axis=0).max()
    if np.ptp(coordinates[:, 2]) > same:
        return None
    level = float(np.median(coordinates[:, 2]))
    return level if abs(level) > same else 0.0


def extent_of(points: np.ndarray, comm: Any) -> float:
    """Return the longest side in m of the box that holds the points (n, 3) of all ranks, some of which may have none (collective)."""
    ends = np.concatenate([points.max(axis=0), -points.min(axis=0)]) if len(points) else np.full(6, -np.inf)
    highest = np.empty_like(ends)
    comm.Allreduce(ends, highest, op=MPI.MAX)
    return float(np.max(highest[:3] + highest[3:]))
