"""What a scene file says of the model: material, supports, springs, masses, conditions, loads, probes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from drivers.scene_mesh import one_point, places, point_of
from drivers.scene_table import Table, convert
from forms.material import Material
from forms.parameters import Condition, Force, GroundMotion, Mass, Part, PlateModel, Pressure, Probe
from forms.signals import Ricker, Signal, Sine, Step, read_accelerogram, tabulate
from forms.supports import AXES, TRANSLATIONS, Spring, Support
from meshes.checked import ModelError
from meshes.plate import Point
from meshes.sources import MeshSource


def read_model(scene: Table, mesh: MeshSource, horizon: float, folder: Path, uplift_group: str) -> PlateModel:
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
        supports=tuple(_support(entry, mesh) for entry in scene.entries("supports")),
        springs=tuple(_spring(entry, mesh) for entry in scene.entries("springs")),
        probes=tuple(_probe(entry, mesh) for entry in scene.entries("probes")),
        gravity=gravity,
        motions=tuple(motions),
        parts=tuple(_part(entry) for entry in scene.entries("parts")),
        conditions=tuple(_condition(entry) for entry in scene.entries("conditions")),
        masses=tuple(_mass(entry, mesh) for entry in scene.entries("masses")),
        forces=tuple(forces),
        pressures=tuple(pressures),
        up=up,
        uplift_group=uplift_group,
    )


def _gravity(scene: Table) -> tuple[float, str]:
    """Return the acceleration in m/s2 and the axis that points up ("" where the file does not say it)."""
    given = scene.take("gravity", dict, default=None)
    if given is None:
        return 0.0, ""
    table = Table(given, "gravity")
    value = float(table.take("acceleration", float))
    if not abs(value) < float("inf"):
        raise ModelError(table.key("acceleration"), f"expected a finite number, got {value!r}")
    direction = table.take("direction", str, default="")
    if direction not in ("", "-X", "-Y", "-Z"):
        raise ModelError(table.key("direction"), f"expected one of -X, -Y, -Z, got {direction!r}")
    table.finish()
    return value, direction[1:]


def _components(table: Table, name: str, axes: tuple[str, ...] = AXES) -> tuple[float, ...]:
    inner = Table(table.take(name, dict), table.key(name))
    values = tuple(inner.take(axis, float, default=0.0) for axis in axes)
    inner.finish()
    return values


def _support(table: Table, mesh: MeshSource) -> Support:
    values = {
        "name": table.take("name", str),
        **places(table, mesh),
        "stiffness": _components(table, "stiffness"),
        "contact": _components(table, "contact"),
        "mass": table.take("mass", float, default=0.0),
        "unilateral": table.take("unilateral", str, default="Y"),
        "gap": table.take("gap", float, default=0.0),
        "preload": table.take("preload", float, default=0.0),
        "sideways": table.take("sideways", str, default="bonded"),
    }
    table.finish()
    made: Support = table.make(Support, **values)
    return made


def _spring(table: Table, mesh: MeshSource) -> Spring:
    values = {"name": table.take("name", str), **places(table, mesh), "stiffness": _components(table, "stiffness")}
    table.finish()
    made: Spring = table.make(Spring, **values)
    return made


def _mass(table: Table, mesh: MeshSource) -> Mass:
    values = {"name": table.take("name", str), **places(table, mesh), "mass": table.take("mass", float)}
    table.finish()
    made: Mass = table.make(Mass, **values)
    return made


def _probe(table: Table, mesh: MeshSource) -> Probe:
    name = table.take("name", str)
    point = one_point(table.take("point", object), mesh, table.key("point"))
    rotations = table.take("rotations", bool, default=False)
    table.finish()
    return Probe(name, point, rotations)


def _part(table: Table) -> Part:
    group = table.take("group", str)
    material = table.into(Material)
    table.finish()
    return Part(group, material)


def _condition(table: Table) -> Condition:
    values = {
        "group": table.take("group", str),
        "zero": tuple(convert(n, str, table.key("zero")) for n in table.take("zero", list, default=[])),
        "edge": table.take("edge", str, default=""),
    }
    table.finish()
    made: Condition = table.make(Condition, **values)
    return made


def _force(table: Table, mesh: MeshSource, usual: str, horizon: float, folder: Path) -> Force:
    values = {
        "name": table.take("name", str, default=usual), **places(table, mesh), "components": _components(table, "force"),
        "signal": _signal(table, horizon, folder, needed=False),
    }
    table.finish()
    made: Force = table.make(Force, **values)
    return made


def _pressure(table: Table, usual: str, horizon: float, folder: Path) -> Pressure:
    values = {
        "name": table.take("name", str, default=usual), "group": table.take("group", str, default=""), "value": table.take("value", float),
        "signal": _signal(table, horizon, folder, needed=False),
    }
    table.finish()
    made: Pressure = table.make(Pressure, **values)
    return made


def _motion(table: Table, horizon: float, folder: Path) -> GroundMotion:
    given = table.take("direction", object)
    if isinstance(given, dict):
        direction = _components(Table({"direction": given}, table.where), "direction")
    elif given in AXES:
        direction = tuple(float(axis == given) for axis in AXES)
    else:
        raise ModelError(table.key("direction"), f"expected one of {', '.join(AXES)}, or a table of them, got {given!r}")
    if not any(direction):
        raise ModelError(table.key("direction"), "expected a direction that is not zero")
    center: Point = (0.0, 0.0, 0.0)
    if any(direction[TRANSLATIONS:]):
        center = point_of(table.take("center_of_rotation", list, default=[0.0, 0.0, 0.0]), table.key("center_of_rotation"))
    signal = _signal(table, horizon, folder)
    table.finish()
    assert signal is not None
    return GroundMotion(direction, signal, center)


def _signal(table: Table, horizon: float, folder: Path, *, needed: bool = True) -> Signal | None:
    """Read a signal and its parameters; without the key `signal` there is none, if none is needed."""
    kind = table.take("signal", str) if needed else table.take("signal", str, default="")
    if not kind:
        return None
    readers: dict[str, Callable[[], Any]] = {
        "ricker": lambda: _ricker(table, horizon),
        "sine": lambda: table.into(Sine),
        "step": lambda: table.into(Step),
        "csv": lambda: _accelerogram(table, folder),
    }
    if kind not in readers:
        raise ModelError(table.key("signal"), f"expected one of {', '.join(readers)}, got {kind!r}")
    signal: Signal = readers[kind]()
    return signal


def _ricker(table: Table, horizon: float) -> Signal:
    step = table.take("table_step", float, default=None)
    digits = table.take("table_digits", int, default=17)
    ricker: Ricker = table.into(Ricker)
    if step is None:
        return ricker
    if not (0 < step < float("inf") and horizon / step <= 1e7):
        raise ModelError(table.key("table_step"), f"expected > 0 s and at most 1e7 steps, got {step!r}")
    if not 1 <= digits <= 17:
        raise ModelError(table.key("table_digits"), f"expected >= 1 and <= 17, got {digits}")
    return tabulate(ricker, step, horizon, digits)


def _accelerogram(table: Table, folder: Path) -> Signal:
    name = table.take("file", str)
    scale = table.take("scale", float, default=1.0)
    try:
        return read_accelerogram(folder / name, scale)
    except ModelError as error:
        raise ModelError(table.key("file"), error.message) from None
