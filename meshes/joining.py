"""Nodes of a mesh at one place: joined, declared to be a crack, or refused; and nodes that lie on a cell that does not have them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uplift.meshes.checked import ModelError
from uplift.meshes.findings import say
from uplift.meshes.plain import PlainMesh, numbered_sides, pairs_in_reach, place_in_words

SAME = 1e-6
"""Of the extent: nodes closer than this are at one place, which is also how near a support has to be to its node."""

NEAR = 1e-2
"""Of the shortest side at a node: a free edge that lies so near to another was hardly meant to be apart."""


def place_pairs(mesh: PlainMesh) -> np.ndarray:
    """Return the pairs (p, 2) of nodes at one place, in order."""
    from scipy.spatial import cKDTree

    pairs = cKDTree(mesh.points).query_pairs(SAME * mesh.extent, output_type="ndarray")
    return pairs[np.lexsort(pairs.T[::-1])]


def merged(mesh: PlainMesh) -> PlainMesh:
    """Return the mesh with nodes at one place made one, the first of them. Raises `ModelError` where a cell loses a side by it."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    pairs, n = place_pairs(mesh), len(mesh.points)
    if not len(pairs):
        return mesh
    place = connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), shape=(n, n)), directed=False)[1]
    _, first, number = np.unique(place, return_index=True, return_inverse=True)
    cells = number[mesh.cells]
    if np.any(np.diff(np.sort(cells, axis=1), axis=1) == 0):
        at = mesh.points[mesh.cells[np.argmax(np.any(np.diff(np.sort(cells, axis=1), axis=1) == 0, axis=1))][0]]
        raise ModelError("mesh.merge", f"a cell at {place_in_words(at)} has two nodes at one place")
    return replace(
        mesh, points=mesh.points[first], cells=cells, lines=number[mesh.lines],
        point_groups={name: np.unique(number[nodes]) for name, nodes in mesh.point_groups.items()},
    )


def check_joined(mesh: PlainMesh, cracks: tuple[str, ...], key: str, remedy: str) -> None:
    """Raise `ModelError` (of `key`) where two nodes are at one place and none of them lies in one of the groups `cracks`.

    `remedy` says what a user may do about it.
    """
    pairs = place_pairs(mesh)
    if not len(pairs):
        return
    apart = np.zeros(len(mesh.points), dtype=bool)
    for name in cracks:
        apart[nodes_of_group(mesh, name)] = True
    pairs = pairs[~apart[pairs].any(axis=1)]
    if not len(pairs):
        return
    one, other = (mesh.groups_at(node) for node in pairs[0])
    names = " and ".join(dict.fromkeys(name for name in (one, other) if name))
    raise ModelError(
        key, f"{len(pairs)} pairs of nodes lie at one place and are not joined, the first at {place_in_words(mesh.points[pairs[0, 0]])}"
        f"{f' (cells of {names})' if names else ''}; {remedy}"
    )


def nodes_of_group(mesh: PlainMesh, name: str) -> np.ndarray:
    """Return the nodes of a group of any dimension. Raises `ModelError` for an unknown name."""
    if name in mesh.cell_groups:
        return np.unique(mesh.cells[mesh.cell_groups[name]])
    if name in mesh.line_groups:
        return np.unique(mesh.lines[mesh.line_groups[name]])
    if name in mesh.point_groups:
        return mesh.point_groups[name]
    known = ", ".join([*mesh.cell_groups, *mesh.line_groups, *mesh.point_groups])
    raise ModelError("mesh.cracks", f"no group {name!r} in the mesh (there are: {known})")


def check_hanging(mesh: PlainMesh, cracks: tuple[str, ...], key: str) -> None:
    """Raise `ModelError` (of `key`) where a node of a free edge lies on a cell that does not have it, but in groups `cracks`.

    Nodes on a side of a cell between its corners (hanging nodes) and inside a cell (a wall that ends on a raft) are found. Free edges
    that lie nearer than `NEAR` to a cell without touching it are said.
    """
    corners, points = mesh.corners, mesh.points
    sides, side, _ = numbered_sides(corners)
    lone = np.unique(sides[np.bincount(side) == 1])
    apart = [nodes_of_group(mesh, name) for name in cracks]
    lone = np.setdiff1d(lone, np.concatenate(apart)) if apart else lone
    at = points[corners]
    length = np.linalg.norm(np.roll(at, -1, axis=1) - at, axis=2)
    shortest, centre = length.min(axis=1), at.mean(axis=1)
    reach = np.linalg.norm(at - centre[:, None], axis=2).max(axis=1)
    index, cell = pairs_in_reach(points[lone], centre, reach * (1 + NEAR))
    node = lone[index]
    foreign = ~np.any(mesh.cells[cell] == node[:, None], axis=1)
    cell, node = cell[foreign], node[foreign]
    if not len(cell):
        return
    distance = _distances(points[node], at[cell])
    same = SAME * mesh.extent
    # What lies at one place with a node of the cell was looked at before.
    doubled = np.linalg.norm(points[mesh.cells[cell]] - points[node][:, None], axis=2).min(axis=1) <= same
    on = (distance <= same) & ~doubled
    if on.any():
        first = int(np.argmax(on))
        one, other = mesh.groups_at(int(node[first])), mesh.groups_of_cells(cell[first : first + 1])
        raise ModelError(
            key, f"a node at {place_in_words(points[node[first]])}{f' (cells of {one})' if one else ''} lies on a cell"
            f"{f' of {other}' if other else ''} that does not have it as a corner: the two are not joined there; {int(on.sum())} such nodes"
        )
    near = (distance > same) & (distance <= NEAR * shortest[cell]) & ~doubled
    if near.any():
        first = int(np.argmax(near))
        say("gap", f"a free edge at {place_in_words(points[node[first]])} lies {distance[first]:.3g} m from a cell of "
                   f"{mesh.groups_of_cells(cell[first : first + 1]) or 'the mesh'} and is not joined to it")


def _distances(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the distance (p,) in m of each point (p, 3) from its cell (p, 3 or 4, 3), taken as flat triangles."""
    triangles = [cells[:, [0, 1, 2]]] + ([cells[:, [0, 2, 3]]] if cells.shape[1] == 4 else [])
    nearest = np.full(len(points), np.inf)
    for triangle in triangles:
        ends = np.roll(triangle, -1, axis=1)
        for k in range(3):
            along, arm = ends[:, k] - triangle[:, k], points - triangle[:, k]
            square = np.sum(along**2, axis=1)
            ratio = np.clip(np.sum(arm * along, axis=1) / np.where(square > 0, square, 1.0), 0.0, 1.0)
            nearest = np.minimum(nearest, np.linalg.norm(arm - ratio[:, None] * along, axis=1))
        normal = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = normal / np.where(size > 0, size, 1.0)
        turns = np.stack([np.sum(np.cross(ends[:, k] - triangle[:, k], points - triangle[:, k]) * normal, axis=1) for k in range(3)])
        inside = np.all(turns >= 0, axis=0) & (size[:, 0] > 0)
        nearest = np.where(inside, np.minimum(nearest, np.abs(np.sum((points - triangle[:, 0]) * normal, axis=1))), nearest)
    return nearest
