"""Scene files: TOML read into checked parameters, with one clear error for whatever is wrong."""

from __future__ import annotations

import dataclasses
import difflib
import tomllib
import types
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np

from forms.material import Material
from forms.parameters import GroundMotion, PlateModel, Probe
from forms.signals import Ricker, Signal, read_accelerogram, tabulate
from forms.supports import AXES, Spring, Support
from meshes.checked import Checked, ModelError, quantity
from meshes.plate import EDGES, Plate
from solvers.parameters import Scheme, Window, generalised_alpha, hilber_hughes_taylor

Point = tuple[float, float]


@dataclass(frozen=True)
class Settling(Checked):
    """Over-damped steps before time 0 that bring the model to rest under its static loads."""

    step: float = quantity("length of a step", "s", default=1.0, above=0.0)
    steps: int = quantity("number of steps", default=10, at_least=1)
    beta: float = quantity("Newmark's beta", default=1.0)
    gamma: float = quantity("Newmark's gamma", default=1.5)

    def check(self) -> None:
        """Refuse an inadmissible scheme."""
        Scheme(self.beta, self.gamma)


@dataclass(frozen=True)
class Transient(Checked):
    """Time stepping by Newmark's method."""

    step: float = quantity("time step", "s", above=0.0)
    duration: float = quantity("end of the analysis", "s", above=0.0)
    every: int = quantity("archive every so many steps", default=1, at_least=1)
    method: str = quantity(
        "time integration", default="newmark", one_of=("newmark", "hht", "generalised-alpha")
    )
    beta: float = quantity("Newmark's beta", default=0.25)
    gamma: float = quantity("Newmark's gamma", default=0.5)
    alpha: float = quantity("dissipation of the method hht", default=0.05, at_least=0.0, at_most=1 / 3)
    rho_infinity: float = quantity(
        "spectral radius at high frequency of generalised-alpha; 1: no dissipation", default=0.8, at_least=0.0, at_most=1.0
    )
    start: str = quantity("state at time 0", default="static", one_of=("static", "settled", "rest"))
    settling: Settling = quantity("steps before time 0 for start = 'settled'", factory=Settling)

    def check(self) -> None:
        """Refuse an inadmissible scheme and an archive that does not end with the last step."""
        if self.method != "newmark" and (self.beta, self.gamma) != (0.25, 0.5):
            raise ModelError("beta", f"beta and gamma belong to the method newmark; {self.method} sets its own")
        Scheme(self.beta, self.gamma)
        if self.duration / self.step > 1e8:
            raise ModelError("step", f"expected at most 1e8 steps, got {self.duration / self.step:.3g}")
        if abs(self.steps * self.step - self.duration) > 1e-9 * self.duration:
            raise ModelError("duration", f"expected a multiple of the step {self.step:g} s, got {self.duration:g} s")
        if self.steps % self.every:
            raise ModelError("every", f"expected a divisor of the {self.steps} steps, got {self.every}")

    @property
    def steps(self) -> int:
        """Number of steps."""
        return round(self.duration / self.step)

    @property
    def scheme(self) -> Scheme:
        """Parameters of the scheme."""
        if self.method == "hht":
            return hilber_hughes_taylor(self.alpha)
        if self.method == "generalised-alpha":
            return generalised_alpha(self.rho_infinity)
        return Scheme(self.beta, self.gamma)

    @property
    def archived(self) -> np.ndarray:
        """Archived instants (n_archived,) s."""
        return self.step * np.arange(0, self.steps + 1, self.every)


@dataclass(frozen=True)
class Modal(Checked):
    """The basis of the modal method."""

    number: int | None = quantity("number of the lowest modes", default=None, at_least=1)
    low: float | None = quantity("lower end of the band of frequencies, instead of a number", "Hz", default=None, at_least=0.0)
    high: float | None = quantity("upper end of the band", "Hz", default=None, above=0.0)
    shift: float = quantity("where the search begins; below zero for a structure that can move without strain", "rad2/s2",
                            default=0.0, at_most=0.0)
    diagonal: bool = quantity("keep only the diagonals of the projected matrices", default=False)
    static_correction: bool = quantity("add the static answers to the loads and to unit contact forces", default=True)

    def check(self) -> None:
        """Either a number or a band."""
        if (self.number is None) == (self.high is None):
            raise ModelError("number", "expected either a number of modes or a band from low to high")
        if self.high is not None and not (self.low or 0.0) < self.high:
            raise ModelError("high", f"expected > low = {self.low:g} Hz, got {self.high:g} Hz")

    @property
    def band(self) -> tuple[float, float] | None:
        """The band (low, high) in Hz, or None."""
        return None if self.high is None else (self.low or 0.0, self.high)


@dataclass(frozen=True)
class Output(Checked):
    """What is reported beside the histories."""

    instants: tuple[float, ...] = quantity("instants whose values are printed", "s", default=())
    uplift: str = quantity(
        "when the lifted share of the plate's area is recorded", default="instants", one_of=("instants", "all", "none")
    )

    def uplift_rows(self, times: np.ndarray) -> np.ndarray:
        """Return which of the archived instants (nt,) the lifted share is recorded at, (nt,) bool."""
        if self.uplift == "none":
            return np.zeros(len(times), dtype=bool)
        if self.uplift == "all":
            return np.ones(len(times), dtype=bool)
        tolerance = 1e-6 * (times[1] - times[0]) if len(times) > 1 else 1e-12
        return np.any(np.abs(times[:, None] - np.asarray(self.instants)[None, :]) <= tolerance, axis=1)


@dataclass(frozen=True)
class Run(Checked):
    """How the scene is analysed where the command line does not say it."""

    method: str = quantity("method of analysis", default="transient", one_of=("transient", "time-frequency", "modal"))
    iterations: int = quantity("published passes; 0: uplift is solved exactly", default=0, at_least=0)


@dataclass(frozen=True)
class Scene:
    """A scene: the model, its mesh and how it is to be analysed."""

    title: str
    plate: Plate
    model: PlateModel
    transient: Transient | None
    fourier: Window | None
    modal: Modal | None
    output: Output
    run: Run
    source: dict[str, Any]
    """The TOML as read, for the record."""

    @property
    def horizon(self) -> float:
        """Latest time in s that any analysis of the scene reaches."""
        return max(self.transient.duration if self.transient else 0.0, self.fourier.length if self.fourier else 0.0)


def read_scene(path: Path) -> Scene:
    """Read and check a scene file. Raises `ModelError`, its key the path of the offending entry, such as plate.young."""
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        raise ModelError("", "expected a TOML file in UTF-8") from None
    except OSError as error:
        raise ModelError("", f"cannot be read: {error.strerror}") from None
    except tomllib.TOMLDecodeError as error:
        raise ModelError("", f"not valid TOML: {error}") from None
    return build_scene(table, path.parent)


def build_scene(table: dict[str, Any], folder: Path) -> Scene:
    """Build a scene from a TOML table; file names in it are relative to `folder`."""
    scene = _Table(table, "")
    title = scene.take("title", str, default="")
    plate = scene.section("mesh", Plate)
    material = scene.section("plate", Material)
    gravity = scene.take("gravity", dict, default=None)
    acceleration = 0.0 if gravity is None else _only_number(_Table(gravity, "gravity"), "acceleration")
    transient = scene.section("transient", Transient, optional=True)
    fourier = scene.section("fourier", Window, optional=True)
    modal = scene.section("modal", Modal, optional=True)
    run = scene.section("run", Run, optional=True) or Run()
    output = _output(scene)
    horizon = max(transient.duration if transient else 0.0, fourier.length if fourier else 0.0)
    motions = tuple(_motion(entry, horizon, folder) for entry in scene.entries("load"))
    supports = tuple(_support(entry, plate) for entry in scene.entries("supports"))
    springs = tuple(_spring(entry, plate) for entry in scene.entries("springs"))
    probes = tuple(_probe(entry, plate) for entry in scene.entries("probes"))
    scene.finish()
    if not probes:
        raise ModelError("probes", "expected at least one [[probes]] with a name and a point")
    for key, group in (("supports", supports), ("springs", springs), ("probes", probes)):
        names = [item.name for item in group]
        for name in names:
            if names.count(name) > 1:
                raise ModelError(key, f"expected different names, {name!r} is there twice")
    if transient is None and fourier is None:
        raise ModelError("transient", "expected a section [transient] or [fourier] that says how to analyse the scene")
    model = PlateModel(material, supports, springs, probes, acceleration, motions)
    return Scene(title, plate, model, transient, fourier, modal, output, run, table)


class _Table:
    """One table of the file: entries are taken out by name and type, and what is left over is unknown."""

    def __init__(self, table: dict[str, Any], where: str) -> None:
        self.rest = dict(table)
        self.where = where
        self.known: list[str] = []

    def key(self, name: str) -> str:
        return f"{self.where}.{name}" if self.where else name

    def take(self, name: str, kind: Any, default: Any = dataclasses.MISSING) -> Any:
        self.known.append(name)
        if name not in self.rest:
            if default is dataclasses.MISSING:
                close = difflib.get_close_matches(name, [k for k in self.rest if k not in self.known], n=1)
                hint = f" (found {close[0]!r}: did you mean {name!r}?)" if close else ""
                raise ModelError(self.key(name), f"missing; expected {_in_words(kind)}{hint}")
            return default
        return _convert(self.rest.pop(name), kind, self.key(name))

    def section(self, name: str, kind: Any, *, optional: bool = False) -> Any:
        table = self.take(name, dict, default=None if optional else dataclasses.MISSING)
        if table is None:
            return None
        inner = _Table(table, self.key(name))
        made = inner.into(kind)
        inner.finish()
        return made

    def into(self, kind: Any) -> Any:
        """Make the dataclass `kind` from the entries that bear the names of its fields."""
        hints = get_type_hints(kind)
        values = {}
        for field in dataclasses.fields(kind):
            hint = hints[field.name]
            if dataclasses.is_dataclass(hint):
                made = self.section(field.name, hint, optional=True)
                if made is not None:
                    values[field.name] = made
                continue
            required = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
            value = self.take(field.name, hint, default=dataclasses.MISSING if required else None)
            if value is not None:
                values[field.name] = value
        return self.make(kind, **values)

    def make(self, kind: Any, **values: Any) -> Any:
        try:
            return kind(**values)
        except ModelError as error:
            raise (error.under(self.where) if self.where else error) from None

    def entries(self, name: str) -> list[_Table]:
        """Return the tables of [name] or [[name]]; none if absent."""
        self.known.append(name)
        value = self.rest.pop(name, [])
        tables = [value] if isinstance(value, dict) else value
        if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
            raise ModelError(self.key(name), f"expected a table [{name}] or tables [[{name}]], got {value!r:.40}")
        if isinstance(value, dict):
            return [_Table(value, name)]
        return [_Table(t, f"{name}[{t['name'] if isinstance(t.get('name'), str) else i + 1}]") for i, t in enumerate(tables)]

    def finish(self) -> None:
        """Raise `ModelError` if an entry is left that nobody asked for."""
        for name in self.rest:
            close = difflib.get_close_matches(name, self.known, n=1)
            hint = f"did you mean {close[0]!r}?" if close else f"known here: {', '.join(self.known)}"
            raise ModelError(self.key(name), f"unknown key; {hint}")


def _in_words(kind: Any) -> str:
    words = {float: "a number", int: "a whole number", str: "a text in quotes", bool: "true or false", dict: "a table"}
    return words.get(kind, "an array" if kind is list else str(kind))


def _convert(value: Any, kind: Any, key: str) -> Any:
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            raise ModelError(key, "expected a number that a double can hold") from None
    if isinstance(kind, types.UnionType):  # a number or nothing: what stands in the file is the number
        kind = next(option for option in get_args(kind) if option is not type(None))
        return _convert(value, kind, key)
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise ModelError(key, f"expected {_in_words(kind)}, got {value!r:.60}")
    return value


def _only_number(table: _Table, name: str) -> float:
    value = float(table.take(name, float))
    table.finish()
    if not abs(value) < float("inf"):
        raise ModelError(table.key(name), f"expected a finite number, got {value!r}")
    return value


def _components(table: _Table, name: str) -> tuple[float, float]:
    inner = _Table(table.take(name, dict), table.key(name))
    values = tuple(inner.take(axis, float, default=0.0) for axis in AXES)
    inner.finish()
    return values[0], values[1]


def _one_point(value: Any, plate: Plate, key: str) -> Point:
    if isinstance(value, str):
        if value not in plate.corners:
            raise ModelError(key, f"expected a point of the mesh ({', '.join(plate.corners)}) or [x, y], got {value!r}")
        return plate.corners[value]
    if not isinstance(value, list) or len(value) != 2:
        raise ModelError(key, f"expected a point [x, y] in m or the name of one, got {value!r:.60}")
    x, y = (_convert(v, float, key) for v in value)
    if not (0 <= x <= plate.width and 0 <= y <= plate.height):
        raise ModelError(key, f"({x:g}, {y:g}) m lies outside the plate of {plate.width:g} m x {plate.height:g} m")
    return x, y


def _points(table: _Table, plate: Plate) -> tuple[Point, ...]:
    """Read `points`, or `edge` with the number of equidistant points on it."""
    edge = table.take("edge", str, default=None)
    if edge is None:
        given = table.take("points", list)
        if not given:
            raise ModelError(table.key("points"), "expected at least one point")
        return tuple(_one_point(p, plate, f"{table.key('points')}[{i}]") for i, p in enumerate(given, start=1))
    if edge not in EDGES:
        raise ModelError(table.key("edge"), f"expected one of {', '.join(EDGES)}, got {edge!r}")
    count = table.take("count", int)
    if count < 2:
        raise ModelError(table.key("count"), f"expected at least 2 points on an edge, got {count}")
    corners = list(plate.corners.values())
    (x0, y0), (x1, y1) = corners[EDGES.index(edge)], corners[(EDGES.index(edge) + 1) % 4]
    ratios = [i / (count - 1) for i in range(count)]
    return tuple((x0 + (x1 - x0) * s, y0 + (y1 - y0) * s) for s in ratios)


def _support(table: _Table, plate: Plate) -> Support:
    values = {
        "name": table.take("name", str),
        "points": _points(table, plate),
        "stiffness": _components(table, "stiffness"),
        "contact": _components(table, "contact"),
        "mass": table.take("mass", float, default=0.0),
        "unilateral": table.take("unilateral", str, default="Y"),
        "gap": table.take("gap", float, default=0.0),
        "preload": table.take("preload", float, default=0.0),
        "sideways": table.take("sideways", str, default="bonded"),
    }
    table.finish()
    return table.make(Support, **values)


def _spring(table: _Table, plate: Plate) -> Spring:
    values = {
        "name": table.take("name", str),
        "points": _points(table, plate),
        "stiffness": _components(table, "stiffness"),
    }
    table.finish()
    return table.make(Spring, **values)


def _probe(table: _Table, plate: Plate) -> Probe:
    name = table.take("name", str)
    point = _one_point(table.take("point", object), plate, table.key("point"))
    table.finish()
    return Probe(name, point)


def _output(scene: _Table) -> Output:
    given = scene.take("output", dict, default=None)
    if given is None:
        return Output()
    table = _Table(given, "output")
    instants = tuple(_convert(t, float, table.key("instants")) for t in table.take("instants", list, default=[]))
    for instant in instants:
        if not 0 <= instant < float("inf"):
            raise ModelError(table.key("instants"), f"expected >= 0 s, got {instant!r}")
    output = table.make(Output, instants=instants, uplift=table.take("uplift", str, default="instants"))
    table.finish()
    return output


def _motion(table: _Table, horizon: float, folder: Path) -> GroundMotion:
    direction = table.take("direction", str)
    if direction not in AXES:
        raise ModelError(table.key("direction"), f"expected one of {', '.join(AXES)}, got {direction!r}")
    kind = table.take("signal", str)
    signal: Signal
    if kind == "ricker":
        step = table.take("table_step", float, default=None)
        digits = table.take("table_digits", int, default=17)
        ricker: Ricker = table.into(Ricker)
        signal = ricker
        if step is not None:
            if not (0 < step < float("inf") and horizon / step <= 1e7):
                raise ModelError(table.key("table_step"), f"expected > 0 s and at most 1e7 steps, got {step!r}")
            if not 1 <= digits <= 17:
                raise ModelError(table.key("table_digits"), f"expected >= 1 and <= 17, got {digits}")
            signal = tabulate(ricker, step, horizon, digits)
    elif kind == "csv":
        name = table.take("file", str)
        scale = table.take("scale", float, default=1.0)
        try:
            signal = read_accelerogram(folder / name, scale)
        except ModelError as error:
            raise ModelError(table.key("file"), error.message) from None
    else:
        raise ModelError(table.key("signal"), f"expected one of ricker, csv, got {kind!r}")
    table.finish()
    return GroundMotion((1.0, 0.0) if direction == "X" else (0.0, 1.0), signal)
