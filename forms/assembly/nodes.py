"""Nodes of groups of the mesh: which they are, and the share of length or area that belongs to each."""

from __future__ import annotations

from typing import Any

import dolfinx.fem
import numpy as np
from petsc4py import PETSc
from scipy.spatial import cKDTree

from uplift.forms.contact.supports import Placed
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import Space, vector_of
from uplift.meshes.groups import GroupNames, groups_in_words, names_in
from uplift.meshes.tagged import SIDES, TaggedMesh, extent_of

LENGTHS = {1: (0.5, 0.5), 2: (1 / 6, 4 / 6, 1 / 6), 3: (1 / 12, 5 / 12, 5 / 12, 1 / 12)}
"""Integrals of the Lagrange functions of an edge of length 1 by degree: ends outside, inner nodes at the Gauss-Lobatto points."""


def nodes_of(tagged: TaggedMesh, space: Space, group: GroupNames) -> np.ndarray:
    """Return the nodes that this rank owns on one or several groups of the mesh, sorted (collective).

    Raises `ModelError` for an unknown group.
    """
    dimension = tagged.dimension(group)
    owned = space.dofmap.index_map.size_local
    if dimension == 0:
        at = space.tabulate_dof_coordinates()[:owned]
        extent = extent_of(tagged.mesh.geometry.x, tagged.mesh.comm)
        wanted = cKDTree(np.concatenate([tagged.point(name) for name in names_in(group)]))
        return np.flatnonzero(wanted.query(at)[0] <= 1e-6 * extent) if owned else np.zeros(0, dtype=int)
    entities = tagged.facets(group) if dimension == 1 else tagged.cells(group)
    tagged.mesh.topology.create_connectivity(dimension, 2)
    nodes = dolfinx.fem.locate_dofs_topological(space, dimension, entities.astype(np.int32))
    return np.unique(nodes[nodes < owned])


def lengths(tagged: TaggedMesh, space: Space, degree: int, group: GroupNames) -> np.ndarray:
    """Return the length in m of the edge `group` that belongs to each node of `space`, owned and ghost, on this rank alone."""
    ends_of, layout = SIDES[tagged.mesh.topology.cell_type.name], space.dofmap.dof_layout
    at = space.tabulate_dof_coordinates()
    share, weights = np.zeros(len(at)), LENGTHS[degree]
    for cell, side in {facet: (cell, side) for facet, cell, side in tagged.sides(group)}.values():
        nodes = space.dofmap.cell_dofs(cell)
        ends = nodes[list(ends_of[side])]  # the nodes at the corners come first
        length = float(np.linalg.norm(at[ends[1]] - at[ends[0]]))
        share[ends] += weights[0] * length
        share[nodes[layout.entity_dofs(1, side)]] += np.array(weights[1:-1]) * length
    return share


def to_owners(space: Space, values: np.ndarray) -> np.ndarray:
    """Sum values (n, ) of owned and ghost nodes over the ranks; return those of the owned ones (collective)."""
    index_map = space.dofmap.index_map
    if space.mesh.comm.size == 1:
        return values[: index_map.size_local]
    function = dolfinx.fem.Function(space)
    block, owned = space.dofmap.index_map_bs, index_map.size_local
    vector = vector_of(function)
    with vector.localForm() as local:
        local.array[:] = np.repeat(values, block)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    total: np.ndarray = np.real(vector.array_r[: block * owned : block]).copy()
    return total


def at_named_points(placed: Placed, tagged: TaggedMesh) -> Placed:
    """Return a placed group with the points that it names spelled out, all of a group of points. Raises `ModelError` for an unknown one."""
    if not any(isinstance(point, str) for point in placed.points):
        return placed
    points, shares = [], []
    for point, share in zip(placed.points, placed.factors, strict=True):
        try:
            found = tagged.point(point) if isinstance(point, str) else np.array([point])
        except ModelError as error:
            raise ModelError("points", error.message) from None
        points.append(found)
        shares.append(np.full(len(found), share))
    return placed.at(np.concatenate(points), np.concatenate(shares))


def at_nodes(placed: Placed, tagged: TaggedMesh, space: Space, degree: int, area: Any) -> Placed:
    """Return a placed group with its points spelled out: the nodes of its group of the mesh in order of coordinates (collective).

    `area(group)` gives the area (n_owned,) in m2 that belongs to each owned node. Raises `ModelError` for a group that
    the mesh does not have or that is no line or surface where a share of it is asked for.
    """
    if not placed.group:
        return at_named_points(placed, tagged)
    nodes = nodes_of(tagged, space, placed.group)
    share = np.ones(len(nodes))
    needed = {"length": 1, "area": 2}.get(placed.per)
    if needed is not None:
        if tagged.dimension(placed.group) != needed:
            words = f"{groups_in_words(placed.group)!r} has no {placed.per}: it is {'an edge' if needed == 2 else 'no edge'}"
            raise ModelError("per", words)
        share = (to_owners(space, lengths(tagged, space, degree, placed.group)) if needed == 1 else area(placed.group))[nodes]
        nodes, share = nodes[share > 0], share[share > 0]
    parts = tagged.mesh.comm.allgather((space.tabulate_dof_coordinates()[nodes], share))
    points, shares = np.concatenate([p for p, _ in parts]), np.concatenate([s for _, s in parts])
    if not len(points):
        raise ModelError("group", f"{groups_in_words(placed.group)!r} holds no node of the mesh")
    extent = extent_of(tagged.mesh.geometry.x, tagged.mesh.comm)
    order = np.lexsort(np.round(points / extent, 9).T)
    return placed.at(points[order], shares[order])
