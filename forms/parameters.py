"""The parameters of a model, apart from its mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.forms.contact.supports import AXES, PLACES, Placed, PlacedPoint, Point, Spring, Support, in_space, six
from uplift.forms.initial_conditions import InitialCondition
from uplift.forms.loads.signals import Signal
from uplift.forms.recovery.axes import Axes, direction_of
from uplift.forms.shells.material import Material
from uplift.meshes.checked import Checked, ModelError, quantity
from uplift.meshes.groups import GroupNames

CONDITIONS = ("clamped", "hard", "soft", "sliding", "symmetric")
"""Conditions that a straight edge of a plate can have, see `uplift.forms.assembly.conditions`."""


@dataclass(frozen=True)
class Probe(Checked):
    """A point whose displacement is recorded."""

    name: str = quantity("name of the probe")
    point: PlacedPoint = quantity("position, at a node or anywhere in the plate", "m")
    rotations: bool = quantity("record the rotations too", default=False)
    forces: bool = quantity("record membrane forces, moments, shear forces and stresses too", default=False)
    part: GroupNames = quantity("with `forces`: group of cells whose forces are meant where several plates meet at the point", default="")

    def check(self) -> None:
        """Complete the point to three coordinates; a part belongs to forces."""
        if not isinstance(self.point, str):
            object.__setattr__(self, "point", in_space(self.point))
        if self.part and not self.forces:
            raise ModelError("part", "expected forces = true, which it belongs to")


@dataclass(frozen=True)
class GroundMotion(Checked):
    """Acceleration of the common base of all springs: m/s2 along the axes, rad/s2 about those through `center`."""

    direction: tuple[float, ...] = quantity("components along and about the axes, as factors of the signal")
    signal: Signal = quantity("function of time", "m/s2 or rad/s2")
    center: Point = quantity("point that the axes of rotation pass through", "m", default=(0.0, 0.0, 0.0))

    def check(self) -> None:
        """Complete direction and centre; refuse numbers that are not finite and a direction that is zero."""
        object.__setattr__(self, "direction", six(self.direction))
        object.__setattr__(self, "center", in_space(self.center))
        for name, values in (("direction", self.direction), ("center", self.center)):
            if not np.all(np.isfinite(values)):
                raise ModelError(name, f"expected finite numbers, got {values}")
        if not any(self.direction):
            raise ModelError("direction", "expected a direction that is not zero")


@dataclass(frozen=True)
class Part(Checked):
    """A group of cells with a material or thickness of its own."""

    group: GroupNames = quantity("group or groups of cells")
    material: Material = quantity("material and thickness of these cells")
    axes: Axes | None = quantity("axes of the internal forces in these cells", default=None)

    def check(self) -> None:
        """Refuse a part without a group: the material of the model is that of all other cells."""
        if not self.group:
            raise ModelError("group", "expected the name of a group of cells")


@dataclass(frozen=True)
class Condition(Checked):
    """Components that are zero on a group of the mesh, relative to the base."""

    group: GroupNames = quantity("group or groups of the mesh: edges, surfaces or points")
    zero: tuple[str, ...] = quantity("components that are zero, such as DZ and DRX", default=())
    edge: str = quantity("condition of a straight edge, instead of components", default="", one_of=("", *CONDITIONS))

    def check(self) -> None:
        """Either components or a condition by name."""
        if bool(self.zero) == bool(self.edge):
            raise ModelError("zero", f"expected either components or edge = one of {', '.join(CONDITIONS)}")
        for name in self.zero:
            if name not in [f"D{axis}" for axis in AXES]:
                raise ModelError("zero", f"expected components out of {', '.join(f'D{axis}' for axis in AXES)}, got {name!r}")


@dataclass(frozen=True)
class Mass(Placed):
    """Point masses on plate nodes."""

    name: str = quantity("name of the group of masses")
    points: tuple[PlacedPoint, ...] = quantity("plate nodes", "m")
    mass: float = quantity("mass at each point", "kg", above=0.0)
    shares: tuple[float, ...] = quantity("factor of the mass at each point", default=())
    group: GroupNames = quantity("group or groups of the mesh that carry the masses, instead of points", default="")
    per: str = quantity("what the mass is meant for", default="points", one_of=PLACES)


@dataclass(frozen=True)
class Force(Placed):
    """Forces and moments on plate nodes, or spread over a group of the mesh, times a function of time."""

    name: str = quantity("name of the load")
    points: tuple[PlacedPoint, ...] = quantity("plate nodes", "m")
    components: tuple[float, ...] = quantity("along and about the axes", "N or N m, per point, metre or square metre")
    signal: Signal | None = quantity("function of time; none: a static load that acts at all times", default=None)
    shares: tuple[float, ...] = quantity("factor of the components at each point", default=())
    group: GroupNames = quantity("group or groups of the mesh that are loaded, instead of points", default="")
    per: str = quantity("what the components are meant for", default="points", one_of=PLACES)

    def check(self) -> None:
        """Complete the components; refuse numbers that are not finite."""
        self._set(components=six(self.components))
        if not np.all(np.isfinite(self.components)):
            raise ModelError("components", f"expected finite numbers, got {self.components}")


@dataclass(frozen=True)
class Pressure(Checked):
    """Pressure on a group of cells along their normals, which follow the order of the nodes of each cell."""

    name: str = quantity("name of the load")
    group: GroupNames = quantity("group or groups of cells; empty: all of them", default="")
    value: float = quantity("pressure along the normal", "Pa", default=0.0)
    signal: Signal | None = quantity("function of time; none: a static load that acts at all times", default=None)


@dataclass(frozen=True)
class Plane(Checked):
    """A plane that cuts a model."""

    point: Point = quantity("a point of the plane", "m")
    normal: tuple[float, ...] = quantity("its normal, which points away from the side")

    def check(self) -> None:
        """Complete the point; refuse a normal that is no direction."""
        object.__setattr__(self, "point", in_space(self.point))
        object.__setattr__(self, "normal", direction_of(self.normal, "normal"))


@dataclass(frozen=True)
class Cut(Checked):
    """A line of cell edges across which the resultants of the forces are recorded: what the rest exerts on one side.

    Nodal loads and supports on the line belong to the side. A plane cuts along the edges of cells nearest to it.
    """

    name: str = quantity("name of the cut")
    point: Point = quantity("point that the moments are about", "m")
    group: GroupNames = quantity("edge group or groups that are the line; this or a plane", default="")
    plane: Plane | None = quantity("plane; cells whose middle lies where its normal does not point to are the side", default=None)
    side: GroupNames = quantity("group or groups of cells on one side of the edge; with a plane, the only cells that are cut", default="")

    def check(self) -> None:
        """Either an edge and its side, or a plane."""
        object.__setattr__(self, "point", in_space(self.point))
        if bool(self.group) == (self.plane is not None):
            raise ModelError("group", "expected either an edge group or a plane")
        if self.group and not self.side:
            raise ModelError("side", "missing; expected the group of cells on one side of the edge")


@dataclass(frozen=True)
class PlateModel(Checked):
    """All that a plate or shell is made of, apart from its mesh."""

    material: Material = quantity("material and thickness of all cells that belong to no part")
    supports: tuple[Support, ...] = quantity("joints that may open", default=())
    springs: tuple[Spring, ...] = quantity("plain springs to the ground", default=())
    probes: tuple[Probe, ...] = quantity("points whose displacements are recorded", default=())
    gravity: float = quantity("acceleration of free fall against the direction `up`", "m/s2", default=0.0)
    motions: tuple[GroundMotion, ...] = quantity("accelerations of the ground", default=())
    parts: tuple[Part, ...] = quantity("groups of cells of another material", default=())
    conditions: tuple[Condition, ...] = quantity("components that are zero", default=())
    masses: tuple[Mass, ...] = quantity("point masses", default=())
    forces: tuple[Force, ...] = quantity("forces and moments", default=())
    pressures: tuple[Pressure, ...] = quantity("pressures", default=())
    up: str = quantity("axis that points up; empty: Y in plane stress, else Z", default="", one_of=("", "X", "Y", "Z"))
    uplift_group: GroupNames = quantity("group or groups of cells whose lifted share is of interest; empty: all", default="")
    axes: Axes | None = quantity("axes of the internal forces where a part has none of its own", default=None)
    cuts: tuple[Cut, ...] = quantity("cuts whose resultants are recorded", default=())
    envelopes: bool = quantity("record the extremes of the section forces all over the plate", default=False)
    initial: tuple[InitialCondition, ...] = quantity("displacements and velocities at time 0", default=())
