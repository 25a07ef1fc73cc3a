"""Normals of cells, which follow the order of their nodes: of flat meshes, and where neighbours disagree."""

from __future__ import annotations

import numpy as np

from uplift.meshes.compat import Mesh, geometry_cells

ROUND = {3: (0, 1, 2), 4: (0, 1, 3, 2)}
"""Corners of a cell of dolfinx in their order around it."""


def orientation(mesh: Mesh) -> np.ndarray:
    """Return 1 or -1 for each cell of this rank, ghosts included: the sense of its normal along Z in a flat mesh, 1 in space.

    The forms of a flat mesh take Z for the normal of every cell; in space they take that of its nodes.
    """
    cells = geometry_cells(mesh)
    if mesh.geometry.dim == 3:
        return np.ones(len(cells))
    x = mesh.geometry.x
    first, second = x[cells[:, 1]] - x[cells[:, 0]], x[cells[:, 2]] - x[cells[:, 0]]
    return np.sign(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


def disagreeing(mesh: Mesh, cells: np.ndarray) -> tuple[int, np.ndarray]:
    """Return how many pairs of neighbours among `cells` of this rank have opposite normals, and the middle (3,) m of one side between.

    Neighbours go along their common side in opposite senses where their normals agree. Sides of more than two cells do not count; nor do
    neighbours of which no rank has both.
    """
    nodes = geometry_cells(mesh)[cells]
    around = nodes[:, list(ROUND[4 if nodes.shape[1] in (4, 8, 9) else 3])]
    sides = np.stack([around, np.roll(around, -1, axis=1)], axis=2).reshape(-1, 2)
    ordered = np.sort(sides, axis=1)
    _, place, count = np.unique(ordered, axis=0, return_inverse=True, return_counts=True)
    place = place.ravel()
    along = np.bincount(place, weights=np.where(sides[:, 0] < sides[:, 1], 1.0, -1.0))
    wrong = np.flatnonzero((count == 2) & (along != 0))
    if not len(wrong):
        return 0, np.zeros(3)
    side = ordered[np.argmax(place == wrong[0])]
    return len(wrong), mesh.geometry.x[side].mean(axis=0)
