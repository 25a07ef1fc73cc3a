"""The section [[initial]]: bodies that are thrown, turned, let go and dropped, against their closed forms."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from tests import bouncing
from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.analysis.check import check_scene
from uplift.drivers.scene.cautions import scene_cautions
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene
from uplift.meshes.checked import ModelError

MASS = 10_000.0
FREE = {
    "mesh": {"width": 1.0, "height": 10.0, "nx": 1, "ny": 4},
    "plate": {"young": 1e9, "poisson": 0.0, "density": 1000.0, "thickness": 1.0},
    "kinematics": {"kind": "plane stress"},
    "probes": [{"name": "A", "point": [1.0, 10.0]}, {"name": "B", "point": [0.0, 0.0]}],
    "transient": {"step": 1e-3, "duration": 0.02, "start": "rest"},
    "modal": {"number": 6, "shift": -1.0},
}
METHODS = ("transient", "exact", "modal")


def run(method, *, basis=None, **changes):
    scene = build_scene(FREE | changes, Path())
    request = Request(method, basis=basis)
    request.check(scene)
    with prepare(scene, MPI.COMM_WORLD) as assembly:
        return analyse(assembly, request).final, assembly.operators.contacts.law


def in_steps(**more):
    return {"transient": FREE["transient"] | more}


@pytest.mark.parametrize(
    ("method", "scheme"),
    [*((name, {}) for name in METHODS), ("transient", {"method": "hht"}), ("transient", {"method": "generalised-alpha"})],
)
def test_a_free_body_thrown_upwards_flies_along_a_parabola(method, scheme):
    """Every scheme of second order is exact for it; supports across a gap below are not touched."""
    supports = [{"name": "S", "points": [[0.0, 0.0], [1.0, 0.0]], "stiffness": {"Y": 1e7}, "contact": {"Y": 1e10}, "unilateral": "Y",
                 "gap": 0.05}]
    for held in ({}, {"supports": supports, "springs": [{"name": "W", "points": [[0.0, 10.0], [1.0, 10.0]], "stiffness": {"X": 10.0}}]}):
        history, law = run(method, gravity={"acceleration": 9.81}, initial={"velocity": {"Y": 3.0}}, **in_steps(**scheme), **held)
        height = 3.0 * history.times - 0.5 * 9.81 * history.times**2
        assert history.probes[:, [1, 3]] == pytest.approx(np.stack([height, height], axis=1), rel=1e-6, abs=1e-9)
        assert history.ledger.kinetic[0] == pytest.approx(0.5 * MASS * 3.0**2, rel=1e-9)
    assert history.openings(law) == pytest.approx(0.05 + np.stack([height, height], axis=1), rel=1e-5)


@pytest.mark.ranks
@pytest.mark.parametrize("method", ["transient", "modal"])
def test_a_rigid_spin_keeps_its_rate(method):
    """In the theory of small displacements each point moves on along its tangent; energy m (1 + 100) / 12 omega^2 / 2 about the middle."""
    spin = {"axis": [0.0, 0.0, 2.0], "point": [0.5, 5.0], "rate": 0.01}
    history, _ = run(method, initial=[{"spin": spin}, {"velocity": {"X": 0.2}}])
    moved = np.array([-5.0 * 0.01 + 0.2, 0.5 * 0.01, 5.0 * 0.01 + 0.2, -0.5 * 0.01])
    assert history.probes == pytest.approx(np.outer(history.times, moved), abs=1e-9)
    assert history.ledger.kinetic[0] == pytest.approx(0.5 * MASS * (101 / 12 * 0.01**2 + 0.2**2), rel=1e-9)


COLUMN = {
    "conditions": [{"group": "DBAS", "edge": "clamped"}, {"group": ["DGAU", "DDRO"], "zero": ["DX"]}],
    "plate": FREE["plate"] | {"alpha": 2e-4, "beta": 3.0},
    "modal": {"number": 3},
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("number", [1, 2])
def test_a_mode_that_is_let_go_vibrates_with_its_frequency_and_damping(method, number):
    """Axial modes of a clamped column of 4 linear elements: their discrete frequencies and shapes sin(k y) are known in closed form."""
    h, k = 2.5, (2 * number - 1) * np.pi / 20
    omega = np.sqrt(1e6 * 6 / h**2 * (1 - np.cos(k * h)) / (2 + np.cos(k * h)))
    ratio = 0.5 * (2e-4 * omega + 3.0 / omega)
    history, _ = run(method, initial={"mode": number, "amplitude": -1e-3}, **COLUMN, **in_steps(step=5e-5))
    damped = omega * np.sqrt(1 - ratio**2)
    t = history.times
    expected = np.exp(-ratio * omega * t) * (np.cos(damped * t) + ratio * omega / damped * np.sin(damped * t))
    # The shape is largest at the free end for mode 1 and 2; the average acceleration lags by (omega dt)^2 / 12 a radian.
    off = 1e-8 if method == "exact" else 2 * (omega * 5e-5) ** 2 / 12 * omega * t[-1]
    assert np.abs(history.probes[0, 1]) == pytest.approx(1e-3, rel=1e-9)
    assert history.probes[:, 1] / history.probes[0, 1] == pytest.approx(expected, abs=off)


def bounce(how, **settings):
    """A stiff block of the mass of `bouncing` on two one-sided springs, thrown up from its static position."""
    springs = [{"name": "W", "points": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], "stiffness": {"X": 10.0}}]
    half = bouncing.STIFFNESS / 2
    supports = [{"name": "S", "points": [[0.0, 0.0], [1.0, 0.0]], "stiffness": {"Y": half}, "contact": {"Y": 1e6 * half},
                 "unilateral": "Y"}]
    return run(
        how, mesh={"width": 1.0, "height": 1.0, "nx": 1, "ny": 1}, plate=FREE["plate"] | {"density": bouncing.MASS, "young": 1e8},
        probes=[{"name": "A", "point": [0.0, 0.0]}], supports=supports, springs=springs, gravity={"acceleration": bouncing.GRAVITY},
        initial={"velocity": {"Y": bouncing.START_VELOCITY}}, transient={"step": 5e-4, "duration": 0.8} | settings,
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_body_dropped_on_one_sided_springs_bounces(method):
    """In flight and in contact as in closed form; contacts of 1e6 and a plate of 1e5 times the springs are taken for rigid."""
    history, _ = bounce(method, **({} if method == "exact" else {"method": "generalised-alpha", "rho_infinity": 0.0}))
    expected = bouncing.height(history.times)
    # What is taken for rigid adds 1e-5; a step dt of second order is off by some (omega dt)^2 = 1e-4.
    off = 2e-5 if method == "exact" else 2 * bouncing.STIFFNESS / bouncing.MASS * 5e-4**2
    assert history.probes[:, 1] == pytest.approx(expected, abs=off * np.ptp(expected))
    assert history.ledger.kinetic[0] == pytest.approx(0.5 * bouncing.MASS * bouncing.START_VELOCITY**2, rel=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_contacts_follow_the_displacement(method):
    """Lifted by 1 mm a contact is open by so much; pressed down by 1 mm it pushes with its spring."""
    springs = [{"name": "W", "points": [[0.0, 10.0], [1.0, 10.0]], "stiffness": {"X": 10.0}}]
    supports = [{"name": "S", "points": [[0.0, 0.0], [1.0, 0.0]], "stiffness": {"Y": 1e7}, "contact": {"Y": 1e10}, "unilateral": "Y"}]
    for height, opening, force in ((1e-3, 1e-3, 0.0), (-1e-3, 0.0, 1e4)):
        history, law = run(method, supports=supports, springs=springs, initial={"displacement": {"Y": height}})
        assert history.openings(law)[0] == pytest.approx([opening, opening], rel=2e-3, abs=1e-12)
        compression = law.compression(law.tension(history.elongation), history.release)
        assert compression[0] == pytest.approx([force, force], rel=2e-3, abs=1e-6)


@pytest.mark.parametrize("method", ["transient", "modal"])
def test_heavy_nodes_under_open_contacts_stay_at_rest(method):
    """A body that flies away leaves the node of a joint where it is, without a force on the ground."""
    springs = [{"name": "W", "points": [[0.0, 10.0], [1.0, 10.0]], "stiffness": {"X": 10.0}}]
    supports = [{"name": "S", "points": [[0.0, 0.0], [1.0, 0.0]], "stiffness": {"Y": 1e7}, "contact": {"Y": 1e10}, "unilateral": "Y",
                 "gap": 0.05, "mass": 500.0}]
    history, _ = run(method, supports=supports, springs=springs, initial={"velocity": {"Y": 3.0}, "displacement": {"Y": 0.01}})
    column = history.layout["reactions"].names.index("vertical reaction")
    assert history.probes[:, 1] == pytest.approx(0.01 + 3.0 * history.times, rel=1e-6)
    # 1e-4 of the force 2 sqrt(k m) v that two nodes thrown along would make; the basis of 6 modes is good to 5e-6.
    thrown = 2 * np.sqrt(1e7 * 500.0) * 3.0
    assert history.group("reactions")[:, column] == pytest.approx(np.zeros(len(history.times)), abs=1e-4 * thrown)


def test_a_start_in_motion_counts_as_something_that_acts():
    still, moving = (build_scene(FREE | {"initial": {"velocity": {"Y": speed}}}, Path()) for speed in (0.0, 1.0))
    assert [any("nothing acts" in found.text for found in scene_cautions(scene)) for scene in (still, moving)] == [True, False]


SHELL = {
    "mesh": {"size": 0.5, "plates": [{"corners": [[0, 0, 1], [2, 0, 1], [2, 1, 1], [0, 1, 1]], "name": "P"}]},
    "kinematics": {"kind": "shell"},
    "plate": FREE["plate"] | {"thickness": 0.1},
    "probes": [{"name": "A", "point": [2.0, 1.0, 1.0], "rotations": True}],
}


@pytest.mark.ranks
def test_a_shell_that_is_turned_about_an_axis_turns_its_normals_too():
    """u = theta x (x - p), rotations theta: without strain it stays so."""
    axis, point = np.array([1.0, 2.0, -0.5]), np.array([0.3, -1.0, 0.2])
    theta = 1e-4 * axis / np.linalg.norm(axis)
    turned = {"axis": axis.tolist(), "point": point.tolist(), "angle": 1e-4}
    history, _ = run("transient", initial={"rotation": turned}, **SHELL)
    values = dict(zip(history.layout["probes"].names, history.probes.T, strict=True))
    moved = np.cross(theta, np.array([2.0, 1.0, 1.0]) - point)
    for name, expected in zip(("DX", "DY", "DZ", "DRX", "DRY"), (*moved, *theta), strict=False):
        assert values[f"A.{name}"] == pytest.approx(np.full(len(history.times), expected), abs=1e-10)


@pytest.mark.parametrize("point", [[0.0, 0.0, 1.0], [0.0, 5.0, 1.0]])
def test_the_energy_of_a_plate_that_turns_about_its_edge(point):
    """m L^2 / 3 omega^2 / 2 with 200 kg and 2 m, and the rotary inertia left out; found without a statement of the kinematics."""
    changes = {key: value for key, value in SHELL.items() if key != "kinematics"} | {"kinematics": {}}
    history, _ = run("transient", initial={"spin": {"axis": [0.0, 1.0, 0.0], "point": point, "rate": 0.3}}, **changes)
    assert history.ledger.kinetic[0] == pytest.approx(0.5 * 200.0 * 4.0 / 3.0 * 0.3**2, rel=1e-6)


@pytest.mark.parametrize("group", ["DHAU", ["DHAU"], ["P4", "P3"], ["P4", "DHAU"], "P3"])
def test_only_the_nodes_of_the_group_move(group):
    history, _ = run("transient", initial={"group": group, "displacement": {"X": 1e-3, "Y": -2e-3}})
    assert history.probes[0] == pytest.approx([1e-3, -2e-3, 0.0, 0.0], abs=1e-15)


def said(caplog):
    return [record.finding.text for record in caplog.records if getattr(record, "finding", None) and record.finding.key == "initial state"]


def test_what_a_basis_cannot_hold_is_said(caplog):
    """The basis of one mode misses nothing of mode 1 and all of mode 2."""
    modal = COLUMN | {"modal": {"number": 1, "static_correction": False}}
    run("modal", initial={"mode": 1, "amplitude": 1e-3}, **modal)
    assert not said(caplog)
    run("modal", initial={"mode": 2, "amplitude": 1e-3}, **modal)
    assert said(caplog) == ["the basis misses 100.0% of the energy of the initial conditions"]


def test_published_passes_start_from_the_same_state():
    scene = build_scene(FREE | {"initial": {"velocity": {"Y": 3.0}}}, Path())
    with prepare(scene, MPI.COMM_WORLD) as assembly:
        history = analyse(assembly, Request("transient", passes=2)).final
    assert history.probes[:, 1] == pytest.approx(3.0 * history.times, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("entry", "key", "words"),
    [
        ({}, "initial", "expected one of displacement"),
        ({"group": "DHAU"}, "initial", "expected one of displacement"),
        ({"velocty": {"Y": 1.0}}, "initial.velocty", "did you mean 'velocity'"),
        ({"group": 3, "velocity": {"Y": 1.0}}, "initial.group", "expected a text"),
        ({"group": "roof", "velocity": {"Y": 1.0}}, "initial[1].group", "roof"),
        ({"group": "DBAS", "velocity": {"Y": 1.0}}, "initial[1].group", "moves nothing"),
        ({"displacement": 1.0}, "initial.displacement", "expected a table"),
        ({"displacement": {"RX": 1.0}}, "initial.displacement.RX", "unknown key"),
        ({"displacement": {"X": float("nan")}}, "initial.displacement", "finite"),
        ({"velocity": {"Y": float("inf")}}, "initial.velocity", "finite"),
        ({"velocity": {"Z": 1.0}}, "kinematics.kind", "does not move along Z"),
        ({"rotation": {"axis": [0, 0, 0], "point": [0, 0], "angle": 1.0}}, "initial.rotation.axis", "not zero"),
        ({"rotation": {"axis": [0, 0, 1], "angle": 1.0}}, "initial.rotation.point", "missing"),
        ({"rotation": {"axis": [0, 0, 1], "point": [0, 0], "rate": 1.0}}, "initial.rotation.angle", "missing"),
        ({"spin": {"axis": [0, 0, 1], "point": [0, 0], "rate": float("inf")}}, "initial.spin.rate", "finite"),
        ({"spin": {"axis": [1, 0, 0], "point": [0, 0], "rate": 1.0}}, "kinematics.kind", "does not move along Z"),
        ({"mode": 1}, "initial.amplitude", "missing"),
        ({"amplitude": 1.0}, "initial.mode", "missing"),
        ({"mode": 0, "amplitude": 1.0}, "initial.mode", "expected >= 1"),
        ({"mode": 1, "amplitude": float("nan")}, "initial.amplitude", "finite"),
        ({"mode": 500, "amplitude": 1.0}, "initial.mode", "<= 8, the dofs"),
        ({"mode": 1, "amplitude": 1.0, "group": "DHAU"}, "initial.group", "whole plate"),
    ],
)
def test_bad_entries_are_refused(entry, key, words):
    with pytest.raises(ModelError) as error:
        run("transient", initial=entry, **COLUMN)
    assert error.value.key == key and words in error.value.message
    with pytest.raises(ModelError) as checked:
        check_scene(build_scene(FREE | COLUMN | {"initial": entry}, Path()), MPI.COMM_WORLD, mesh=True)
    assert str(checked.value) == str(error.value)


def test_modes_of_a_free_plate_need_a_shift():
    with pytest.raises(ModelError, match="set \\[modal\\] shift below 0"):
        run("transient", initial={"mode": 4, "amplitude": 1e-3}, modal={"number": 6})


@pytest.mark.parametrize(
    ("method", "passes", "words"),
    [("static", None, "has no initial conditions"), ("harmonic", None, "has no initial conditions"),
     ("time-frequency", None, "starts from a state of rest"), ("time-frequency", 2, "is periodic")],
)
def test_methods_without_a_start_refuse_them(method, passes, words):
    more = {"harmonic": {"frequencies": [1.0]}, "fourier": {"length": 2.0, "samples": 64, "cutoff": 4.0}}
    scene = build_scene(FREE | more | {"initial": {"velocity": {"Y": 1.0}}}, Path())
    with pytest.raises(ModelError, match=words):
        Request(method, passes=passes).check(scene)
    Request(method, passes=passes).check(scene.with_("initial.velocity.Y", 0.0))


@pytest.mark.parametrize("method", METHODS)
def test_settling_steps_refuse_them(method):
    scene = build_scene(FREE | {"initial": {"velocity": {"Y": 1.0}}} | in_steps(start="settled"), Path())
    with pytest.raises(ModelError, match="'rest' or 'static'"):
        Request(method).check(scene)


def test_a_body_that_is_free_in_one_direction_keeps_its_elastic_modes_in_the_exact_march():
    """Within twice what halving the step changes in the march in steps: where elastic modes are static it is off by half of the peak."""
    supports = [{"name": "S", "points": [[0.0, 0.0], [1.0, 0.0]], "stiffness": {"Y": 1e9}, "contact": {"Y": 1e12}, "unilateral": "Y"}]
    load = [{"direction": "Y", "signal": "ricker", "amplitude": 4.0, "frequency": 10.0, "center": 0.1}]
    exact, coarse, fine = (
        run(method, gravity={"acceleration": 9.81}, supports=supports, load=load, **in_steps(step=step, duration=0.4, every=n))[0].probes
        for method, step, n in (("exact", 1e-3, 1), ("transient", 2e-4, 5), ("transient", 1e-4, 10))
    )
    assert np.max(np.abs(exact - fine)) < 2 * np.max(np.abs(fine - coarse)) < 0.02 * np.max(np.abs(fine))
