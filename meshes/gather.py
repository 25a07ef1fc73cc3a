"""Bring a distributed mesh and nodal values to rank 0, for pictures and files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import dolfinx
import numpy as np

from uplift.meshes.compat import dof_cells, geometry_cells
from uplift.meshes.tagged import TaggedMesh


@dataclass(frozen=True)
class WholeMesh:
    """A mesh on one rank, nodes in the order of the input, cells in the order of VTK."""

    points: np.ndarray
    """(n_nodes, 3) m."""
    cells: np.ndarray
    """(n_cells, nodes a cell)."""
    cell_type: str
    """meshio's name, such as "quad9"."""

    @property
    def corners(self) -> np.ndarray:
        """The corner nodes of each cell (n_cells, 3 or 4), around the cell."""
        return self.cells[:, : 3 if self.cell_type.startswith("triangle") else 4]


def gather_mesh(tagged: TaggedMesh) -> WholeMesh | None:
    """Return the whole mesh on rank 0, None elsewhere (collective)."""
    mesh = tagged.mesh
    cells = geometry_cells(mesh)[: mesh.topology.index_map(mesh.topology.dim).size_local]
    numbers = np.asarray(mesh.geometry.input_global_indices)
    order = np.argsort(dolfinx.cpp.io.perm_vtk(mesh.topology.cell_type, cells.shape[1]))
    parts = mesh.comm.gather((numbers, mesh.geometry.x, numbers[cells[:, order]]), root=0)
    if parts is None:
        return None
    points = np.zeros((1 + max(int(p[0].max(initial=-1)) for p in parts), 3))
    for indices, x, _ in parts:
        points[indices] = x
    points[:, 2] += tagged.level
    shape = "triangle" if cells.shape[1] in (3, 6) else "quad"
    cell_type = shape + {3: "", 4: "", 6: "6", 9: "9"}[cells.shape[1]]
    return WholeMesh(points, np.concatenate([p[2] for p in parts]), cell_type)


def gather_nodal(tagged: TaggedMesh, space: Any, values: np.ndarray) -> np.ndarray | None:
    """Return values at the nodes of the whole mesh on rank 0, None elsewhere (collective).

    `values` (n, components) belong to the owned and ghost nodes of `space`, whose first ones in each cell are those of the geometry.
    """
    mesh = tagged.mesh
    at_nodes = np.zeros((len(mesh.geometry.x), values.shape[1]))
    cells = geometry_cells(mesh)
    at_nodes[cells] = values[dof_cells(space)[:, : cells.shape[1]]]
    parts = mesh.comm.gather((np.asarray(mesh.geometry.input_global_indices), at_nodes), root=0)
    if parts is None:
        return None
    whole = np.zeros((1 + max(int(i.max(initial=-1)) for i, _ in parts), values.shape[1]))
    for indices, part in parts:
        whole[indices] = part
    return whole
