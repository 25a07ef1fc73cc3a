"""The axes that internal forces are given in: 1 and 2 in the plate, 3 its normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.forms.contact.supports import Point, in_space
from uplift.meshes.checked import Checked, ModelError, quantity


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
