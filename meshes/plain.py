"""A mesh as plain arrays, on one rank: what a file holds and what gmsh has made look the same to the checks."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

CORNERS = {2: 3, 3: 4, 9: 3, 10: 4}
"""Corners of the cells that are read, by gmsh's number of an element type."""

ORDERS = {2: 1, 3: 1, 9: 2, 10: 2}
"""Their order."""

LINES = {1: 1, 2: 8}
"""gmsh's number of a line by its order."""


@dataclass(frozen=True)
class PlainMesh:
    """Nodes, cells of one shape and named groups; indices count from 0."""

    points: np.ndarray
    """(n, 3) m."""
    kind: int
    """gmsh's number of the type of the cells."""
    cells: np.ndarray
    """(m, nodes a cell), in the order of gmsh: corners first, around the cell."""
    lines: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), dtype=int))
    """(k, 2 or 3) nodes of the lines of all groups."""
    cell_groups: dict[str, np.ndarray] = field(default_factory=dict)
    """Name -> indices of its cells."""
    line_groups: dict[str, np.ndarray] = field(default_factory=dict)
    """Name -> indices of its lines."""
    point_groups: dict[str, np.ndarray] = field(default_factory=dict)
    """Name -> indices of its nodes."""

    @property
    def corners(self) -> np.ndarray:
        """(m, 3 or 4) corner nodes of the cells, around each."""
        corners: np.ndarray = self.cells[:, : CORNERS[self.kind]]
        return corners

    @property
    def extent(self) -> float:
        """The longest side in m of the box that holds all nodes."""
        return float(np.ptp(self.points, axis=0).max())

    def groups_of_cells(self, cells: np.ndarray) -> str:
        """Return the names of the groups that hold some of `cells`, as text (empty where none does)."""
        names = [name for name, members in self.cell_groups.items() if np.isin(members, cells).any()]
        return ", ".join(repr(name) for name in names[:4])

    def groups_at(self, node: int) -> str:
        """Return the names of the groups of cells at a node, as text (empty where there are none)."""
        return self.groups_of_cells(np.flatnonzero(np.any(self.cells == node, axis=1)))


def place_in_words(point: np.ndarray) -> str:
    """Return a point (3,) m as text."""
    return f"({', '.join(f'{x:.6g}' for x in point)}) m"


def pairs_in_reach(points: np.ndarray, centres: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs (point, centre) of indices of points (n, 3) m that lie within the `reach` (m,) m of centres (m, 3) m.

    Centres are looked at by their reach, one power of two after another, so that a large one meets few pairs that are too far.
    """
    from scipy.spatial import cKDTree

    tree, size = cKDTree(points), np.ceil(np.log2(reach)).astype(int)
    found = [(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))]
    for power in np.unique(size):
        here = np.flatnonzero(size == power)
        near = tree.sparse_distance_matrix(cKDTree(centres[here]), 2.0**power, output_type="ndarray")
        kept = near["v"] <= reach[here[near["j"]]]
        found.append((near["i"][kept], here[near["j"][kept]]))
    return np.concatenate([point for point, _ in found]), np.concatenate([centre for _, centre in found])


def sides_of(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the sides of all cells, (m * corners, 2) nodes in increasing order, and the cell of each."""
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    return np.sort(ends, axis=1), np.repeat(np.arange(len(corners)), corners.shape[1])


def numbered_sides(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the different sides (s, 2), the number of the side of each corner of each cell (m * corners,) and the cell of it."""
    ends, cell = sides_of(corners)
    span = np.int64(ends.max(initial=0)) + 1
    keys, number = np.unique(ends[:, 0].astype(np.int64) * span + ends[:, 1], return_inverse=True)
    return np.column_stack([keys // span, keys % span]), number, cell


def mesh_of_model(model: Any) -> tuple[PlainMesh, np.ndarray]:
    """Return the cells of a gmsh model, and the surface that each belongs to (m,); every surface is a group named by its number."""
    tags, coordinates, _ = model.mesh.getNodes()
    order = np.argsort(tags)
    known, points = tags[order], coordinates.reshape(-1, 3)[order]
    cells, surfaces, kind = [], [], 0
    for _, surface in model.getEntities(2):
        for found, nodes in zip(*model.mesh.getElements(2, surface)[::2], strict=True):
            kind = int(found)
            width = int(model.mesh.getElementProperties(kind)[3])
            cells.append(np.searchsorted(known, nodes).reshape(-1, width))
            surfaces.append(np.full(len(cells[-1]), surface))
    return PlainMesh(points, kind, np.concatenate(cells)), np.concatenate(surfaces)
