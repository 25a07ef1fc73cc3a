"""Cases of the model: its springs, supports, materials, thickness and point masses."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from uplift.drivers.evidence.stability import laws
from uplift.drivers.evidence.stability.cases import Case, dense

DISSIPATIVE = {"transient.method": "generalised-alpha", "transient.rho_infinity": 0.0}


def penalties() -> list[Case]:
    """Return the cases of springs that stand for something rigid."""
    return [
        Case(
            "Springs that stand for something rigid",
            f"contacts and sideways springs {p:.0e} N/m",
            "whole history against the independent model, where a contact adds its flexibility to a spring and no large entry arises",
            dense({"supports.stiffness.X": p, "supports.contact": {"X": p, "Y": p}}),
            quick=p in (1e6, 1e18),
        )
        for p in (1e6, 1e8, 1e10, 1e12, 1e15, 1e18)
    ]


def _supports(stiffnesses: list[float]) -> dict[str, Any]:
    """Return the change to supports of these stiffnesses side by side under the bottom edge, 4 m long."""

    def tables(old: dict[str, Any]) -> list[dict[str, Any]]:
        common = {key: value for key, value in old.items() if key not in ("edge", "count")}
        return [
            common | {"name": f"S{i}", "points": [[4.0 * i / (len(stiffnesses) - 1), 0.0]], "stiffness": {"X": 1e15, "Y": stiffness}}
            for i, stiffness in enumerate(stiffnesses)
        ]

    return {"supports": lambda old: tables(old[0])}


def supports() -> list[Case]:
    """Return the cases of stiff, soft and unlike supports."""
    group = "Stiffness of the supports"
    cases = [
        Case(
            group,
            f"all supports {k:.0e} N/m",
            "whole history against the independent model on the same steps",
            dense({"supports.stiffness.Y": k}),
            quick=k == 1e9,
        )
        for k in (1e5, 1e7, 1e9)
    ]
    cases.insert(
        0,
        Case(
            group,
            "all supports 1e+03 N/m",
            "the plate sinks in by 157 m and then moves by 0.2 m: this motion against the independent model",
            lambda bench: bench.moved_against_dense({"supports.stiffness.Y": 1e3}),
            origin="eps x condition of the stiffness x static displacement / motion",
        ),
    )
    cases += [
        Case(
            group,
            f"all supports {k:.0e} N/m, generalised-alpha",
            "the same; average acceleration would enlarge round-off at every touch, generalised-alpha with rho = 0 damps it",
            dense({"supports.stiffness.Y": k} | DISSIPATIVE),
        )
        for k in (1e11, 1e12, 1e13, 1e15)
    ]
    cases += [
        Case(
            group,
            f"all supports {k:.0e} N/m, average acceleration",
            "two solvers may part here (chatter, see the note), but the law must hold at every step: largest pull of a contact, or force "
            "across an open one, relative to the largest force",
            partial(laws.chatter, stiffness=k),
            origin="100 x eps x what an open contact would carry if bonded / largest force",
        )
        for k in (1e12, 1e15)
    ]
    cases += [
        Case(
            group,
            f"neighbours {soft:.0e} and {stiff:.0e} N/m{', generalised-alpha' if scheme else ''}",
            "five supports soft and stiff by turns, against the independent model",
            dense(_supports([soft, stiff, soft, stiff, soft]) | scheme),
        )
        for soft, stiff, scheme in ((1.0, 1e9, {}), (1e3, 1e12, DISSIPATIVE))
    ]
    return cases


def materials() -> list[Case]:
    """Return the cases of Young's modulus, Poisson's ratio, thickness and damping."""
    what = "whole history against the independent model"
    cases = [Case("Material", f"E = {e:.1e} Pa", what, dense({"plate.young": e}), quick=e == 2.1e11) for e in (1e5, 1e7, 3e10, 2.1e11)]
    cases += [Case("Material", f"nu = {nu:g}", what, dense({"plate.poisson": nu}), quick=nu == 0.4999) for nu in (0.0, 0.45, 0.49, 0.4999)]
    cases += [
        Case("Thickness", f"thickness / span {ratio:g}", what, dense({"plate.thickness": 8.0 * ratio})) for ratio in (1e-3, 1e-1, 1.0)
    ]
    cases.append(
        Case(
            "Thickness",
            "thickness / span 1e-05, generalised-alpha",
            "a sheet of 6 kg on supports of 1e8 N/m, as rigid to it as 1e12 N/m to 80 t; "
            "against the independent model, by a scheme that damps the touches",
            dense({"plate.thickness": 8e-5} | DISSIPATIVE),
        )
    )
    cases += [
        Case(
            "Thickness",
            f"thickness / span {ratio:g}, supports in proportion",
            "in its own plane a plate on supports and springs scaled with its thickness moves as the one of 1 m: against that run",
            partial(laws.thin, ratio=ratio),
            1e-9,
            "round-off",
        )
        for ratio in (1e-5, 1.0)
    ]
    damped = {"plate.alpha": 0.0, "plate.beta": 0.0}
    cases += [
        Case("Damping", "undamped", what, dense(damped)),
        Case(
            "Damping",
            "undamped, energy",
            "no contact opens, a linear structure: after 20 s the ledger's rest, work - kinetic - strain - springs, "
            "relative to the largest kinetic energy",
            laws.energy,
            1e-9,
            "average acceleration keeps the energy exactly",
        ),
        Case("Damping", "mass-proportional, 440 times critical", what, dense(damped | {"plate.beta": 1e4})),
        Case("Damping", "stiffness-proportional, 57 times critical", what, dense(damped | {"plate.alpha": 10.0})),
        Case("Damping", "both together", what, dense({"plate.alpha": 10.0, "plate.beta": 1e4})),
    ]
    return cases


def thin_plates() -> list[Case]:
    """Return the cases of bending, from the thinnest plate to one as thick as its span."""
    return [
        Case(
            "Thin plates that are bent",
            f"bent, thickness / span {ratio:g}",
            "first frequency of a square plate of 8 x 8 cells on hard simple supports against Mindlin's closed form, which tends to "
            "Kirchhoff's where it is thin; an element that locks would be too stiff there, by the square of span over thickness",
            partial(laws.bent, ratio=ratio),
            1e-3,
            "the mesh: (pi / 8)^4 x 1/24",
            quick=ratio == 1e-5,
        )
        for ratio in (1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0)
    ]


def joints() -> list[Case]:
    """Return the cases of point masses on the joints."""
    group = "Point masses on the joints"
    what = (
        "an open contact leaves its auxiliary node, which swings free on its own spring; against the independent model, where it is a dof "
        "of its own, by generalised-alpha, which damps the clash of two masses"
    )
    cases = [
        Case(group, f"{mass:g} kg under each contact", what, dense({"supports.mass": mass} | DISSIPATIVE), quick=mass == 1e5)
        for mass in (1e-6, 10.0, 1e3, 1e5, 1e7)
    ]
    cases.append(
        Case(
            group,
            "1e+09 kg under each contact",
            f"{what}; the masses sink in by 98 m and the motion from there is compared",
            lambda bench: replace(bench.moved_against_dense({"supports.mass": 1e9} | DISSIPATIVE), limit=None),
            1e-6,
            "forces of 1e10 N on the masses beside 3e5 N in the contacts cost 4 digits",
        )
    )
    cases.append(
        Case(
            group,
            "0.1 kg, average acceleration",
            "a node of 5 kHz in steps of 5 ms counts as one without mass: against the independent model without it",
            laws.light,
            1e-6,
            "2 m / dt^2 over the support's stiffness, 8e-5, x share of the springs' work in a touch",
        )
    )
    return cases
