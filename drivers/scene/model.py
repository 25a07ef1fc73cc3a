"""What a scene file says of the model: material, supports, springs, masses, conditions, loads, probes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.scene.mesh import one_point, places, point_of
from uplift.drivers.scene.toml_table import Table
from uplift.forms.contact.supports import AXES, TRANSLATIONS, Spring, Support
from uplift.forms.loads.records import read_accelerogram
from uplift.forms.loads.signals import LARGEST, Noise, Ricker, Signal, Sine, Step, Sweep, tabulate
from uplift.forms.loads.signals import Table as TimeTable
from uplift.forms.parameters import Condition, Force, GroundMotion, Mass, Part, PlateModel, Pressure, Probe
from uplift.forms.shells.material import Material
from uplift.meshes.checked import Checked, ModelError, quantity
from uplift.meshes.groups import GroupNames
from uplift.meshes.plate import Point
from uplift.meshes.sources import MeshSource

UNITS = {"m/s2": 1.0, "g": 9.80665, "cm/s2": 0.01}
"""Units of a record in m/s2; g is the standard acceleration."""


@dataclass(frozen=True)
class Gravity(Checked):
    """Weight; without this section there is none."""

    acceleration: float = quantity("acceleration of free fall", "m/s2")
    direction: str = quantity("where things fall; empty: -Y in plane stress, else -Z", default="", one_of=("", "-X", "-Y", "-Z"))


@dataclass(frozen=True)
class Tabulated(Checked):
    """A signal replaced by a table of its values, linear between them, as published cases have it."""

    table_step: float | None = quantity("step of the table; none: the smooth signal", "s", default=None, above=0.0, at_most=LARGEST)
    table_digits: int = quantity("significant digits of the table, rounded up", default=17, at_least=1, at_most=17)


@dataclass(frozen=True)
class Record(Checked):
    """A record of times in s and accelerations in a CSV file, linear between its rows and zero outside.

    It is interpolated at the instants of the analysis; a run warns where these pass over rows or fall between them.
    """

    file: str = quantity("CSV file of two columns beside the scene; comma, semicolon or tab, # begins a remark, one line of headings")
    scale: float = quantity("factor of the values", default=1.0)
    unit: str = quantity("unit of the values in the file", default="m/s2", one_of=tuple(UNITS))


@dataclass(frozen=True)
class Inline(Checked):
    """Values at increasing times, linear between them and zero outside."""

    times: tuple[float, ...] = quantity("times, increasing, at least two", "s")
    values: tuple[float, ...] = quantity("as many values", "m/s2 or 1")

    def check(self) -> None:
        """As many times as values, in order."""
        try:
            TimeTable(np.array(self.times), np.array(self.values))
        except ModelError as error:
            raise ModelError("times", error.message) from None


SIGNALS: dict[str, Any] = {"ricker": Ricker, "sine": Sine, "step": Step, "sweep": Sweep, "noise": Noise, "table": Inline, "csv": Record}
"""What the key `signal` of a load may say."""


def read_model(scene: Table, mesh: MeshSource, horizon: float, folder: Path, uplift_group: GroupNames) -> PlateModel:
    """Read all sections of the model; signals are tabulated up to `horizon` s, files looked for in `folder`."""
    material = scene.section("plate", Material)
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
        parts=tuple(_part(entry) for entry in scene.entries("parts")),
        conditions=tuple(_condition(entry) for entry in scene.entries("conditions")),
        masses=tuple(_mass(entry, mesh, folder) for entry in scene.entries("masses")),
        forces=tuple(forces),
        pressures=tuple(pressures),
        up=up,
        uplift_group=uplift_group,
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


def _part(table: Table) -> Part:
    group = table.take("group", GroupNames)
    part: Part = table.make(Part, group=group, material=table.whole(Material))
    return part


def _condition(table: Table) -> Condition:
    condition: Condition = table.whole(Condition)
    return condition


def _force(table: Table, mesh: MeshSource, usual: str, horizon: float, folder: Path) -> Force:
    force: Force = table.whole(
        Force, name=table.take("name", str, default=usual), **places(table, mesh, folder), components=_components(table, "force"),
        signal=_signal(table, horizon, folder, needed=False),
    )
    return force


def _pressure(table: Table, usual: str, horizon: float, folder: Path) -> Pressure:
    pressure: Pressure = table.whole(
        Pressure, name=table.take("name", str, default=usual), value=table.take("value", float),
        signal=_signal(table, horizon, folder, needed=False),
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
    signal = _signal(table, horizon, folder)
    table.finish()
    motion: GroundMotion = table.make(GroundMotion, direction=direction, signal=signal, center=center)
    return motion


def _signal(table: Table, horizon: float, folder: Path, *, needed: bool = True) -> Signal | None:
    """Read a signal and its parameters; without the key `signal` there is none, if none is needed."""
    kind = table.take("signal", str) if needed else table.take("signal", str, default="")
    if not kind:
        return None
    if kind not in SIGNALS:
        raise ModelError(table.key("signal"), f"expected one of {', '.join(SIGNALS)}, got {kind!r}")
    if kind == "ricker":
        return _ricker(table, horizon)
    if kind == "csv":
        return _accelerogram(table, folder)
    if kind == "table":
        return _inline(table)
    signal: Signal = table.into(SIGNALS[kind])
    return signal


def _ricker(table: Table, horizon: float) -> Signal:
    tabulated: Tabulated = table.into(Tabulated)
    ricker: Ricker = table.into(Ricker)
    if tabulated.table_step is None:
        return ricker
    if not horizon / tabulated.table_step <= 1e7:
        raise ModelError(table.key("table_step"), f"expected > 0 s and at most 1e7 steps, got {tabulated.table_step!r}")
    return tabulate(ricker, tabulated.table_step, horizon, tabulated.table_digits)


def _accelerogram(table: Table, folder: Path) -> Signal:
    record: Record = table.into(Record)
    try:
        return read_accelerogram(folder / record.file, record.scale * UNITS[record.unit])
    except ModelError as error:
        raise ModelError(table.key("file"), error.message) from None


def _inline(table: Table) -> Signal:
    inline: Inline = table.into(Inline)
    return TimeTable(np.array(inline.times), np.array(inline.values))
