"""What a scene file says of the model: material, supports, springs, masses, conditions, loads, probes."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

from uplift.drivers.scene.initial_conditions import initial_condition
from uplift.drivers.scene.mesh import one_point, places, point_of
from uplift.drivers.scene.signals import read_signal
from uplift.drivers.scene.toml_table import Table
from uplift.forms.contact.supports import AXES, TRANSLATIONS, Spring, Support
from uplift.forms.parameters import Condition, Cut, Force, GroundMotion, Mass, Part, Plane, PlateModel, Pressure, Probe
from uplift.forms.recovery.axes import Axes, Cylinder
from uplift.forms.shells.material import Material
from uplift.meshes.checked import Checked, ModelError, quantity
from uplift.meshes.groups import GroupNames
from uplift.meshes.plate import Point
from uplift.meshes.sources import MeshSource


@dataclass(frozen=True)
class Gravity(Checked):
    """Weight; without this section there is none."""

    acceleration: float = quantity("acceleration of free fall", "m/s2")
    direction: str = quantity("where things fall; empty: -Y in plane stress, else -Z", default="", one_of=("", "-X", "-Y", "-Z"))


def read_model(scene: Table, mesh: MeshSource, horizon: float, folder: Path, uplift_group: GroupNames) -> PlateModel:
    """Read all sections of the model; signals are tabulated up to `horizon` s, files looked for in `folder`."""
    plate = Table(scene.take("plate", dict), "plate")
    axes = _axes(plate)
    material = plate.whole(Material)
    gravity, up = _gravity(scene)
    motions, forces, pressures = [], [], []
    for number, entry in enumerate(scene.entries("load"), start=1):
        kind = entry.take("kind", str, default="ground")
        if kind == "ground":
            motions.append(_motion(entry, horizon, folder))
        elif kind == "force":
            forces.append(_force(entry, mesh, f"load {number}", horizon, folder))
        elif kind == "pressure":
            pressures.append(_pressure(entry, f"load {number}", horizon, folder))
        else:
            raise ModelError(entry.key("kind"), f"expected one of ground, force, pressure, got {kind!r}")
    return PlateModel(
        material,
        supports=tuple(_support(entry, mesh, folder) for entry in scene.entries("supports")),
        springs=tuple(_spring(entry, mesh, folder) for entry in scene.entries("springs")),
        probes=tuple(_probe(entry, mesh) for entry in scene.entries("probes")),
        gravity=gravity,
        motions=tuple(motions),
        parts=tuple(_part(entry, material) for entry in scene.entries("parts")),
        conditions=tuple(_condition(entry) for entry in scene.entries("conditions")),
        masses=tuple(_mass(entry, mesh, folder) for entry in scene.entries("masses")),
        forces=tuple(forces),
        pressures=tuple(pressures),
        up=up,
        uplift_group=uplift_group,
        axes=axes,
        cuts=tuple(_cut(entry) for entry in scene.entries("cuts")),
        initial=tuple(initial_condition(entry) for entry in scene.entries("initial")),
    )


def _gravity(scene: Table) -> tuple[float, str]:
    """Return the acceleration in m/s2 and the axis that points up ("" where the file does not say it)."""
    gravity: Gravity | None = scene.section("gravity", Gravity, optional=True)
    return (gravity.acceleration, gravity.direction[1:]) if gravity else (0.0, "")


def _components(table: Table, name: str, axes: tuple[str, ...] = AXES) -> tuple[float, ...]:
    inner = Table(table.take(name, dict), table.key(name))
    values = tuple(inner.take(axis, float, default=0.0) for axis in axes)
    inner.finish()
    return values


def _support(table: Table, mesh: MeshSource, folder: Path) -> Support:
    values = {**places(table, mesh, folder), "stiffness": _components(table, "stiffness"), "contact": _components(table, "contact")}
    support: Support = table.whole(Support, **values)
    return support


def _spring(table: Table, mesh: MeshSource, folder: Path) -> Spring:
    spring: Spring = table.whole(Spring, **places(table, mesh, folder), stiffness=_components(table, "stiffness"))
    return spring


def _mass(table: Table, mesh: MeshSource, folder: Path) -> Mass:
    mass: Mass = table.whole(Mass, **places(table, mesh, folder))
    return mass


def _probe(table: Table, mesh: MeshSource) -> Probe:
    probe: Probe = table.whole(Probe, point=one_point(table.take("point", object), mesh, table.key("point")))
    return probe


def _part(table: Table, usual: Material) -> Part:
    """Read a part; one that states axes may leave its material out, which then is that of the plate."""
    group, axes = table.take("group", GroupNames), _axes(table)
    own = axes is None or any(field.name in table.rest for field in fields(Material))
    table.note(*(field.name for field in fields(Material)))
    if not own:
        table.finish()
    part: Part = table.make(Part, group=group, material=table.whole(Material) if own else usual, axes=axes)
    return part


def _cut(table: Table) -> Cut:
    given, plane = table.take("plane", dict, default=None), None
    if given is not None:
        inner = Table(given, table.key("plane"))
        plane = inner.whole(Plane, point=point_of(inner.take("point", list), inner.key("point")))
    cut: Cut = table.whole(Cut, point=point_of(table.take("point", list), table.key("point")), plane=plane)
    return cut


def _axes(table: Table) -> Axes | None:
    """Read `axes = { x = [..] }`, `{ edge = ".." }` or `{ cylinder = { point, axis } }`."""
    given = table.take("axes", dict, default=None)
    if given is None:
        return None
    axes = Table(given, table.key("axes"))
    round_axis = axes.take("cylinder", dict, default=None)
    cylinder = None
    if round_axis is not None:
        inner = Table(round_axis, axes.key("cylinder"))
        cylinder = inner.whole(Cylinder, point=point_of(inner.take("point", list), inner.key("point")))
    found: Axes = axes.whole(Axes, cylinder=cylinder)
    return found


def _condition(table: Table) -> Condition:
    condition: Condition = table.whole(Condition)
    return condition


def _force(table: Table, mesh: MeshSource, usual: str, horizon: float, folder: Path) -> Force:
    force: Force = table.whole(
        Force, name=table.take("name", str, default=usual), **places(table, mesh, folder), components=_components(table, "force"),
        signal=read_signal(table, horizon, folder, ground=False),
    )
    return force


def _pressure(table: Table, usual: str, horizon: float, folder: Path) -> Pressure:
    pressure: Pressure = table.whole(
        Pressure, name=table.take("name", str, default=usual), value=table.take("value", float),
        signal=read_signal(table, horizon, folder, ground=False),
    )
    return pressure


def _motion(table: Table, horizon: float, folder: Path) -> GroundMotion:
    given = table.take("direction", object)
    if isinstance(given, dict):
        direction = _components(Table({"direction": given}, table.where), "direction")
    elif given in AXES:
        direction = tuple(float(axis == given) for axis in AXES)
    else:
        raise ModelError(table.key("direction"), f"expected one of {', '.join(AXES)}, or a table of them, got {given!r}")
    center: Point = (0.0, 0.0, 0.0)
    if any(direction[TRANSLATIONS:]):
        center = point_of(table.take("center_of_rotation", list, default=[0.0, 0.0, 0.0]), table.key("center_of_rotation"))
    signal = read_signal(table, horizon, folder, ground=True)
    table.finish()
    motion: GroundMotion = table.make(GroundMotion, direction=direction, signal=signal, center=center)
    return motion
