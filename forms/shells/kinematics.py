"""How a plate moves: in its plane, by bending, or as a shell; found from what a scene excites, or as it is stated."""

from __future__ import annotations

from dataclasses import dataclass

from uplift.forms.contact.supports import AXES, TRANSLATIONS, Support
from uplift.forms.parameters import PlateModel
from uplift.meshes.checked import Checked, ModelError, quantity

KINDS = ("plane stress", "bending", "shell")
"""Plane stress and bending are of plates in the plane XY, with 2 and 3 dofs a node; a shell lies anywhere and has 5 or 6."""

AXES_OF = {"plane stress": ("X", "Y"), "bending": ("Z", "RX", "RY"), "shell": AXES}

IN_PLANE = frozenset(("X", "Y", "RZ"))


@dataclass(frozen=True)
class Kinematics(Checked):
    """What a scene says of it."""

    kind: str = quantity("how the plate moves; empty: what the loads excite", default="", one_of=("", *KINDS))
    rotary_inertia: bool = quantity("count the inertia of the rotations", default=False)


def up_of(model: PlateModel, kind: str) -> int:
    """Return the component (0 to 2) that points up."""
    return AXES.index(model.up) if model.up else (1 if kind == "plane stress" else 2)


def excited(model: PlateModel, default_up: str) -> frozenset[str]:
    """Return the axes of a flat plate in the plane XY along and about which something acts."""
    axes = set()
    if model.gravity != 0:
        axes.add(model.up or default_up)
    for motion in model.motions:
        x, y, z, rx, ry, rz = motion.direction
        axes |= {axis for axis, value in zip(("X", "Y", "Z"), (x, y, z), strict=True) if value}
        above = motion.center[2] != 0  # a rotation about an axis that does not lie in the plate shakes it sideways too
        axes |= {"Z", "RX", "RY"} if rx or ry else set()
        axes |= {"X", "Y"} if rz or ((rx or ry) and above) else set()
    for force in model.forces:
        axes |= {axis for axis, value in zip(AXES, force.components, strict=True) if value}
    if model.pressures:
        axes.add("Z")
    for condition in model.initial:
        axes |= condition.axes
    axes |= {AXES[support.axis] for support in model.supports if isinstance(support, Support) and support.unilateral and support.settlement}
    return frozenset(axes)


def _lies(model: PlateModel) -> bool:
    """Tell whether a flat plate whose scene does not say which way is up lies: something bends it, or it is held across its plane alone."""
    if excited(model, "Y") - IN_PLANE or any(s.unilateral and s.axis == TRANSLATIONS - 1 for s in model.supports):
        return True
    stiffnesses = [spring.stiffness for spring in model.springs] + [support.stiffness for support in model.supports]
    held = {axis for stiffness in stiffnesses for axis, value in zip(AXES, stiffness, strict=True) if value > 0}
    for condition in model.conditions:
        if condition.edge != "clamped":
            held |= {name[1:] for name in condition.zero} or {"Z"}
    return bool(held) and not held & IN_PLANE


def choose(stated: Kinematics, model: PlateModel, flat: bool) -> str:
    """Return the kind of kinematics; `flat`: the mesh lies in the plane XY.

    What nothing excites is left out: a flat plate stretches and bends independently. Raises `ModelError` if the kind that is stated
    cannot carry what acts.
    """
    bent = _lies(model)
    axes = excited(model, "Z" if bent else "Y")
    if not stated.kind:
        if not flat or not axes:
            return "shell" if not flat or not (model.supports or model.springs) or bent else "plane stress"
        return "plane stress" if axes <= IN_PLANE else "shell" if axes & IN_PLANE else "bending"
    if stated.kind != "shell":
        if not flat:
            raise ModelError("kinematics.kind", f"expected 'shell' for a mesh that does not lie in the plane XY, got {stated.kind!r}")
        axes = excited(model, "Y" if stated.kind == "plane stress" else "Z")
        lost = sorted(axes - (IN_PLANE - {"RZ"} if stated.kind == "plane stress" else frozenset(AXES_OF["bending"])), key=AXES.index)
        if lost:
            raise ModelError("kinematics.kind", f"{stated.kind} does not move along {' and '.join(lost)}, where something acts")
    return stated.kind


def degree_of(kind: str, stated: int | None, cell: str) -> int:
    """Return the polynomial degree of the displacement: as stated, or 1 for plane stress, 2 or 3 for what bends."""
    if stated is not None:
        return stated
    return 1 if kind == "plane stress" else 3 if cell == "triangle" else 2
