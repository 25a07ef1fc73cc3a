"""The cases of the stability table that are compared with the independent model, with a closed form or with a law of scaling."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from uplift.drivers.evidence.stability import laws
from uplift.drivers.evidence.stability.bench import ROUND_OFF, Bench, Finding
from uplift.drivers.evidence.stability.laws import SUDDEN
from uplift.drivers.evidence.stability.oracle import EXTENDED

DISSIPATIVE = {"transient.method": "generalised-alpha", "transient.rho_infinity": 0.0}
ONE = {"supports.edge": None, "supports.count": None, "supports.points": [[2.0, 0.0]]}


@dataclass(frozen=True)
class Case:
    """One row of the table."""

    group: str
    name: str
    what: str
    """What is done, and why it tells right from wrong."""
    run: Callable[[Bench], Finding]
    limit: float = ROUND_OFF
    origin: str = "round-off"
    """Where the limit comes from."""
    quick: bool = False


def _dense(changes: dict[str, Any], precision: type = EXTENDED) -> Callable[[Bench], Finding]:
    return lambda bench: bench.against_dense(changes, precision)


def penalties() -> list[Case]:
    """Return the cases of springs that stand for something rigid."""
    return [
        Case(
            "Springs that stand for something rigid",
            f"contacts and sideways springs {p:.0e} N/m",
            "whole history against the independent model, where a contact adds its flexibility to a spring and no large entry arises",
            _dense({"supports.stiffness.X": p, "supports.contact": {"X": p, "Y": p}}),
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
            _dense({"supports.stiffness.Y": k}),
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
            _dense({"supports.stiffness.Y": k} | DISSIPATIVE),
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
            _dense(_supports([soft, stiff, soft, stiff, soft]) | scheme),
        )
        for soft, stiff, scheme in ((1.0, 1e9, {}), (1e3, 1e12, DISSIPATIVE))
    ]
    return cases


def materials() -> list[Case]:
    """Return the cases of Young's modulus, Poisson's ratio, thickness and damping."""
    what = "whole history against the independent model"
    cases = [Case("Material", f"E = {e:.1e} Pa", what, _dense({"plate.young": e}), quick=e == 2.1e11) for e in (1e5, 1e7, 3e10, 2.1e11)]
    cases += [Case("Material", f"nu = {nu:g}", what, _dense({"plate.poisson": nu}), quick=nu == 0.4999) for nu in (0.0, 0.45, 0.49, 0.4999)]
    cases += [
        Case("Thickness", f"thickness / span {ratio:g}", what, _dense({"plate.thickness": 8.0 * ratio})) for ratio in (1e-3, 1e-1, 1.0)
    ]
    cases.append(
        Case(
            "Thickness",
            "thickness / span 1e-05, generalised-alpha",
            "a sheet of 6 kg on supports of 1e8 N/m, as rigid to it as 1e12 N/m to 80 t; "
            "against the independent model, by a scheme that damps the touches",
            _dense({"plate.thickness": 8e-5} | DISSIPATIVE),
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
        Case("Damping", "undamped", what, _dense(damped)),
        Case(
            "Damping",
            "undamped, energy",
            "no contact opens, a linear structure: after 20 s the ledger's rest, work - kinetic - strain - springs, "
            "relative to the largest kinetic energy",
            laws.energy,
            1e-9,
            "average acceleration keeps the energy exactly",
        ),
        Case("Damping", "mass-proportional, 440 times critical", what, _dense(damped | {"plate.beta": 1e4})),
        Case("Damping", "stiffness-proportional, 57 times critical", what, _dense(damped | {"plate.alpha": 10.0})),
        Case("Damping", "both together", what, _dense({"plate.alpha": 10.0, "plate.beta": 1e4})),
    ]
    return cases


def steps() -> list[Case]:
    """Return the cases of time steps."""
    cases = [
        Case(
            "Time step",
            f"dt = {dt:g} s",
            "500 steps of a pulse that sets in suddenly at time 0, against the independent model on the same steps; "
            "relative to the motion itself, however small",
            _dense(SUDDEN | {"transient.step": dt, "transient.duration": 500 * dt}),
            quick=dt in (1e-6, 1.0),
        )
        for dt in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0)
    ]
    cases.append(
        Case(
            "Time step",
            "100,000 steps",
            "free undamped vibration: average acceleration turns each mode by the angle 2 atan(omega dt / 2) a step, "
            "so that the end is known in closed form, from the eigenvectors of the independent model",
            laws.drift,
            1e-8,
            "eps x largest angle turned, 3e5 rad, x 100",
        )
    )
    return cases


def amplitudes() -> list[Case]:
    """Return the cases of amplitudes and of gravity."""
    return [
        Case(
            "Amplitude and gravity",
            "amplitude 0",
            "nothing may move in 1,000 steps: largest displacement from the static state, relative to it",
            laws.still,
            1e-12,
            "1,000 steps x eps x 5",
        ),
        Case(
            "Amplitude and gravity",
            "amplitude 1e-12 m/s2",
            "the motion, 11 digits below the static state, against the independent model",
            lambda bench: bench.moved_against_dense({"load.amplitude": 1e-12}),
            origin="eps x condition of the stiffness x static displacement / motion",
        ),
        Case(
            "Amplitude and gravity",
            "amplitude 1e3 m/s2",
            "the plate is thrown about by 100 g; against the independent model",
            _dense({"load.amplitude": 1e3}),
        ),
        *(
            Case(
                "Amplitude and gravity",
                f"amplitude {a:g} m/s2, no gravity",
                "without weight everything is proportional to the amplitude, uplift "
                "included: displacements and contact forces over the amplitude against those of 1 m/s2",
                partial(laws.homogeneous, amplitude=a),
                1e-10,
                "round-off",
            )
            for a in (1e-12, 1e3)
        ),
        Case("Amplitude and gravity", "no gravity", "against the independent model", _dense({"gravity": None})),
        Case(
            "Amplitude and gravity",
            "gravity reversed",
            "the plate hangs on the two top springs of 1 N/m, 392 km up, every contact open: static state against the independent model",
            lambda bench: replace(bench.static_against_dense({"gravity.acceleration": -9.81}), limit=None),
            1e-6,
            "10 x eps x stiffness with contacts closed over that with them open, 5e8 / 2",
        ),
    ]


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
            _dense(_many(500), float),
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


def meshes() -> list[Case]:
    """Return the cases of units and of poor meshes."""
    cases = [
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
    cases += [
        Case("Mesh", "one element", "against the independent model", _dense({"mesh.nx": 1, "mesh.ny": 1, "supports.count": 2}), quick=True),
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
            "Mesh", "slivers 1 m x 1 mm", "a strip 8 mm high of 4 x 8 cells, against the independent model", _dense({"mesh.height": 8e-3})
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
        Case(group, f"{mass:g} kg under each contact", what, _dense({"supports.mass": mass} | DISSIPATIVE), quick=mass == 1e5)
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


def static_cases() -> list[Case]:
    """Return the cases that concern the state before the ground moves."""
    return [
        Case(
            "Start",
            "gap of 5 mm, ten settling steps",
            "the plate has to fall 5 mm before it touches, and ten long steps do not bring it to rest: the "
            "run must warn, and start = 'static' must give the independent model's answer",
            laws.gap,
        ),
    ]
