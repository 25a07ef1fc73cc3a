"""Axis 1 of internal forces at any point of a plate."""

from __future__ import annotations

import numpy as np

from uplift.forms.recovery.axes import Axes
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import geometry_cells
from uplift.meshes.tagged import TaggedMesh

VANISHES = 1e-6
"""Sine of the angle between a direction and the normal below which the direction has no projection on the plate."""

STRAIGHT = 1e-6
"""Largest distance of an edge's nodes from a straight line, as a part of its length."""


def edge_direction(tagged: TaggedMesh, group: str) -> np.ndarray:
    """Return the unit direction (3,) of a straight edge group, its largest component positive (collective)."""
    cells = geometry_cells(tagged.mesh)
    nodes = [cells[cell, end] for cell, ends in tagged.cell_sides(group) for end in ends]
    points = np.concatenate(tagged.mesh.comm.allgather(tagged.mesh.geometry.x[np.array(nodes, dtype=int)]))
    points = points[np.lexsort(points.T)]
    away = points - points.mean(axis=0)
    _, sizes, directions = np.linalg.svd(away, full_matrices=False)
    if not sizes[1] <= STRAIGHT * sizes[0]:
        raise ModelError("edge", f"expected a straight edge, {group!r} is none")
    direction: np.ndarray = directions[0] * np.sign(directions[0][np.argmax(np.abs(directions[0]))])
    return direction


class Directions:
    """Axis 1 at any point of a plate."""

    def __init__(self, axes: Axes | None, tagged: TaggedMesh) -> None:
        """Take the axes, None for the usual ones, and look up the edge that they name (collective)."""
        self._axes = axes
        self._along = np.zeros(3)
        if axes is not None and axes.edge:
            self._along = edge_direction(tagged, axes.edge)
        elif axes is not None and axes.x:
            self._along = np.array(axes.x) / np.linalg.norm(axes.x)

    def at(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return the unit axis 1 (..., 3) at `points` (..., 3) m of a plate with unit `normals` (..., 3).

        Raises `ModelError` with the key axes where the plate has none.
        """
        if self._axes is None:
            first, shared = _projected(np.array([1.0, 0.0, 0.0]), normals)
            second, _ = _projected(np.array([0.0, 1.0, 0.0]), normals)
            return np.where((shared > VANISHES)[..., None], first, second)
        if self._axes.cylinder is None:
            first, shared = _projected(self._along, normals)
            if np.any(shared <= VANISHES):
                raise ModelError("axes", "the direction of axis 1 is the normal of the plate")
            return first
        cylinder = self._axes.cylinder
        around = np.cross(np.array(cylinder.axis), points - np.array(cylinder.point))
        size = np.linalg.norm(around, axis=-1, keepdims=True)
        reach = np.linalg.norm(cylinder.axis) * np.max(np.linalg.norm(points - np.array(cylinder.point), axis=-1), initial=0.0)
        if np.any(size <= VANISHES * reach):
            raise ModelError("axes", "a point lies on the axis of the cylinder, where no direction runs around it")
        second, shared = _projected(around / size, normals)
        if np.any(shared <= VANISHES):
            raise ModelError("axes", "the direction around the cylinder is the normal of the plate")
        return np.cross(second, normals)


def _projected(direction: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors along the projection of unit directions on planes, and the length of the projection."""
    flat = direction - np.sum(direction * normals, axis=-1, keepdims=True) * normals
    size = np.linalg.norm(flat, axis=-1)
    return flat / np.where(size > VANISHES, size, 1.0)[..., None], size
