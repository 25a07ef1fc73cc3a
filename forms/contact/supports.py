"""Springs to the ground and joints of two springs in series, as extra entries and extra rows of the matrices.

A joint stands between the ground and a plate node: a support spring (stiffness k_s) from the ground to an auxiliary
node, a point mass m on that node, and a contact spring (k_c) from there to the plate. Contact springs are so stiff
(1e15 N/m) that a force taken from the difference of two displacements would keep half of its digits. The extra dof of
a joint is therefore the elongation of the stiffer of its two springs, an exact change of variables: no entry of
the matrices is then a difference of two large ones, and the contact force k_c * elongation has all its digits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uplift.meshes.checked import Checked, ModelError, quantity
from uplift.meshes.groups import GroupNames

AXES = ("X", "Y", "Z", "RX", "RY", "RZ")
"""Components of a node: displacements along the axes, then rotations about them."""

TRANSLATIONS = 3
"""The first so many components are displacements."""

Point = tuple[float, ...]
"""Coordinates in m; two of them lie in the plane Z = 0."""

PLACES = ("points", "node", "length", "area")
"""What the numbers of a group are meant for: one of its points, or each node, metre or square metre of a group of the mesh."""


PlacedPoint = Any
"""A `Point`, or until the mesh is read the name of a point or group of points in its file."""


def in_space(point: Point) -> tuple[float, float, float]:
    """Return a point of two or three coordinates with all three."""
    x, y, *z = point
    return float(x), float(y), float(z[0]) if z else 0.0


def six(values: tuple[float, ...]) -> tuple[float, ...]:
    """Return values along `AXES`, those at the end that are not given as zero."""
    return (*(float(v) for v in values), *[0.0] * (len(AXES) - len(values)))


class Placed(Checked):
    """Base of what stands at points, or on a group of the mesh whose nodes become its points."""

    name: str
    points: tuple[PlacedPoint, ...]
    shares: tuple[float, ...]
    group: GroupNames
    per: str

    def __post_init__(self) -> None:
        """Complete points and components to three and six numbers, then check."""
        self._set(points=tuple(p if isinstance(p, str) else in_space(p) for p in self.points))
        if self.shares and len(self.shares) != len(self.points):
            raise ModelError("shares", f"expected {len(self.points)}, one a point, got {len(self.shares)}")
        super().__post_init__()

    @property
    def factors(self) -> np.ndarray:
        """(n,): the share of each point, 1 where none are given."""
        return np.array(self.shares) if self.shares else np.ones(len(self.points))

    def _set(self, **values: Any) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def at(self, points: np.ndarray, shares: np.ndarray) -> Any:
        """Return the same at `points` (n, 3) m, its numbers times `shares` (n,) at each of them."""
        return replace(self, points=tuple(map(tuple, points.tolist())), shares=tuple(shares.tolist()), group="", per="points")  # type: ignore[type-var]


@dataclass(frozen=True)
class Spring(Placed):
    """Springs between plate nodes and the ground."""

    name: str = quantity("name of the group of springs")
    points: tuple[PlacedPoint, ...] = quantity("plate nodes", "m")
    stiffness: tuple[float, ...] = quantity("stiffness along and about the axes", "N/m or N m/rad")
    shares: tuple[float, ...] = quantity("factor of the stiffness at each point", default=())
    group: GroupNames = quantity("group or groups of the mesh that the springs stand on, instead of points", default="")
    per: str = quantity("what the stiffness is meant for", default="points", one_of=PLACES)

    def check(self) -> None:
        """Stiffnesses are finite and not negative."""
        self._set(stiffness=six(self.stiffness))
        _check_stiffness("stiffness", self.stiffness)


@dataclass(frozen=True)
class Support(Placed):
    """Joints under plate nodes: support spring, point mass and contact spring in series."""

    name: str = quantity("name of the group of supports")
    points: tuple[PlacedPoint, ...] = quantity("plate nodes above the supports", "m")
    stiffness: tuple[float, ...] = quantity("support spring, ground to auxiliary node, along and about the axes", "N/m or N m/rad")
    contact: tuple[float, ...] = quantity("contact spring, auxiliary node to plate, along and about the axes", "N/m or N m/rad")
    mass: float = quantity("point mass of the auxiliary node", "kg", default=0.0, at_least=0.0)
    unilateral: str = quantity(
        "direction in which the contact pushes the plate and cannot pull it; empty: a bonded contact",
        default="Y",
        one_of=("X", "-X", "Y", "-Y", "Z", "-Z", ""),
    )
    gap: float = quantity("distance that the unloaded plate has to go before it touches the support", "m", default=0.0, at_least=0.0)
    preload: float = quantity("force with which the support pushes the plate in its unloaded position", "N", default=0.0, at_least=0.0)
    sideways: str = quantity(
        "what becomes of the other directions while the contact is open", default="bonded", one_of=("bonded", "released")
    )
    shares: tuple[float, ...] = quantity("factor of stiffnesses, mass and preload at each point", default=())
    group: GroupNames = quantity("group or groups of the mesh that the supports stand under, instead of points", default="")
    per: str = quantity("what stiffnesses, mass and preload are meant for", default="points", one_of=PLACES)

    def check(self) -> None:
        """Refuse a unilateral contact without springs to push with, and of a bonded one what only a unilateral one knows."""
        self._set(stiffness=six(self.stiffness), contact=six(self.contact))
        _check_stiffness("stiffness", self.stiffness)
        _check_stiffness("contact", self.contact)
        if self.gap > 0 and self.preload > 0:
            raise ModelError("preload", "expected 0 N where there is a gap")
        if not self.unilateral:
            for key, plain in (("gap", 0.0), ("preload", 0.0), ("sideways", "bonded")):
                if getattr(self, key) != plain:
                    raise ModelError(key, "expected only where the contact is unilateral")
            return
        for key, values in (("contact", self.contact), ("stiffness", self.stiffness)):
            if not values[self.axis] > 0:
                raise ModelError(f"{key}.{AXES[self.axis]}", "expected > 0 N/m where the contact is unilateral")

    @property
    def axis(self) -> int:
        """Component (0 to 2) of the unilateral direction."""
        return AXES.index(self.unilateral[-1])

    @property
    def sign(self) -> float:
        """+1 or -1: sense of the unilateral direction along its axis."""
        return -1.0 if self.unilateral.startswith("-") else 1.0

    @property
    def follows_sideways(self) -> bool:
        """Whether forces along the other directions depend on what the contact does."""
        return bool(self.unilateral) and self.sideways != "bonded"

    def flexibility(self, axis: int) -> float:
        """Return the flexibility in m/N along `axis`: spring and contact in series (infinite where one is missing)."""
        springs = self.stiffness[axis], self.contact[axis]
        return sum(1 / k for k in springs) if all(springs) else float("inf")

    @property
    def settlement(self) -> float:
        """How far in m the ground lies away from the plate: the gap, or what takes away the preload's compression."""
        return self.gap - (self.preload * self.flexibility(self.axis) if self.preload else 0.0)


def _check_stiffness(key: str, values: tuple[float, ...]) -> None:
    for axis, value in zip(AXES, values, strict=True):
        if not (np.isfinite(value) and value >= 0):
            raise ModelError(f"{key}.{axis}", f"expected >= 0 N/m, got {value!r}")


@dataclass(frozen=True)
class JointTerm:
    """One component of a joint in the unknowns (q, r): q the plate's displacement, r the joint's own dof."""

    stiffness: np.ndarray
    """(2, 2) N/m."""
    mass: np.ndarray
    """(2, 2) kg."""
    load: np.ndarray
    """(2,): generalised force of a unit force on the auxiliary node."""
    elongation: np.ndarray
    """(2,): elongation of the contact spring, plate minus auxiliary node, along the axis."""


def joint_term(support_stiffness: float, contact_stiffness: float, mass: float) -> JointTerm:
    """Return one component of a joint; the auxiliary node is at q - r if the contact is the stiffer spring, else at r."""
    node = np.array([1.0, -1.0]) if contact_stiffness >= support_stiffness else np.array([0.0, 1.0])
    elongation = np.array([1.0, 0.0]) - node
    return JointTerm(
        stiffness=support_stiffness * np.outer(node, node) + contact_stiffness * np.outer(elongation, elongation),
        mass=mass * np.outer(node, node),
        load=node,
        elongation=elongation,
    )
