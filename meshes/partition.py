"""Which rank gets which cells, where more than two cells meet along an edge.

A rank of dolfinx 0.9 learns which of its vertices others hold too from those sides that it holds one cell of, a rank of dolfinx 0.5
from the cells that others send it beside its own, by default those across a side that it holds one cell of. Both fail along a joint of
plates, where a rank may hold two of three cells: the third gets vertices of its own, and the joint has come open.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components

# The sides of a cell between its vertices, in the order of dolfinx, by the number of vertices.
SIDES = {3: ((0, 1), (0, 2), (1, 2)), 4: ((0, 1), (0, 2), (1, 3), (2, 3))}


def keep_joints_whole(cells: np.ndarray, owners: np.ndarray) -> np.ndarray:
    """Return `owners` (cells,), changed where the ranks could not tell that they share a vertex.

    `cells` (cells, 3 or 4) holds the vertices of triangles or quadrilaterals in the order of dolfinx. All cells around a vertex that one
    of its ranks holds no lone side of go to one rank, to that which had the most of them.
    """
    owners = owners.copy()
    glued = np.zeros(0, dtype=cells.dtype)
    while (lost := _unseen(cells, owners)).size:
        glued = np.union1d(glued, lost)
        cell, corner = np.nonzero(np.isin(cells, glued))
        vertex = np.searchsorted(glued, cells[cell, corner])
        size = len(cells) + len(glued)
        graph = coo_matrix((np.ones(len(cell), dtype=np.int8), (cell, len(cells) + vertex)), shape=(size, size))
        component = connected_components(graph, directed=False)[1][: len(cells)]
        touched = np.unique(cell)
        _, index = np.unique(component[touched], return_inverse=True)
        votes = np.zeros((index.max() + 1, owners.max() + 1), dtype=int)
        np.add.at(votes, (index, owners[touched]), 1)
        owners[touched] = votes.argmax(axis=1)[index]
    return owners


def ranks_at_vertices(cells: np.ndarray, owners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return all ranks that hold a vertex of each cell, its owner first, cell after cell, and where each begins (cells + 1,)."""
    number = np.arange(len(cells))
    ranks = csr_matrix((np.ones(len(cells)), (number, owners)))
    vertices = np.unique(cells, return_inverse=True)[1].reshape(cells.shape)
    corners = csr_matrix((np.ones(cells.size), (np.repeat(number, cells.shape[1]), vertices.ravel())))
    near = (corners @ (corners.T @ ranks)).tocoo()
    order = np.lexsort((near.col, near.col != owners[near.row], near.row))
    starts = np.concatenate([[0], np.cumsum(np.bincount(near.row, minlength=len(cells)))])
    return near.col[order].astype(np.int32), starts.astype(np.int32)


def _unseen(cells: np.ndarray, owners: np.ndarray) -> np.ndarray:
    """Return the vertices on several ranks that one of these holds no lone side of."""
    ranks = int(owners.max()) + 1 if len(owners) else 1
    held = np.unique(cells * ranks + owners[:, None])
    vertices, counts = np.unique(held // ranks, return_counts=True)
    shared = held[np.isin(held // ranks, vertices[counts > 1])]
    ends = np.concatenate([cells[:, side] for side in map(list, SIDES[cells.shape[1]])])
    sides = np.column_stack([np.tile(owners, len(SIDES[cells.shape[1]])), np.sort(ends, axis=1)])
    sides, times = np.unique(sides, axis=0, return_counts=True)
    lone = sides[times == 1]
    seen = np.concatenate([lone[:, 1], lone[:, 2]]) * ranks + np.tile(lone[:, 0], 2)
    return np.unique(shared[~np.isin(shared, seen)] // ranks)
