"""Parts of a mesh: cells that hang together along sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.meshes.plain import PlainMesh, numbered_sides, place_in_words


@dataclass(frozen=True)
class MeshPart:
    """A part of the mesh that no side joins to the rest."""

    name: str
    """What a user calls it: its groups, or a place."""
    surfaces: tuple[int, ...]
    """Tags of its cells."""


def part_of_cells(corners: np.ndarray) -> np.ndarray:
    """Return the number (m,) of the part of each cell, from 0; `corners` (m, 3 or 4).

    Cells that share a side belong to one part, and so do parts that share two nodes: one node is a hinge about which a plate in its
    plane turns, and in bending it holds a plate through one corner of a cell, which depends on the mesh alone.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    _, side, cell = numbered_sides(corners)
    part = _components(side, cell, len(corners))
    while part.max(initial=0) > 0:
        count = int(part.max()) + 1
        nodes = np.unique(corners.ravel().astype(np.int64) * count + np.repeat(part, corners.shape[1]))
        node, owner = nodes // count, nodes % count
        _, where, times = np.unique(node, return_inverse=True, return_counts=True)
        shared = times[where] > 1
        node, owner = node[shared], owner[shared]
        # Pairs of parts by the nodes that both have; few nodes are shared, each by few parts.
        meeting = coo_matrix((np.ones(len(node)), (owner, np.unique(node, return_inverse=True)[1]))).tocsr() if len(node) else None
        if meeting is None:
            break
        common = (meeting @ meeting.T).tocoo()
        joined = (common.row != common.col) & (common.data > 1)
        if not joined.any():
            break
        graph = coo_matrix((common.data[joined], (common.row[joined], common.col[joined])), shape=(count, count))
        part = connected_components(graph, directed=False)[1][part]
    return part


def _components(side: np.ndarray, cell: np.ndarray, cells: int) -> np.ndarray:
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    size = cells + int(side.max(initial=-1)) + 1
    graph = coo_matrix((np.ones(len(cell), dtype=np.int8), (cell, cells + side)), shape=(size, size))
    part = connected_components(graph, directed=False)[1][:cells]
    number: np.ndarray = np.unique(part, return_inverse=True)[1]
    return number


def names_of_parts(mesh: PlainMesh, part: np.ndarray) -> list[str]:
    """Return what a user calls each part: the groups that lie in it alone, else those that have cells in it, else a place."""
    names = []
    for number in range(int(part.max(initial=0)) + 1):
        inside = part == number
        own = [name for name, members in mesh.cell_groups.items() if len(members) and inside[members].all()]
        some = own or [name for name, members in mesh.cell_groups.items() if inside[members].any()]
        place = place_in_words(mesh.points[mesh.corners[np.argmax(inside)]].mean(axis=0))
        groups = " and ".join(repr(name) for name in some[:3])
        names.append(f"{groups} around {place}" if groups and not own else groups or f"the cells around {place}")
    return names
