"""The keys of a scene file, gathered from the dataclasses that read them; `docs/scene.md` is made of them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, get_type_hints

from uplift.drivers.scene import analysis, model
from uplift.drivers.scene.mesh import COLUMNS, MOST_DOFS
from uplift.drivers.scene.signals import SIGNALS, SignalKind
from uplift.drivers.scene.toml_table import in_words
from uplift.forms.contact.supports import AXES, Spring, Support
from uplift.forms.initial_conditions import InitialCondition
from uplift.forms.parameters import Condition, Cut, Force, Mass, Pressure, Probe
from uplift.forms.shells.kinematics import Kinematics
from uplift.forms.shells.material import Material
from uplift.meshes.checked import range_in_words
from uplift.meshes.groups import GroupNames
from uplift.meshes.imported import SUFFIXES, MeshFile
from uplift.meshes.panels import Panel, Panels
from uplift.meshes.plate import EDGES, Plate
from uplift.solvers.frequency_domain.window import Window

NEEDED = object()
"""The default of a key that has to be there."""


@dataclass(frozen=True)
class Key:
    """One key of a section."""

    name: str
    kind: Any
    """Its type, or a word for it."""
    doc: str
    unit: str = ""
    default: Any = NEEDED
    range: str = ""

    @property
    def kind_in_words(self) -> str:
        """What stands in the file."""
        return self.kind if isinstance(self.kind, str) else in_words(self.kind)

    @property
    def default_in_words(self) -> str:
        """What holds where the key is not there."""
        if self.default is NEEDED:
            return "required"
        if self.default is None or self.default == ():
            return "none"
        if isinstance(self.default, bool):
            return str(self.default).lower()
        return f'"{self.default}"' if isinstance(self.default, str) else f"{self.default:g}"


@dataclass(frozen=True)
class Section:
    """A table of the file, or one of the forms that a table can have."""

    path: str
    """As in load or mesh.plates."""
    heading: str
    doc: str
    keys: tuple[Key, ...]
    listed: bool = False
    """Whether there may be several: [[path]]."""


def of(kind: type, *without: str, **changed: Key) -> tuple[Key, ...]:
    """Return the keys of the dataclass `kind` but those `without`; fields that the file writes otherwise are `changed`."""
    hints, keys = get_type_hints(kind), []
    for field in dataclasses.fields(kind):
        if field.name in without:
            continue
        if field.name in changed:
            keys.append(changed[field.name])
            continue
        about, default = field.metadata, NEEDED if field.default is dataclasses.MISSING else field.default
        if dataclasses.is_dataclass(hints[field.name]):
            keys.append(Key(field.name, "a table", about["doc"], default=None))
            continue
        allowed = ", ".join(f'"{word}"' for word in about.get("one_of", ()))
        keys.append(Key(field.name, hints[field.name], about["doc"], about["unit"], default, allowed or range_in_words(about)))
    return tuple(keys)


_COMPONENTS = f"a table of {', '.join(AXES)}"

_PLACED = ("points", "shares", "group", "per")

_GRID = "a table of from = [x, y, z], to = [x, y, z], count = [nx, ny, nz]"

PLACES = (
    Key("points", "an array of points [x, y], [x, y, z] or names of points or groups of points",
        "where they stand; this or one of the next four; [x, y] lies in the plane of a flat mesh", "m"),
    Key("edge", str, f"equidistant points on an edge, such as {', '.join(EDGES)} of a rectangle, both ends included", default=None),
    Key("count", int, "number of points on the edge; required with `edge`", default=None, range=">= 2 and <= 1e+06"),
    Key("grid", _GRID, "a grid of points, row by row, x fastest", "m", None, "at most 1e+06 points"),
    Key("file", str, f"CSV file beside the scene with columns {', '.join(COLUMNS)} (the last two may be absent), a point a line; the "
                     "share multiplies what stands there", "m", None),
    Key("group", GroupNames, "group or groups of the mesh whose nodes they stand on", default=None),
    Key("per", str, "with `group`: what the numbers are meant for; shared out over the nodes by length or area", default="node",
        range='"node", "length", "area"'),
)


_AXES = Key(
    "axes", "a table of x = [x, y, z], of edge = the name of a straight one, or of cylinder = { point, axis }",
    "where axis 1 of the internal forces points: along x projected on the plate; along the edge; or so that axis 2 runs around the "
    "cylinder; axis 2 = normal x axis 1. None: X projected on the plate, Y where that vanishes", default=None,
)

_PARTS = """A group of cells with a material, thickness or axes of its own. One that states axes may leave out all of the material, which
then is that of the plate."""


def _stiffness(name: str, doc: str) -> Key:
    return Key(name, _COMPONENTS, f"{doc}; 0 where not given", "N/m or N m/rad", range=">= 0")


_SIGNAL = "the function of time, see [load] signals; none: a static load that acts at all times"

_GROUND = """Acceleration of the common base of all springs; displacements are relative to it. Several [[load]] act at once: three
directions are three of them."""

_NAME = Key("name", str, "name of the load", default="load and its number")


_SPACE = "a table of X, Y, Z"


def _turn(amount: str) -> str:
    return f"a table of axis = [x, y, z], point = [x, y, z] and {amount}"


def _signal_section(name: str, kind: SignalKind) -> Section:
    keys = tuple(key for parameters in kind.parameters for key in of(parameters))
    return Section("load", f'[load] signal = "{name}"', _doc(kind.parameters[0]), keys)


def _dofs(refined: str) -> Key:
    words = f"dofs at least: {refined} are for the coarsest mesh, which is refined by the least whole factor that gives so many"
    return Key("dofs", int, words.replace("size are", "size is"), default=0, range=f"<= {MOST_DOFS:g}")


def sections() -> list[Section]:
    """Return all sections in the order of the page."""
    top = Section("", "Top of the file", "Before all sections.", (Key("title", str, "title of the scene", default=""),))
    return [top, *_mesh_sections(), *_model_sections(), *_load_sections(), *_run_sections()]


def _mesh_sections() -> list[Section]:
    plates = Key("plates", "tables [[mesh.plates]]", "the plates")
    points = Key("points", "a table of points", "points that become nodes, by a name of your choice: NAME = [x, y, z]", "m", None)
    return [
        Section("mesh", "[mesh] of a rectangle", _doc(Plate), (*of(Plate), _dofs("nx and ny"))),
        Section("mesh", "[mesh] of joined plates", _doc(Panels), (
            plates, points, *of(Panels, "plates", "named_points", "nodes"), _dofs("size"),
        )),
        Section("mesh.plates", "[[mesh.plates]]", _doc(Panel), of(
            Panel,
            corners=Key("corners", "an array of points [x, y, z]", "in order around the plate", "m", range="at least 3, in one plane"),
            holes=Key("holes", "an array of arrays of points", "corners of each hole", "m", None, range="inside the plate, apart"),
            edge_names=Key("edges", tuple[str, ...], "a name for each edge, first that from corner 1 to 2; else NAME.1, ...", default=()),
        ), listed=True),
        Section("mesh", "[mesh] from a file", "Triangles or quadrilaterals with named groups.", (
            Key("file", str, "file beside the scene", range=f"ends in {' or '.join(SUFFIXES)}"),
            *of(MeshFile, "path", "degree"), *(key for key in of(Plate) if key.name == "degree"),
        )),
    ]


def _model_sections() -> list[Section]:
    return [
        Section("kinematics", "[kinematics]", "How the plate moves; without this section what the loads excite decides.", of(Kinematics)),
        Section("plate", "[plate]", _doc(Material), (*of(Material), _AXES)),
        Section("parts", "[[parts]]", _PARTS,
                (Key("group", GroupNames, "group or groups of cells of the mesh"), *of(Material), _AXES), listed=True),
        Section("gravity", "[gravity]", _doc(model.Gravity), of(model.Gravity)),
        Section("supports", "[[supports]]", _doc(Support), (
            *PLACES, *of(Support, *_PLACED, stiffness=_stiffness("stiffness", "support spring, from the ground to the auxiliary node"),
                         contact=_stiffness("contact", "contact spring, from the auxiliary node to the plate")),
        ), listed=True),
        Section("springs", "[[springs]]", _doc(Spring),
                (*PLACES, *of(Spring, *_PLACED, stiffness=_stiffness("stiffness", "stiffness along and about the axes"))), listed=True),
        Section("masses", "[[masses]]", _doc(Mass), (*PLACES, *of(Mass, *_PLACED)), listed=True),
        Section("conditions", "[[conditions]]", _doc(Condition), of(Condition), listed=True),
        Section("initial", "[[initial]]", _doc(InitialCondition), of(
            InitialCondition,
            displacement=Key("displacement", _SPACE, "displacement; 0 where not given", "m", None),
            velocity=Key("velocity", _SPACE, "velocity; 0 where not given", "m/s", None),
            rotation=Key("rotation", _turn("angle"), "rigid rotation by small angles; nodes that have rotations turn too", "rad", None),
            spin=Key("spin", _turn("rate"), "rate of a rigid rotation", "rad/s", None),
        ), listed=True),
    ]


def _load_sections() -> list[Section]:
    return [
        Section("load", '[load] of the ground (kind = "ground")', _GROUND, (
            Key("kind", str, "what acts", default="ground", range='"ground", "force", "pressure"'),
            Key("direction", f"one of {', '.join(AXES)}, or {_COMPONENTS}", "direction, or the axis of a rocking motion"),
            Key("center_of_rotation", "a point [x, y, z]", "a point on the axes of rocking motions", "m", None),
            Key("signal", str, "the function of time, see below", range=", ".join(f'"{name}"' for name in SIGNALS)),
        ), listed=True),
        Section("load", '[load] of forces (kind = "force")', _doc(Force), (
            _NAME, *PLACES,
            Key("force", _COMPONENTS, "along and about the axes", "N or N m, per point, metre or square metre"),
            Key("signal", str, _SIGNAL, default=None),
        ), listed=True),
        Section("load", '[load] of pressure (kind = "pressure")', _doc(Pressure), (
            _NAME, *of(Pressure, "name", "signal", value=Key("value", float, "pressure along the normal", "Pa")),
            Key("signal", str, _SIGNAL, default=None),
        ), listed=True),
        *(_signal_section(name, kind) for name, kind in SIGNALS.items()),
    ]


def _run_sections() -> list[Section]:
    return [
        Section("probes", "[[probes]]", _doc(Probe), of(
            Probe, point=Key("point", "a point [x, y], [x, y, z] or the name of one", "position, at a node or anywhere in the plate", "m"),
        ), listed=True),
        Section("cuts", "[[cuts]]", _doc(Cut), of(
            Cut, point=Key("point", "a point [x, y] or [x, y, z]", "point that the moments are about", "m"),
            plane=Key("plane", "a table of point = [x, y, z] and normal = [x, y, z]",
                      "plane, instead of a group; cells whose middle lies where its normal does not point to are the side", "m", None),
        ), listed=True),
        Section("run", "[run]", _doc(analysis.Run), of(analysis.Run)),
        Section("transient", "[transient]", _doc(analysis.Transient), of(analysis.Transient)),
        Section("transient.settling", "[transient.settling]", _doc(analysis.Settling), of(analysis.Settling)),
        Section("fourier", "[fourier]", _doc(Window), of(Window)),
        Section("modal", "[modal]", _doc(analysis.Modal), of(analysis.Modal)),
        Section("harmonic", "[harmonic]", _doc(analysis.Harmonic), of(analysis.Harmonic)),
        Section("basis", "[basis]", _doc(analysis.Basis), of(analysis.Basis)),
        Section("output", "[output]", _doc(analysis.Output), of(analysis.Output)),
    ]


def _doc(kind: type) -> str:
    return (kind.__doc__ or "").strip()


INTRODUCTION = """# Scene files

A scene is one TOML file. Units are SI throughout; X, Y and Z are the axes of space, RX, RY and RZ the rotations about them.
Names of files are relative to the folder of the scene. A key that is not on this page is refused, with the likeliest one named.
`python3 -m drivers new NAME --from sdls119a` copies a scene that ships, `python3 -m drivers check NAME.toml` checks it without running it.

This page is made of the code that reads the files: `python3 -m drivers schema --out docs/scene.md`. A default of "none" means that
the key may be absent and then has no value.
"""


def page(program: str = "python3 -m drivers") -> str:
    """Return the page as Markdown; `program` is how the commands on it are called."""
    lines = [INTRODUCTION.replace("python3 -m drivers", program)]
    for section in sections():
        several = "\n\nThere may be several of these." if section.listed else ""
        paragraphs = "\n\n".join(" ".join(part.split()) for part in section.doc.split("\n\n"))
        lines.append(f"## {section.heading}\n\n{paragraphs}{several}\n")
        lines.append("| key | value | unit | default | range | meaning |\n|---|---|---|---|---|---|")
        lines += [_row(key) for key in section.keys]
        lines.append("")
    return "\n".join(lines)


def _row(key: Key) -> str:
    cells = (f"`{key.name}`", key.kind_in_words, key.unit, key.default_in_words, key.range, key.doc)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
