"""Where points lie: the node of a space at a point, and the interpolation of a field at a point."""

from __future__ import annotations

import dolfinx.fem
import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from uplift.meshes.checked import ModelError
from uplift.meshes.compat import Space, cell_containing
from uplift.meshes.tagged import extent_of


def owned_nodes(space: Space, points: np.ndarray, what: str) -> np.ndarray:
    """Return for each point (n, 3) m the local node that this rank owns there, or -1 (collective).

    Raises `ModelError` on every rank if a point is at no node.
    """
    comm = space.mesh.comm
    owned = space.dofmap.index_map.size_local
    nodes = space.tabulate_dof_coordinates()[:owned]
    extent = extent_of(nodes, comm)
    found = np.full(len(points), -1)
    distance = np.full(len(points), np.inf)
    if owned and len(points):
        distance, nearest = cKDTree(nodes).query(points)
        found = np.where(distance <= 1e-6 * extent, nearest, -1)
    nearest_anywhere = np.empty_like(distance)
    comm.Allreduce(distance, nearest_anywhere, op=MPI.MIN)
    for point, d in zip(points, nearest_anywhere, strict=True):
        if not d <= 1e-6 * extent:
            raise ModelError("", f"{what} at {in_words(point)} stands on no node of the mesh (the nearest is {d:.3g} m away)")
    return found


def in_words(point: np.ndarray) -> str:
    """Return a point (3,) as text, without its Z where that is zero."""
    shown = point if point[2] else point[:2]
    return f"({', '.join(f'{x:g}' for x in shown)}) m"


def interpolation(space: Space, point: np.ndarray, what: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes that this rank owns and the weights that interpolate a component at `point` (3,) m (collective).

    Raises `ModelError` on every rank if the point lies outside the mesh.
    """
    comm, index_map, block = space.mesh.comm, space.dofmap.index_map, space.dofmap.index_map_bs
    owned = space.tabulate_dof_coordinates()[: index_map.size_local]
    apart = np.linalg.norm(owned - point, axis=1)
    nearest = float(apart.min(initial=np.inf))
    extent = extent_of(space.mesh.geometry.x, comm)
    if comm.allreduce(nearest, op=MPI.MIN) <= 1e-9 * extent:
        closest = comm.allreduce((nearest, comm.rank), op=MPI.MINLOC)[1]
        here = [int(np.argmin(apart))] if comm.rank == closest else []
        return np.array(here, dtype=int), np.ones(len(here))
    cell = cell_containing(space.mesh, point)
    owner = comm.allreduce(comm.rank if cell >= 0 else comm.size, op=MPI.MIN)
    if owner == comm.size:
        raise ModelError("", f"{what} at {in_words(point)} lies outside the plate")
    found = None
    shape = dolfinx.fem.Function(space)  # collective
    if owner == comm.rank:
        nodes = np.asarray(space.dofmap.cell_dofs(cell), dtype=np.int32)
        weights = np.zeros(len(nodes))
        for i, node in enumerate(nodes):
            shape.x.array[:] = 0.0
            shape.x.array[block * node] = 1.0
            weights[i] = np.real(shape.eval(point, np.array([cell], dtype=np.int32)).ravel()[0])
        found = np.asarray(index_map.local_to_global(nodes)), weights
    # Some nodes of the cell may belong to other ranks: each takes its own.
    nodes, weights = comm.bcast(found, root=owner)
    first, last = index_map.local_range
    mine = (nodes >= first) & (nodes < last) & (np.abs(weights) > 1e-14)
    return nodes[mine] - first, weights[mine]
