"""Cases of the mesh: how many cells and contacts, in which units, of which shape."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from uplift.drivers.evidence.stability import laws
from uplift.drivers.evidence.stability.cases import Case, dense
from uplift.drivers.evidence.stability.laws import SUDDEN

ONE = {"supports.edge": None, "supports.count": None, "supports.points": [[2.0, 0.0]]}


def numbers() -> list[Case]:
    """Return the cases of none, one and many supports."""
    group = "Number of supports"
    bare = {"supports": None, "springs": None, "transient.start": "rest", "plate.alpha": 0.0, "plate.beta": 0.0}
    return [
        Case(
            group,
            "no support",
            "a free plate falls by g t^2 / 2 and stays behind the ground; average acceleration is exact for the fall",
            partial(laws.falling, changes=bare),
            1e-10,
            "round-off of 1,000 steps",
        ),
        Case(
            group,
            "one, in the middle",
            "held upright by the two top springs of 1 N/m alone: the motion from the static state against the independent model",
            lambda bench: replace(bench.moved_against_dense(ONE), limit=None),
        ),
        Case(
            group,
            "one, static state",
            "the same plate before the ground moves; 80 t stand upright on 8 N m a radian, and digits are lost",
            lambda bench: bench.static_against_dense(ONE),
            origin="dofs x eps x condition of the stiffness: Wilkinson's bound of a direct solution",
        ),
        Case(
            group,
            "500",
            "500 supports that share the stiffness of five under cells 1,000 times as high as wide; against the independent model "
            "in double precision",
            dense(_many(500), float),
        ),
    ]


def _many(number: int) -> dict[str, Any]:
    return SUDDEN | {
        "mesh.nx": number - 1,
        "mesh.ny": 1,
        "supports.count": number,
        "supports.stiffness.Y": lambda k: 5 * k / number,
        "transient.duration": 0.4,
    }


def units() -> list[Case]:
    """Return the cases of units: the same plate written in others."""
    return [
        Case(
            "Units",
            name,
            "every number of the scene in other units, so that the answer is the same one in them; against the run in m, kg, s",
            partial(laws.in_units, length=length, mass=mass, second=second),
            1e-10,
            "round-off; no tolerance may have a unit",
            quick=length == 1e3,
        )
        for name, length, mass, second in (
            ("plate of 4 mm x 8 mm", 1e-3, 1e-9, 1e-3),
            ("plate of 4 km x 8 km", 1e3, 1e9, 1e3),
            ("written in mm, t, s", 1e3, 1e-3, 1.0),
            ("written in km, mg, h", 1e-3, 1e6, 1 / 3600),
        )
    ]


def meshes() -> list[Case]:
    """Return the cases of poor meshes."""
    return [
        Case("Mesh", "one element", "against the independent model", dense({"mesh.nx": 1, "mesh.ny": 1, "supports.count": 2}), quick=True),
        Case(
            "Mesh",
            "one element, a rigid body on two springs",
            "stiff plate, bonded supports: bounces under its weight, set on at time 0, as a damped oscillator; against the closed form",
            laws.oscillator,
            3e-4,
            "average acceleration: omega t (omega dt)^2 / 12",
        ),
        Case(
            "Mesh",
            "one element, the same 100 times over-damped",
            "creeps to its place; against the closed form of the over-damped oscillator",
            partial(laws.oscillator, ratio=100.0),
            3e-4,
            "the same bound",
        ),
        Case(
            "Mesh", "slivers 1 m x 1 mm", "a strip 8 mm high of 4 x 8 cells, against the independent model", dense({"mesh.height": 8e-3})
        ),
        Case(
            "Mesh",
            "slivers 1 mm x 1 m",
            "a plate 0.1 m wide and 1 m high of 100 x 1 cells on supports of 3e6 N/m, up to its first landing; against the "
            "independent model",
            lambda bench: bench.against_dense(
                {
                    "mesh.width": 0.1,
                    "mesh.height": 1.0,
                    "mesh.nx": 100,
                    "mesh.ny": 1,
                    "supports.stiffness.Y": 3e6,
                    "transient.duration": 1.5,
                },
                bound=True,
            ),
            origin="dofs x eps x condition of a step",
        ),
        Case(
            "Mesh",
            "a column 8 m high and 4 mm wide, static state",
            "of cells 1 mm x 1 m; its stiffness in bending is 1e-11 of that of its cells, and digits are lost; "
            "against the independent model",
            lambda bench: bench.static_against_dense({"mesh.width": 4e-3}),
            origin="dofs x eps x condition of the stiffness: Wilkinson's bound of a direct solution",
        ),
    ]
