"""A distributed mesh together with the names of its groups."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from meshes.checked import ModelError
from meshes.plate import Plate, gmsh_model
from meshes.releases import distribute


@dataclass(frozen=True)
class TaggedMesh:
    """A dolfinx mesh and its named groups, the same names on every rank."""

    mesh: Any
    cell_tags: Any
    facet_tags: Any
    groups: dict[str, tuple[int, int]]
    """Name -> (dimension, tag) of the groups of cells and edges."""
    points: dict[str, np.ndarray]
    """Name -> coordinates (3,) in m of the groups that hold a single point."""

    def facets(self, name: str) -> np.ndarray:
        """Return the local facets of the edge group `name` (empty on a rank that has none)."""
        dimension, tag = self.groups.get(name, (-1, -1))
        if dimension != self.mesh.topology.dim - 1:
            known = ", ".join(n for n, (d, _) in self.groups.items() if d == self.mesh.topology.dim - 1)
            raise ModelError("", f"no edge group {name!r} in the mesh (there are: {known})")
        return np.asarray(self.facet_tags.find(tag))

    def point(self, name: str) -> np.ndarray:
        """Return the coordinates (3,) in m of the point group `name`."""
        if name not in self.points:
            raise ModelError("", f"no point group {name!r} in the mesh (there are: {', '.join(self.points)})")
        return self.points[name]


def from_gmsh(comm: Any, model: Any | None) -> TaggedMesh:
    """Distribute the gmsh model of rank 0 (None on the other ranks) with its group names (collective)."""
    groups: dict[str, tuple[int, int]] = {}
    points: dict[str, np.ndarray] = {}
    if comm.rank == 0:
        assert model is not None
        for dimension, tag in model.getPhysicalGroups():
            name = model.getPhysicalName(dimension, tag)
            if dimension > 0:
                groups[name] = (dimension, tag)
                continue
            nodes, coordinates = model.mesh.getNodesForPhysicalGroup(0, tag)
            if len(nodes) == 1:
                points[name] = np.array(coordinates, dtype=float)
    groups, points = comm.bcast((groups, points), root=0)
    mesh, cell_tags, facet_tags = distribute(model, comm)
    return TaggedMesh(mesh, cell_tags, facet_tags, groups, points)


def build_plate(comm: Any, plate: Plate) -> TaggedMesh:
    """Mesh the plate on rank 0 and distribute it over `comm` (collective)."""
    if comm.rank == 0:
        with gmsh_model(plate) as model:
            return from_gmsh(comm, model)
    return from_gmsh(comm, None)
