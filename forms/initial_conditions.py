"""Initial conditions of a plate: displacements and velocities at time 0, by components, as a rigid rotation or as a mode."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uplift.forms.contact.supports import Point, in_space
from uplift.forms.recovery.axes import direction_of
from uplift.meshes.checked import Checked, ModelError, quantity
from uplift.meshes.groups import GroupNames

NOTHING = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Turn(Checked):
    """A rigid rotation, or its rate, about an axis through a point, right-handed, in the theory of small displacements."""

    axis: tuple[float, ...] = quantity("direction of the axis")
    amount: float = quantity("angle in rad, or rate in rad/s")
    point: Point = quantity("a point on the axis", "m", default=NOTHING)

    def check(self) -> None:
        """Complete the point; refuse an axis that is no direction."""
        object.__setattr__(self, "point", in_space(self.point))
        object.__setattr__(self, "axis", direction_of(self.axis, "axis"))

    @property
    def vector(self) -> np.ndarray:
        """The rotation vector (3,) in rad, or rad/s."""
        axis = np.array(self.axis)
        return self.amount * axis / np.linalg.norm(axis)

    def at(self, points: np.ndarray) -> np.ndarray:
        """Return the displacements in m, or velocities in m/s, (n, 3) of points (n, 3) m."""
        moved: np.ndarray = np.cross(self.vector, points - np.array(self.point))
        return moved


@dataclass(frozen=True)
class InitialCondition(Checked):
    """Displacement and velocity at time 0, added to the state that `[transient] start` gives. Several of them add up.

    Nodes of the group move, all others do not. Joints and contacts follow the plate; nodes that a condition holds stay where they are.
    """

    group: GroupNames = quantity("group or groups of the mesh, or names of points, whose nodes move; empty: the whole plate", default="")
    displacement: tuple[float, ...] = quantity("displacement", "m", default=NOTHING)
    velocity: tuple[float, ...] = quantity("velocity", "m/s", default=NOTHING)
    rotation: Turn | None = quantity("rigid rotation; nodes that have rotations turn too", default=None)
    spin: Turn | None = quantity("rate of a rigid rotation", default=None)
    mode: int | None = quantity("number of an undamped mode of the plate with closed contacts, as a displacement", default=None,
                                at_least=1, at_most=1_000_000)
    amplitude: float | None = quantity("largest displacement of the mode; its sign is that of the mode's largest component", "m",
                                       default=None)

    def check(self) -> None:
        """Refuse numbers that are not finite, a mode without amplitude, an amplitude without mode and a mode of a group."""
        for name in ("displacement", "velocity"):
            if not np.all(np.isfinite(getattr(self, name))):
                raise ModelError(name, f"expected finite numbers, got {getattr(self, name)}")
        if (self.mode is None) != (self.amplitude is None):
            missing = "amplitude" if self.amplitude is None else "mode"
            raise ModelError(missing, "missing; a mode and its amplitude in m belong together")
        if self.mode is not None and self.group:
            raise ModelError("group", "a mode is that of the whole plate: leave the group out")

    def moved_up(self, by: float) -> InitialCondition:
        """Return it with the points of its rotations moved by so many m along Z."""
        rotation, spin = (turn and replace(turn, point=(*turn.point[:2], turn.point[2] + by)) for turn in (self.rotation, self.spin))
        return replace(self, rotation=rotation, spin=spin)

    @property
    def moves(self) -> bool:
        """Whether anything of it is not zero."""
        turns = [turn.amount for turn in (self.rotation, self.spin) if turn is not None]
        return any((*self.displacement, *self.velocity, *turns, self.amplitude))

    @property
    def axes(self) -> frozenset[str]:
        """The axes along which it moves a flat plate in the plane Z = 0, and about which it turns its normal."""
        names = {"XYZ"[k] for values in (self.displacement, self.velocity) for k in range(3) if values[k]}
        for turn in (self.rotation, self.spin):
            if turn is None or not turn.amount:
                continue
            x, y, z = turn.axis
            names |= {"Z", "RX", "RY"} if x or y else set()
            names |= {"X", "Y"} if z or turn.point[2] != 0 else set()
        return frozenset(names)
