"""The axes that internal forces are given in: 1 and 2 in the plate, 3 its normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.forms.contact.supports import Point, in_space
from uplift.meshes.checked import Checked, ModelError, quantity
from uplift.meshes.compat import geometry_cells
from uplift.meshes.tagged import TaggedMesh

VANISHES = 1e-6
"""Sine of the angle between a direction and the normal below which the direction has no projection on the plate."""

STRAIGHT = 1e-6
"""Largest distance of an edge's nodes from a straight line, as a part of its length."""


@dataclass(frozen=True)
class Cylinder(Checked):
    """Directions around an axis."""

    point: Point = quantity("a point on the axis", "m")
    axis: tuple[float, ...] = quantity("direction of the axis")

    def check(self) -> None:
        """Complete the point; refuse an axis that is no direction."""
        object.__setattr__(self, "point", in_space(self.point))
        object.__setattr__(self, "axis", direction_of(self.axis, "axis"))


@dataclass(frozen=True)
class Axes(Checked):
    """Where axis 1 of the internal forces points; axis 2 = normal x axis 1.

    x: along a direction, projected on the plate. edge: along a straight edge, its largest component positive. cylinder: axis 2 runs around
    the axis of the cylinder (right hand) and 1 = 2 x normal, which is outwards on a disc whose normal is that axis.
    """

    x: tuple[float, ...] = quantity("direction of axis 1, projected on the plate", default=())
    edge: str = quantity("straight edge that axis 1 is parallel to, instead", default="")
    cylinder: Cylinder | None = quantity("axis that axis 2 runs around, instead", default=None)

    def check(self) -> None:
        """One of the three; a direction that is none is refused."""
        if bool(self.x) + bool(self.edge) + (self.cylinder is not None) != 1:
            raise ModelError("", "expected one of x, edge, cylinder")
        if self.x:
            object.__setattr__(self, "x", direction_of(self.x, "x"))


def direction_of(values: tuple[float, ...], key: str) -> tuple[float, float, float]:
    """Return a direction in space of two or three components. Raises `ModelError` for one that is zero or not finite."""
    whole = (*values, 0.0) if len(values) == 2 else values
    if len(whole) != 3 or not np.all(np.isfinite(whole)) or not any(whole):
        raise ModelError(key, f"expected a direction [x, y, z] that is not zero, got {list(values)}")
    return float(whole[0]), float(whole[1]), float(whole[2])


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
