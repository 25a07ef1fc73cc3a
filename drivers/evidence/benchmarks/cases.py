"""The benchmarks that are statics and modes: scenes as tables, and what their answers are compared with."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.evidence.benchmarks.meshes import write_cylinder, write_disc
from uplift.drivers.evidence.benchmarks.runs import LIMIT, Check, Outcome, Runner, mesh_in_words, targets
from uplift.drivers.evidence.benchmarks.theory import SupportedPlate, lifted_strip
from uplift.drivers.scene.request import Request
from uplift.forms.shells.material import Material
from uplift.forms.shells.shell import SHEAR_CORRECTION

NAFEMS = {"young": 200e9, "poisson": 0.3, "density": 8000.0, "thickness": 0.05}
EDGES = ("DBAS", "DDRO", "DHAU", "DGAU")

SHEARED = 0.02
"""How far a shell that shears may settle above the pinched cylinder's target, which knows no shear."""

COARSE = 0.015
"""Admissible difference of a box with 16 cells in its raft, whose edges and corners hold singular stresses."""


def _frequency_checks(case: str, frequencies: np.ndarray, first: int) -> tuple[Check, ...]:
    """Compare with the targets of a case, the first of which is mode number `first`."""
    named = targets(case)
    return tuple(
        Check(name, "Hz", float(f), target)
        for (name, target), f in zip(named.items(), frequencies[first - 1 :][: len(named)], strict=True)
    )


def free_plate(runner: Runner) -> list[Outcome]:
    """Run NAFEMS FV12."""
    outcomes = []
    for n, cell in ((8, "quadrilateral"), (8, "triangle"), (12, "quadrilateral")):
        mesh = {"width": 10.0, "height": 10.0, "nx": n, "ny": n, "cell": cell}
        table = {"mesh": mesh, "plate": NAFEMS, "kinematics": {"kind": "bending"}, "modal": {"number": 9, "shift": -1.0}}
        found, words, dofs = runner.modes(table)
        rigid = Check("rigid motions", "1", float(found.rigid), 3.0, 0.0)
        outcomes.append(Outcome(words, dofs, (rigid, *_frequency_checks("FV12", found.frequencies, 4))))
    return outcomes


def tapered_membrane(runner: Runner) -> list[Outcome]:
    """Run NAFEMS FV32."""
    outline = {"name": "WEB", "corners": [[0, 0], [10, 2], [10, 3], [0, 5]], "edges": ["BELOW", "TIP", "ABOVE", "ROOT"]}
    outcomes = []
    for size in (1.0, 0.5):
        table = {
            "mesh": {"size": size, "degree": 2, "plates": [outline]}, "plate": NAFEMS, "kinematics": {"kind": "plane stress"},
            "conditions": [{"group": "ROOT", "edge": "clamped"}], "modal": {"number": 6},
        }
        found, words, dofs = runner.modes(table)
        outcomes.append(Outcome(words, dofs, _frequency_checks("FV32", found.frequencies, 1)))
    return outcomes


def _mirror(axis: str) -> list[str]:
    """Return the components that are zero in a plane of symmetry normal to `axis`."""
    return [f"D{axis}", *(f"DR{other}" for other in "XYZ" if other != axis)]


def roof(runner: Runner) -> list[Outcome]:
    """Run a quarter of the Scordelis-Lo roof."""
    outcomes = []
    for n, cell in ((8, "quadrilateral"), (12, "quadrilateral"), (8, "triangle")):
        table = {
            "mesh": runner.file(f"roof-{cell}-{n}.msh", write_cylinder, 25.0, 40.0, 25.0, n, cell),
            "plate": {"young": 4.32e8, "poisson": 0.0, "density": 1.0, "thickness": 0.25},
            "conditions": [
                {"group": "END", "zero": ["DX", "DZ"]}, {"group": "CROWN", "zero": _mirror("X")}, {"group": "MIDDLE", "zero": _mirror("Y")},
            ],
            "load": [{"kind": "force", "group": "SHELL", "per": "area", "force": {"Z": -90.0}}],
            "probes": [{"name": "P", "point": [25 * math.sin(math.radians(40)), 0.0, 25 * math.cos(math.radians(40))]}],
        }
        found, words, dofs = runner.static(table)
        outcomes.append(Outcome(words, dofs, (Check("sag of the free edge", "1", -found["P.DZ"], targets("SCORDELIS")["free edge"]),)))
    return outcomes


def pinched_cylinder(runner: Runner) -> list[Outcome]:
    """Run an eighth of the pinched cylinder with diaphragms."""
    outcomes = []
    for n, limit in ((16, LIMIT), (24, SHEARED), (32, SHEARED)):
        if runner.quick and n > 16:
            break
        table = {
            "mesh": runner.file(f"cylinder-{n}.msh", write_cylinder, 300.0, 90.0, 300.0, n),
            "plate": {"young": 3e6, "poisson": 0.3, "density": 1.0, "thickness": 3.0},
            "conditions": [
                {"group": "END", "zero": ["DX", "DZ"]}, {"group": "CROWN", "zero": _mirror("X")},
                {"group": "SIDE", "zero": _mirror("Z")}, {"group": "MIDDLE", "zero": _mirror("Y")},
            ],
            "load": [{"kind": "force", "group": "TOP", "force": {"Z": -0.25}}],
            "probes": [{"name": "P", "point": [0.0, 0.0, 300.0]}],
        }
        found, words, dofs = runner.static(table)
        check = Check("deflection under the force", "1", -found["P.DZ"], targets("PINCHED")["under the force"], limit)
        outcomes.append(Outcome(words, dofs, (check,)))
    return outcomes


def folded_box(runner: Runner) -> list[Outcome]:
    """Run a free box of a raft and four walls, and the same on a bed, against a refined model of higher degree."""
    s, h = 10.0, 5.0
    ring = [[0.0, 0.0], [s, 0.0], [s, s], [0.0, s]]
    plates = [{"name": "RAFT", "corners": [[*p, 0.0] for p in ring]}]
    for i, (a, b) in enumerate(zip(ring, ring[1:] + ring[:1], strict=True), start=1):
        plates.append({"name": f"WALL-{i}", "corners": [[*a, 0.0], [*b, 0.0], [*b, h], [*a, h]]})
    free = {
        "plate": {"young": 30e9, "poisson": 0.2, "density": 2500.0, "thickness": 0.2}, "modal": {"number": 12, "shift": -1e3},
    }
    bedded = {
        "plate": free["plate"], "springs": [{"name": "BED", "group": "RAFT", "per": "area", "stiffness": {"X": 1e6, "Y": 1e6, "Z": 1e7}}],
        "load": [{"kind": "force", "name": "WIND", "group": "WALL-4", "per": "area", "force": {"X": 1e3}}],
        "probes": [{"name": "RIM", "point": [0.0, 5.0, h]}, {"name": "RAFT", "point": [5.0, 5.0, 0.0]}],
    }

    def both(size: float, degree: int) -> tuple[np.ndarray, np.ndarray, int, str, int]:
        mesh = {"size": size, "degree": degree, "plates": plates}
        found, words, dofs = runner.modes({"mesh": mesh, **free})
        moved, _, _ = runner.static({"mesh": mesh, **bedded})
        return found.frequencies[6:], np.array([moved["RIM.DX"], moved["RAFT.DZ"], moved["RIM.DZ"]]), found.rigid, words, dofs

    refined_f, refined_u, _, refined_words, refined_dofs = both(2.5 if runner.quick else 1.25, 3)
    outcomes = []
    for size in (2.5, 1.25):
        if runner.quick and size < 2.5:
            break
        limit = COARSE if size == 2.5 else LIMIT
        frequencies, moved, rigid, words, dofs = both(size, 2)
        checks = [Check("rigid motions", "1", float(rigid), 6.0, 0.0)]
        checks += [Check(f"mode {i}", "Hz", float(f), float(g), limit)
                   for i, (f, g) in enumerate(zip(frequencies, refined_f, strict=True), start=7)]
        checks += [Check(f"{name}, wind on a bed", "m", float(u), float(v), limit)
                   for name, u, v in zip(("rim across", "rim up"), moved[[0, 2]], refined_u[[0, 2]], strict=True)]
        outcomes.append(Outcome(f"{words} (target: {refined_words}, {refined_dofs} dofs)", dofs, tuple(checks)))
    return outcomes


def _worst(what: str, values: np.ndarray, exact: np.ndarray, note: str) -> list[Check]:
    """Compare the first value and the one that is farthest off."""
    worst = int(np.argmax(np.abs(values / exact - 1)))
    checks = [Check(f"{what}, mode 1", "Hz", float(values[0]), float(exact[0]), note=note)]
    if worst:
        checks.append(Check(f"{what}, worst of {len(exact)}: mode {worst + 1}", "Hz", float(values[worst]), float(exact[worst]), note=note))
    return checks


def square_plates(runner: Runner) -> list[Outcome]:
    """Run simply supported and clamped square plates of any thickness on one mesh."""
    outcomes = []
    for thickness in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)[:: 4 if runner.quick else 1]:
        material = Material(young=2e11, poisson=0.3, density=8000.0, thickness=thickness)
        common = {
            "mesh": {"width": 1.0, "height": 1.0, "nx": 12, "ny": 12}, "plate": NAFEMS | {"young": 2e11, "thickness": thickness},
            "kinematics": {"kind": "bending", "rotary_inertia": True}, "modal": {"number": 10},
        }
        theory = SupportedPlate(1.0, material)
        unit = math.sqrt(theory.rigidity / (8000.0 * thickness)) / (2 * math.pi)
        squares = np.add.outer(np.arange(1, 6) ** 2, np.arange(1, 6) ** 2).ravel()
        thin = unit * np.pi**2 * np.sort(squares)[:10]
        hard, words, dofs = runner.modes(common | {"conditions": [{"group": e, "edge": "hard"} for e in EDGES]})
        clamped, _, _ = runner.modes(common | {"conditions": [{"group": e, "edge": "clamped"} for e in EDGES]})
        supported = (theory.frequencies(10), "Mindlin") if thickness >= 1e-2 else (thin, "thin plate")
        case, scale, name = ("CLAMPED_THICK", np.pi**2, "Mindlin") if thickness == 0.1 else ("CLAMPED", 1.0, "thin plate")
        ends = unit * scale * np.array(list(targets(case).values()))
        checks = [
            *_worst(f"t/L = {thickness:g}, supported", hard.frequencies, *supported),
            *_worst(f"t/L = {thickness:g}, clamped", clamped.frequencies[: len(ends)], ends, name),
        ]
        outcomes.append(Outcome(words, dofs, tuple(checks)))
    return outcomes


def clamped_disc(runner: Runner) -> list[Outcome]:
    """Run a clamped circular plate under pressure, from a mesh file, thin and thick."""
    outcomes = []
    for cell, thickness in (("quadrilateral", 0.01), ("quadrilateral", 0.2), ("triangle", 0.01)):
        table = {
            "mesh": runner.file(f"disc-{cell}.msh", write_disc, 1.0, 0.08, cell), "plate": NAFEMS | {"thickness": thickness},
            "conditions": [{"group": "RIM", "edge": "clamped"}], "load": [{"kind": "pressure", "value": -1e3}],
            "probes": [{"name": "P", "point": [0.0, 0.0]}],
        }
        found, words, dofs = runner.static(table)
        rigidity = 200e9 * thickness**3 / (12 * 0.91)
        exact = 1e3 / (64 * rigidity) + 1e3 / (4 * SHEAR_CORRECTION * 200e9 / 2.6 * thickness)
        outcomes.append(Outcome(words, dofs, (Check(f"t/R = {thickness:g}, middle", "m", abs(found["P.DZ"]), exact),)))
    return outcomes


def cantilever(runner: Runner) -> list[Outcome]:
    """Run a strip clamped at one end, as Timoshenko's beam, with a force on its tip."""
    young, thickness, length = 2e11, 0.1, 10.0
    bending, shear = young * thickness**3 / 12, SHEAR_CORRECTION * young / 2 * thickness
    table: dict[str, Any] = {
        "mesh": {"width": length, "height": 1.0, "nx": 20, "ny": 1},
        "plate": {"young": young, "poisson": 0.0, "density": 8000.0, "thickness": thickness},
        "conditions": [{"group": "DGAU", "edge": "clamped"}], "probes": [{"name": "TIP", "point": [length, 0.5], "rotations": True}],
        "load": [{"kind": "force", "group": "DDRO", "per": "length", "force": {"Z": 1e3}}],
    }
    found, words, dofs = runner.static(table)
    checks = (
        Check("deflection of the tip", "m", found["TIP.DZ"], 1e3 * length**3 / (3 * bending) + 1e3 * length / shear, 1e-4),
        Check("slope of the tip", "rad", -found["TIP.DRY"], 1e3 * length**2 / (2 * bending), 1e-4),
    )
    return [Outcome(words, dofs, checks)]


def tensionless_bed(runner: Runner) -> list[Outcome]:
    """Run a long weightless strip on a bed that cannot pull, under a line load across its middle; forces per metre of its width."""
    young, thickness, bed, load, half = 3e10, 0.25, 1e7, 1e4, 7.0
    deflection, contact = lifted_strip(load, young * thickness**3 / 12, bed)
    width = 0.25 if runner.quick else 0.125
    halves = [
        {"name": name, "corners": [[x, 0], [x + half, 0], [x + half, width], [x, width]], "edges": ["S", right, "N", left]}
        for name, x, left, right in (("WEST", -half, "END", "MIDDLE"), ("EAST", 0.0, "MIDDLE", "END"))
    ]
    support = {"per": "area", "stiffness": {"Z": bed}, "contact": {"Z": 1e15}, "unilateral": "Z"}
    table = {
        "mesh": {"size": width, "plates": halves},
        "plate": {"young": young, "poisson": 0.0, "density": 2500.0, "thickness": thickness},
        "supports": [{"name": "WEST", "group": "WEST", **support}, {"name": "EAST", "group": "EAST", **support}],
        "load": [{"kind": "force", "group": "MIDDLE", "per": "length", "force": {"Z": -load}}],
        "probes": [{"name": "P", "point": [0.0, width / 2]}],
    }
    with runner.assembly(table) as assembly:
        history = analyse(assembly, Request("static")).final
        contacts, words, dofs = assembly.operators.contacts, mesh_in_words(assembly), assembly.operators.n
    along, opened = np.abs(contacts.points[:, 0]), contacts.law.gap(history.release)[0] > 0
    last, first = float(np.max(along[~opened])), float(np.min(along[opened]))
    checks = (
        Check("deflection under the load", "m", -float(history.probes[0, 0]), deflection),
        Check("half of the length that stays down", "m", (first + last) / 2, contact, (first - last) / 2 / contact, "between two nodes"),
    )
    return [Outcome(words, dofs, checks)]
