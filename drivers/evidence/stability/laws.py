"""What the cases of the stability table measure apart from the independent model: closed forms, invariants and laws of scaling."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.linalg

from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.evidence.stability.bench import Bench, Finding, condition, contact_forces, relative, warnings
from uplift.drivers.evidence.stability.oracle import EXTENDED, DensePlate
from uplift.drivers.scene.paths import varied
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene
from uplift.forms.operators import Operators
from uplift.solvers.linear import DirectSolver
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark

SUDDEN = {"load.start": 0.0, "load.center": 0.0, "load.table_step": None, "load.table_digits": None}
"""The pulse begins at time 0 with its trough."""

SPAN, HARD = 10.0, ("DBAS", "DDRO", "DHAU", "DGAU")
"""Side in m of the square plate that is bent, and its edges."""

MANY = 100_000
"""Steps of the case of drift."""


def chatter(bench: Bench, stiffness: float) -> Finding:
    """Return how far the law of contact is broken at any step, for supports on which average acceleration chatters."""
    with bench.assembly({"supports.stiffness.Y": stiffness}) as assembly:
        stepped = analyse(assembly, Request("transient")).final
        swept = analyse(assembly, Request("time-frequency")).final
        forces = contact_forces(assembly, stepped)
        scene = bench.scene({"supports.stiffness.Y": stiffness}, true=True)
        openings = stepped.release * np.array([s.flexibility(1) for s in scene.model.supports for _ in s.points])
    largest = np.max(forces)
    # An opening of a micrometre counts in full against a force, one of 1e-12 m not at all.
    across = np.minimum(np.abs(forces), largest * openings / 1e-6)
    apart = relative(stepped.probes - stepped.probes[0], swept.probes - swept.probes[0])
    figure = max(np.max(-forces, initial=0.0), np.max(across)) / largest
    limit = 100 * np.finfo(float).eps * np.max(stepped.release) / largest
    note = f"histories by time stepping and by the Laplace sweep are less than 1e{np.ceil(np.log10(apart)):.0f} apart"
    return Finding(float(figure), note, limit=max(float(limit), 1e-11))


def thin(bench: Bench, ratio: float) -> Finding:
    """Compare a plate of another thickness on supports in proportion with the plate as it is."""
    t = 8.0 * ratio
    scaled = {
        "plate.thickness": t,
        "springs.stiffness.Y": lambda k: t * k,
        "supports.stiffness": lambda k: {a: t * v for a, v in k.items()},
        "supports.contact": lambda k: {a: t * v for a, v in k.items()},
    }
    here, there = bench.run(scaled), Bench(bench.table, bench.folder, bench.comm).run({})
    return Finding(max(relative(here.history.probes, there.history.probes), relative(here.forces, t * there.forces)))


def energy(bench: Bench) -> Finding:
    """Return what is left of the ledger of energies of an undamped linear run."""
    changes = {"plate.alpha": 0.0, "plate.beta": 0.0, "load.amplitude": 0.1, "transient.duration": 20.0}
    with bench.assembly(changes) as assembly:
        history = analyse(assembly, Request("transient")).final
    assert history.ledger is not None
    rest = np.max(np.abs(history.ledger.numerical)) / np.max(history.ledger.kinetic)
    return Finding(float(rest), sound=not history.release.any())


def drift(bench: Bench) -> Finding:
    """Compare 100,000 steps of free vibration with the angles by which average acceleration turns the modes."""
    number, rate = MANY, 5.0
    changes = {"plate.alpha": 0.0, "plate.beta": 0.0, "supports.stiffness.X": 1e9, "supports.contact": {"X": 1e12, "Y": 1e12}}
    scene = bench.scene(changes)
    assert scene.transient is not None
    step = scene.transient.step
    with prepare(scene, bench.comm) as assembly:
        free = replace(assembly.operators, loads=[])
        with static_state(assembly.operators) as start, Newmark(free, scene.transient.scheme, step) as method:
            start.velocity.array[:] = rate * start.displacement.array_r
            history = transient(method, start, number, every=number // 100)
    model = DensePlate(bench.scene(changes, true=True))
    stiffness = model.stiffness + model.opens.T @ (model.opens / model.flexibility[:, None])
    begin, _ = model.static()
    _, vectors = scipy.linalg.eigh(stiffness.astype(float), model.mass.astype(float))
    vectors = vectors.astype(EXTENDED)
    # One step of refinement: quotients of vectors good to 1e-12 are good to 1e-24.
    squared = np.einsum("ij,ij->j", vectors, stiffness @ vectors) / np.einsum("ij,ij->j", vectors, model.mass @ vectors)
    share = np.linalg.solve(vectors.astype(float), begin.astype(float)).astype(EXTENDED)
    omega = np.sqrt(squared)
    angle = np.outer(np.arange(0, number + 1, number // 100), 2 * np.arctan(omega * EXTENDED(step) / 2))
    there = ((np.cos(angle) + rate / omega * np.sin(angle)) * share) @ vectors[model.probed].T
    return Finding(relative(history.probes, there), f"last instant {history.times[-1]:g} s")


def still(bench: Bench) -> Finding:
    """Return how far the plate moves from its static state without any motion of the ground."""
    probes = bench.run({"load.amplitude": 0.0}).history.probes
    return Finding(float(np.max(np.abs(probes - probes[0])) / np.max(np.abs(probes[0]))))


def homogeneous(bench: Bench, amplitude: float) -> Finding:
    """Compare a run without gravity at some amplitude with that at 1 m/s2."""
    common = {"gravity": None, "load.table_step": None, "load.table_digits": None}
    one = Bench(bench.table, bench.folder, bench.comm).run(common | {"load.amplitude": 1.0})
    here = bench.run(common | {"load.amplitude": amplitude})
    opened = bool(one.history.release.any())
    parts = relative(here.history.probes / amplitude, one.history.probes), relative(here.forces / amplitude, one.forces)
    return Finding(max(parts), sound=opened)


def falling(bench: Bench, changes: dict[str, Any]) -> Finding:
    """Compare the flight of a free plate with free fall and with the ground's motion, integrated by the same rule."""
    with bench.assembly(changes) as assembly:
        history = analyse(assembly, Request("transient")).final
    down = -0.5 * 9.81 * history.times**2
    # Average acceleration of u'' = -a(t): the trapezoidal rule twice.
    scene = bench.scene(changes, true=True)
    pushed = -scene.model.motions[0].signal(history.times)
    step = history.times[1]
    velocity = np.concatenate([[0.0], np.cumsum(0.5 * step * (pushed[1:] + pushed[:-1]))])
    there = np.concatenate([[0.0], np.cumsum(step * velocity[:-1] + 0.25 * step**2 * (pushed[1:] + pushed[:-1]))])
    return Finding(relative(history.probes, np.column_stack([there, down])))


def bent(bench: Bench, ratio: float) -> Finding:
    """Compare the first frequency of a simply supported square plate of this thickness over span with Mindlin's plate, by its sines."""
    plate = {"young": 2.1e11, "poisson": 0.3, "density": 7850.0, "thickness": ratio * SPAN}
    scene = {
        "mesh": {"width": SPAN, "height": SPAN, "nx": 8, "ny": 8},
        "kinematics": {"kind": "bending", "rotary_inertia": True},
        "plate": plate,
        "conditions": [{"group": edge, "edge": "hard"} for edge in HARD],
        "probes": [{"name": "MIDDLE", "point": [SPAN / 2, SPAN / 2]}],
        "transient": {"step": 0.01, "duration": 1.0},
    }
    with prepare(build_scene(varied(scene, bench.fault), bench.folder), bench.comm) as assembly:
        here = first_frequency(assembly.operators)
        scaled = condition(assembly.operators.stiffness, scaled=True)
    there = mindlin(**plate)
    kirchhoff = math.pi * math.sqrt(plate["young"] * plate["thickness"] ** 2 / (12 * 0.91 * plate["density"])) / SPAN**2
    note = f"{here:.6g} Hz, thin-plate theory {kirchhoff:.6g} Hz; scaled condition of the stiffness 1e{math.log10(scaled):.0f}"
    return Finding(abs(here / there - 1), note)


def first_frequency(operators: Operators) -> float:
    """Return the first frequency in Hz by inverse iteration, whose digits are those of static solutions."""
    x, y, z = (operators.new_vector() for _ in range(3))
    x.set(1.0)
    squared = 0.0
    with DirectSolver(operators.stiffness, "inverse_", definite=True, what="inverse iteration") as solver:
        for _ in range(20):
            operators.mass.mult(x, z)
            solver.solve(z, y, check=True)
            reached = z.dot(y)
            operators.mass.mult(y, z)
            size = z.dot(y)
            squared = abs(reached / size)
            y.scale(1 / abs(size) ** 0.5)
            y.copy(x)
    for vector in (x, y, z):
        vector.destroy()
    return math.sqrt(squared) / (2 * math.pi)


def mindlin(young: float, poisson: float, density: float, thickness: float) -> float:
    """Return the first frequency in Hz of the hard simply supported square Mindlin plate with rotary inertia, shear correction 5/6.

    The deflection goes with sin(k x) sin(k y), k = pi / span, the rotations with their derivatives: three equations for three amplitudes,
    symmetric in X and Y, so that two are left for the first frequency. They are solved in units in which the bending stiffness is one.
    """
    k = math.pi / SPAN
    stiff = young * thickness**3 / (12 * (1 - poisson**2))
    shear = 5 / 6 * young * thickness / (2 * (1 + poisson))
    # Rotations phi and deflection w with omega^2 = x: (D 2 k^2 + S - I x) phi = S w, (2 k^2 S - m x) w = 2 k^2 S phi, phi times k.
    inertia, mass = density * thickness**3 / 12, density * thickness
    a, b, c = inertia * mass, -(mass * (2 * k**2 * stiff + shear) + 2 * k**2 * shear * inertia), 4 * k**4 * stiff * shear
    # The smaller root, in the form that subtracts no equal numbers.
    return math.sqrt(2 * c / (-b + math.sqrt(b * b - 4 * a * c))) / (2 * math.pi)


def in_units(bench: Bench, length: float, mass: float, second: float) -> Finding:
    """Compare a scene written in other units; `length`, `mass`, `second` are what a metre, a kilogram and a second are in them."""
    per_metre = mass / second**2  # of a stiffness in N/m
    acceleration = length / second**2

    def times(factor: float) -> Callable[[float], float]:
        return lambda value: factor * value

    def stiffness(old: dict[str, float]) -> dict[str, float]:
        return {axis: per_metre * value for axis, value in old.items()}

    smooth = {"load.table_step": None, "load.table_digits": None, "fourier": None}
    changes: dict[str, Any] = smooth | {
        "mesh.width": times(length),
        "mesh.height": times(length),
        "plate.young": times(per_metre / length),
        "plate.density": times(mass / length**3),
        "plate.thickness": times(length),
        "plate.alpha": times(second),
        "plate.beta": times(1 / second),
        "gravity.acceleration": times(acceleration),
        "load.amplitude": times(acceleration),
        "load.frequency": times(1 / second),
        "load.center": times(second),
        "load.start": times(second),
        "supports.stiffness": stiffness,
        "supports.contact": stiffness,
        "springs.stiffness": stiffness,
        "transient.step": times(second),
        "transient.duration": times(second),
    }
    here, there = bench.run(changes), Bench(bench.table, bench.folder, bench.comm).run(smooth)
    force = mass * acceleration
    return Finding(
        max(relative(here.history.probes / length, there.history.probes), relative(here.forces / force, there.forces)), here.conditions
    )


def oscillator(bench: Bench, ratio: float = 0.05) -> Finding:
    """Compare a rigid plate on two bonded springs with the closed form of an oscillator of this damping ratio."""
    stiffness, mass, gravity = 2 * 1e5, 4.0 * 8.0 * 2500.0, 9.81
    omega = np.sqrt(stiffness / mass)
    changes = SUDDEN | {
        "mesh.nx": 1,
        "mesh.ny": 1,
        "plate.young": 2.1e11,
        "plate.poisson": 0.0,
        "plate.alpha": 0.0,
        "plate.beta": 2 * ratio * omega,
        "springs": None,
        "load.amplitude": 0.0,
        "supports.count": 2,
        "supports.stiffness.Y": 1e5,
        "supports.unilateral": "",
        "transient.start": "rest",
        "transient.duration": 20.0,
    }
    with bench.assembly(changes) as assembly:
        history = analyse(assembly, Request("transient")).final
    # Complex roots serve below and above critical damping.
    root = np.emath.sqrt(ratio**2 - 1)
    fast, slow = -omega * (ratio + root), -omega * (ratio - root)
    shape = (slow * np.exp(fast * history.times) - fast * np.exp(slow * history.times)) / (slow - fast)
    there = -mass * gravity / stiffness * np.real(1 - shape)
    return Finding(relative(history.probes[:, 1], there))


def light(bench: Bench) -> Finding:
    """Compare joints of 0.1 kg with joints without mass."""
    there, here = bench.dense({}), bench.run({"supports.mass": 0.1})
    return Finding(relative(here.history.probes - here.history.probes[0], there.probes - there.probes[0]), here.conditions)


def gap(bench: Bench) -> Finding:
    """See that a start that has not settled is warned of, and compare the static start with the independent model."""
    changes = {"supports.gap": 0.005}
    with bench.assembly(changes | {"transient.start": "settled", "supports.mass": 0.1}) as assembly, warnings() as heard:
        analyse(assembly, Request("transient"))
    finding = bench.against_dense(changes)
    return replace(finding, note=f"warned: {heard[0] if heard else 'no'}", sound=any("state of rest" in text for text in heard))
