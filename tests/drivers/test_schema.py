"""The page of all keys is that of the code, and its keys are those that the readers ask for."""

import copy
import re
import tomllib
from pathlib import Path

import pytest

from uplift.drivers.scene.scene import build_scene
from uplift.drivers.scene.schema import NEEDED, page, sections
from uplift.drivers.scene.shipped import shipped
from uplift.drivers.scene.toml_table import Table
from uplift.forms.contact.supports import AXES
from uplift.meshes.checked import ModelError

ROOT = Path(__file__).parents[2]

INNER = {"grid": {"from", "to", "count"}, "axes": {"x", "edge", "cylinder"}, "cylinder": {"point", "axis"},
         "plane": {"point", "normal"}, "rotation": {"axis", "point", "angle"}, "spin": {"axis", "point", "rate"},
         **dict.fromkeys(("displacement", "velocity"), {"X", "Y", "Z"}),
         **dict.fromkeys(("stiffness", "contact", "force", "direction"), set(AXES))}
"""Tables inside a key, by their own name."""

BASE = """
title = "all keys"
[plate]
young = 3e10
poisson = 0.2
density = 2500.0
thickness = 0.5
alpha = 1e-3
beta = 1.0
"""

RECTANGLE = BASE + """
[mesh]
width = 4.0
height = 4.0
nx = 2
ny = 2
cell = "quadrilateral"
degree = 2
[kinematics]
kind = "bending"
rotary_inertia = true
[gravity]
acceleration = 9.81
direction = "-Z"
[[parts]]
group = "DAL1"
young = 3e10
poisson = 0.2
density = 2500.0
thickness = 0.5
alpha = 1e-3
beta = 1.0
[[supports]]
name = "A"
points = ["P1"]
stiffness = { Z = 1e7 }
contact = { Z = 1e10 }
mass = 1.0
unilateral = "Z"
gap = 0.001
preload = 0.0
sideways = "released"
[[supports]]
name = "B"
edge = "DBAS"
count = 3
stiffness = { Z = 1e7 }
contact = { Z = 1e10 }
[supports.none]
"""
RECTANGLE = RECTANGLE.replace("[supports.none]\n", 'unilateral = "Z"\n')

PLACES = {
    "points": {"points": [[0.0, 0.0]]}, "edge": {"edge": "DBAS", "count": 3}, "group": {"group": "DBAS", "per": "length"},
    "grid": {"grid": {"from": [0.0, 0.0], "to": [4.0, 4.0], "count": [2, 2]}}, "file": {"file": "points.csv"},
}

SIGNALS = {
    "ricker": {"amplitude": 1.0, "frequency": 1.0, "center": 1.0, "start": 0.0, "table_step": 0.1, "table_digits": 6},
    "sine": {"amplitude": 1.0, "frequency": 1.0, "phase": 0.1, "start": 0.0, "end": 2.0},
    "step": {"amplitude": 1.0, "start": 0.0, "rise": 1.0},
    "sweep": {"amplitude": 1.0, "first": 1.0, "last": 2.0, "start": 0.0, "end": 2.0, "spacing": "linear", "taper": 0.1},
    "noise": {"seed": 1, "rms": 1.0, "low": 1.0, "high": 5.0, "start": 0.0, "end": 4.0, "rise": 1.0, "decay": 1.0},
    "table": {"times": [0, 1], "values": [0.0, 1.0]},
    "csv": {"file": "record.csv", "scale": 2.0, "unit": "g", "column": 2},
}


def tables():
    """Scenes that use every key between them."""
    rectangle = tomllib.loads(RECTANGLE)
    rectangle["mesh"]["dofs"] = 9
    rectangle["probes"] = [{"name": "P", "point": [1.0, 1.0], "rotations": True, "forces": True, "part": "DAL1"}]
    rectangle["plate"]["axes"] = {"x": [1.0, 0.0, 0.0]}
    rectangle["parts"][0]["axes"] = {"edge": "DBAS"}
    rectangle["parts"] += [{"group": "DAL1", "axes": {"cylinder": {"point": [0.0, 0.0], "axis": [0.0, 0.0, 1.0]}}}]
    rectangle["cuts"] = [
        {"name": "C", "group": "DBAS", "side": "DAL1", "point": [0.0, 0.0]},
        {"name": "D", "plane": {"point": [1.0, 1.0], "normal": [1.0, 0.0, 0.0]}, "point": [0.0, 0.0]},
    ]
    rectangle["conditions"] = [{"group": "DGAU", "zero": ["DZ"]}, {"group": "DDRO", "edge": "soft"}]
    rectangle["load"] = [
        {"kind": "ground", "direction": "Z", "signal": name, **keys} for name, keys in SIGNALS.items()
    ] + [{"direction": {"RX": 1.0}, "center_of_rotation": [0.0, 0.0, 0.0], "signal": "step"}]
    rectangle["load"] += [
        {"kind": "force", "name": f"F{way}", "force": {"Z": 1.0}, "signal": "step", **at} for way, at in PLACES.items()
    ]
    rectangle["load"] += [{"kind": "pressure", "name": "Q", "group": "DAL1", "value": 1.0, "signal": "step"}]
    rectangle["supports"] += [{"name": f"S{way}", "unilateral": "", "stiffness": {"Z": 1.0}, "contact": {"Z": 1.0}, **at}
                              for way, at in PLACES.items()]
    rectangle["springs"] = [{"name": way, "stiffness": {"Z": 1.0}, **at} for way, at in PLACES.items()]
    rectangle["masses"] = [{"name": way, "mass": 1.0, **at} for way, at in PLACES.items()]
    rectangle["initial"] = [
        {"group": "DAL1", "displacement": {"Z": 1e-3}, "velocity": {"Z": 1.0},
         "rotation": {"axis": [1, 0, 0], "point": [0, 0, 0], "angle": 1e-3}, "spin": {"axis": [1, 0, 0], "point": [0, 0, 0], "rate": 1.0}},
        {"mode": 1, "amplitude": 1e-3},
    ]
    rectangle["run"] = {"method": "transient", "iterations": 2}
    rectangle["transient"] = {
        "step": 0.01, "duration": 1.0, "every": 2, "method": "newmark", "beta": 0.25, "gamma": 0.5, "alpha": 0.05, "rho_infinity": 0.8,
        "start": "settled", "settling": {"step": 1.0, "steps": 10, "beta": 1.0, "gamma": 1.5},
    }
    rectangle["fourier"] = {"length": 1.0, "samples": 100, "cutoff": 20.0}
    rectangle["modal"] = {"number": 3, "shift": -1.0, "diagonal": True, "static_correction": True}
    rectangle["harmonic"] = {"frequencies": [1, 2.0]}
    rectangle["basis"] = {"tolerance": 1e-4, "band": 20.0, "file": "basis.h5"}
    rectangle["output"] = {"instants": [0.5], "uplift": "all", "uplift_group": "DAL1", "envelopes": True}
    panels = tomllib.loads(BASE)
    panels["mesh"] = {
        "size": 1.0, "cell": "triangle", "degree": 2, "points": {"TOP": [1.0, 1.0, 0.0]},
        "plates": [{"name": "A", "corners": [[0, 0], [4, 0], [4, 4], [0, 4]], "holes": [[[1, 1], [2, 1], [2, 2]]],
                    "edges": ["a", "b", "c", "d"]}],
    }
    panels["modal"] = {"low": 0.0, "high": 5.0}
    panels["harmonic"] = {"low": 1.0, "high": 5.0, "count": 3}
    file = tomllib.loads(BASE)
    file["mesh"] = {"file": "mesh.msh", "degree": 1, "merge": True}
    cracked = tomllib.loads(BASE)
    cracked["mesh"] = {"file": "mesh.msh", "cracks": ["JOINT"]}
    return [rectangle, panels, file, cracked]


@pytest.fixture
def asked(monkeypatch, tmp_path):
    """Build all scenes; return what readers asked for, what the scenes hold and the defaults of the readers, by section."""
    (tmp_path / "points.csv").write_text("0,0\n", encoding="utf-8")
    (tmp_path / "record.csv").write_text("0,0\n1,1\n", encoding="utf-8")
    (tmp_path / "mesh.msh").write_text("", encoding="utf-8")
    made, defaults = [], {}
    begin, take = Table.__init__, Table.take

    def kept(self, table, where):
        begin(self, table, where)
        made.append((self, set(table)))

    def noted(self, name, kind, default=NEEDED):
        if isinstance(default, (str, int, float)):
            defaults[section_of(self.where), name] = default
        return take(self, name, kind) if default is NEEDED else take(self, name, kind, default)

    monkeypatch.setattr(Table, "__init__", kept)
    monkeypatch.setattr(Table, "take", noted)
    for table in tables():
        build_scene(table, tmp_path)
    known, held = {}, {}
    for table, names in made:
        known.setdefault(section_of(table.where), set()).update(table.known)
        held.setdefault(section_of(table.where), set()).update(names)
    return known, held, defaults


def section_of(where):
    return re.sub(r"\[[^]]*\]", "", where)


def documented():
    keys = {}
    for section in sections():
        keys.setdefault(section.path, {}).update({key.name: key for key in section.keys})
    return keys


def test_page_is_that_of_the_code():
    assert (ROOT / "docs" / "scene.md").read_text(encoding="utf-8") == page(), "python3 -m drivers schema --out docs/scene.md"


def test_readers_ask_for_the_documented_keys_and_for_no_others(asked):
    known, _, _ = asked
    sections_of_file = {name for name in documented() if name and "." not in name}
    for path, names in known.items():
        last = path.rsplit(".", 1)[-1]
        if "." in path and last in INNER:
            assert names <= INNER[last], path
        elif path == "mesh.points":
            assert names == {"TOP"}
        else:
            expected = set(documented()[path]) | (sections_of_file if not path else set())
            assert names == expected, path


def test_every_documented_key_is_accepted(asked):
    _, held, _ = asked
    for path, keys in documented().items():
        assert set(keys) <= held[path], path


def test_documented_defaults_are_those_of_the_readers(asked):
    _, _, defaults = asked
    compared = 0
    for (path, name), default in defaults.items():
        key = documented().get(path, {}).get(name)
        if key is not None and not (path == "load" and name in ("name", "signal")):
            assert key.default == default, (path, name)
            compared += 1
    assert compared >= 3


def test_shipped_scenes_use_documented_keys_only():
    keys = documented()

    def visit(table, path):
        for name, value in table.items():
            inner = f"{path}.{name}" if path else name
            assert inner in keys or name in keys[path], inner
            for entry in value if isinstance(value, list) else [value]:
                if isinstance(entry, dict) and inner in keys:
                    visit(entry, inner)

    for path in shipped().values():
        visit(tomllib.loads(path.read_text(encoding="utf-8")), "")


def misspelt():
    rectangle = tables()[0]
    for name, value in rectangle.items():
        table = value[0] if isinstance(value, list) else value
        if isinstance(table, dict):
            for key in table:
                if len(key) > 3:
                    yield name, key


@pytest.mark.parametrize(("section", "key"), [("mesh.plates", "edges"), ("transient.settling", "gamma"), *misspelt()])
def test_misspelt_keys_are_named_with_what_was_meant(section, key, tmp_path):
    (tmp_path / "record.csv").write_text("0,0\n1,1\n", encoding="utf-8")
    (tmp_path / "points.csv").write_text("0,0\n", encoding="utf-8")
    table = copy.deepcopy(tables()[1 if section == "mesh.plates" else 0])
    entry = table
    for part in section.split("."):
        entry = entry[part]
    entry = entry[0] if isinstance(entry, list) else entry
    wrong = key[:-2] + key[-1] + key[-2] if key[-1] != key[-2] else key + "x"
    entry[wrong] = entry.pop(key)
    with pytest.raises(ModelError, match=f"did you mean '{key}'"):
        build_scene(table, tmp_path)


def test_every_key_says_what_it_is():
    for section in sections():
        assert section.doc
        for key in section.keys:
            assert key.doc and key.kind_in_words and "object" not in key.kind_in_words, (section.heading, key.name)
            assert "MISSING" not in key.default_in_words
