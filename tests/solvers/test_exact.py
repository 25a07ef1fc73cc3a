"""The march from event to event against closed forms and an explicit Runge-Kutta method of order 8."""

import tomllib

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests import bouncing
from tests.conftest import SCENES
from tests.small import contact_on, dense_operators
from tests.solvers import bar
from tests.solvers.runge_kutta import runge_kutta
from uplift.drivers.scene.scene import build_scene
from uplift.forms.loads.signals import Sine, Step, Table
from uplift.meshes.checked import ModelError
from uplift.solvers.bases.krylov import krylov_basis
from uplift.solvers.bases.project import project
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.time_domain.exact.model import dense_model
from uplift.solvers.time_domain.exact.solution import solve
from uplift.solvers.time_domain.exact.starts import Start, rest_start, static_start

LOAD = "load.amplitude"
UNDAMPED = {"plate.alpha": 0.0, "plate.beta": 0.0}


def sdls119_scene(changes=()):
    """SDLS119 with massless joints, the trough of its pulse at 0.1 s and entries changed, "table.key" to value."""
    scene = tomllib.loads((SCENES / "sdls119a.toml").read_text())
    scene["load"].update(center=0.1, start=0.0)
    scene["supports"][0]["mass"] = 0.0
    for name, value in dict(changes).items():
        *tables, key = name.split(".")
        place = scene
        for table in tables:
            place = place[table][0] if isinstance(place[table], list) else place[table]
        place[key] = value
    return build_scene(scene, SCENES)


def sdls119_model(comm, changes=()):
    from uplift.drivers.analysis.assembled_scene import prepare

    with prepare(sdls119_scene(changes), comm) as assembly:
        return dense_model(assembly.operators)


def knots_of(model):
    return np.concatenate([history.times for history in model.histories if isinstance(history, Table)] or [np.zeros(0)])


@pytest.mark.parametrize(
    ("changes", "duration"),
    [
        ({}, 0.4),
        ({LOAD: 1.0}, 0.25),
        ({LOAD: 4.0}, 0.25),
        ({LOAD: 8.0}, 0.25),
        ({"supports.stiffness.Y": 1e6}, 0.25),
        ({"supports.stiffness.Y": 1e7, LOAD: 4.0}, 0.3),
        ({"supports.stiffness.Y": 1e10, LOAD: 4.0}, 0.2),
        ({"supports.stiffness.Y": 1e12, LOAD: 4.0}, 0.08),
        ({LOAD: 4.0, **UNDAMPED}, 0.3),
        ({LOAD: 3.0, "supports.gap": 1e-3}, 0.3),
        # The same viscosity: damping in proportion to a stiffness a thousand times as large is out of reach of an explicit method.
        ({"plate.young": 1.4e11, "plate.alpha": 5e-6, LOAD: 8.0}, 0.12),
        ({"load": {"direction": "Y", "signal": "sine", "amplitude": 12.0, "frequency": 2.0}}, 0.6),
    ],
)
def test_sdls119_follows_a_runge_kutta_method(comm, changes, duration):
    """P3 to 1e-9 and contact forces to 1e-8 of their largest values; static condensation itself is good to 1e-9 (see `first_order`)."""
    model = sdls119_model(comm, changes)
    start = static_start(model)
    instants = np.linspace(0.0, duration, 26)
    here = solve(model, instants, start, peaks=False)
    outputs, force = runge_kutta(model, instants, start, knots_of(model))
    assert here.error == 0.0
    assert np.abs(here.outputs - outputs)[:, :2].max() < 1e-9 * np.abs(outputs[:, :2]).max()
    assert np.abs(here.force - force).max() < 1e-8 * np.abs(force).max()
    opens = force.min() == 0
    assert opens == (len(here.events) > 0)


def bouncing_model():
    with bouncing.operators() as operators:
        return dense_model(operators)


def test_bouncing_mass_follows_its_closed_form_to_round_off():
    model = bouncing_model()
    start = static_start(model)
    start.velocity[:] = bouncing.START_VELOCITY
    times = np.linspace(0.0, 4.0, 101)
    here = solve(model, times, start, energy=True)
    height = bouncing.height(times)
    # Round-off of one bounce turns into phase at the next, and the record's 4 s are 80 rad: 80 * 2e-16 for each of some dozen bounces.
    assert np.abs(here.outputs[:, 0] - height).max() < 1e-12 * np.abs(height).max()
    # The apex of the flight lies between instants.
    omega, sag = np.sqrt(bouncing.STIFFNESS / bouncing.MASS), bouncing.MASS * bouncing.GRAVITY / bouncing.STIFFNESS
    lift_off = np.sqrt(bouncing.START_VELOCITY**2 - (omega * sag) ** 2)
    assert here.peak_values[0, 0] == pytest.approx(lift_off**2 / (2 * bouncing.GRAVITY), rel=1e-12)
    assert here.peak_values[1, 0] == pytest.approx(-sag - bouncing.START_VELOCITY / omega, rel=1e-12)
    opening = here.events[0]
    assert opening.opens and opening.speed == pytest.approx(lift_off, rel=1e-12)
    assert not here.events[1].opens and here.events[1].speed == pytest.approx(-lift_off, rel=1e-12)
    assert here.events[1].time - opening.time == pytest.approx(2 * lift_off / bouncing.GRAVITY, rel=1e-12)
    energy = here.ledger.kinetic + here.ledger.springs + bouncing.MASS * bouncing.GRAVITY * height
    assert np.ptp(energy) < 1e-12 * np.abs(energy).max()
    assert np.abs(here.ledger.numerical).max() < 1e-12 * here.ledger.kinetic.max()


def test_bar_on_a_stop_keeps_its_energy():
    """Contact time, plateau of the force and rebound of the closed form; no impact takes or gives energy."""
    model, start = bar.bar_on_a_stop(150)
    there_and_back = 2 * bar.LENGTH / bar.WAVE_SPEED
    times = np.linspace(0.0, 1.5 * there_and_back, 301)
    here = solve(model, times, start, peaks=False, energy=True)
    ledger = here.ledger
    energy = ledger.kinetic + ledger.strain + ledger.springs
    assert np.abs(energy - energy[0]).max() < 1e-9 * energy[0]
    assert [event.opens for event in here.events][:1] == [True]
    assert here.events[0].time == pytest.approx(bar.contact_time(), rel=1e-3)
    plateau = (times > 0.5 * there_and_back) & (times < 0.95 * there_and_back)
    assert here.force[plateau, 0].mean() == pytest.approx(bar.IMPEDANCE * bar.SPEED, rel=1e-3)
    free = times > here.events[0].time
    speed = np.polyfit(times[free], here.outputs[free, 0], 1)[0]
    assert speed == pytest.approx(bar.rebound_speed(), rel=1e-3)


def test_energy_of_a_damped_plate_that_lifts(comm):
    """Work and dissipation are integrated by themselves: what is stored and dissipated is what the loads did."""
    model = sdls119_model(comm, {LOAD: 4.0})
    ledger = solve(model, np.linspace(0.0, 0.4, 9), static_start(model), peaks=False, energy=True).ledger
    assert ledger.damped[-1] > 0.01 * ledger.work.max()
    # Round-off of the strain energy under gravity, whose part in the plate is hundreds of times the work.
    assert np.abs(ledger.numerical).max() < 1e-9 * ledger.work.max()


def test_extremes_between_instants_are_those_of_a_fine_archive(comm):
    model = sdls119_model(comm, {LOAD: 4.0})
    start = static_start(model)
    coarse = solve(model, np.linspace(0.0, 0.4, 9), start)
    fine = solve(model, np.linspace(0.0, 0.4, 2001), start, peaks=False)
    whole = np.concatenate([fine.outputs, fine.force, fine.gap], axis=1)
    curvature = np.abs(np.diff(whole, 2, axis=0)).max(axis=0)
    # The largest value of a fine archive is short of the true one by an eighth of its second difference at most.
    assert np.all(coarse.peak_values[0] >= whole.max(axis=0) - 1e-9 * np.ptp(whole, axis=0))
    assert np.all(coarse.peak_values[0] <= whole.max(axis=0) + curvature / 4)
    assert np.all(coarse.peak_values[1] <= whole.min(axis=0) + 1e-9 * np.ptp(whole, axis=0))
    assert np.all(coarse.peak_values[1] >= whole.min(axis=0) - curvature / 4)


def test_massless_dof_on_a_damper_is_a_state_of_first_order():
    """A mass m hangs on a spring that ends on a damper (Maxwell's body), whose free end has no mass."""
    k, c, m = 40.0, 3.0, 2.0
    stiffness, damping = np.array([[k, -k], [-k, k + 5.0]]), np.diag([0.0, c])
    with dense_operators(stiffness, np.diag([m, 0.0]), damping, [(np.array([7.0, 0.0]), Sine(frequency=0.8), False)]) as operators:
        model = dense_model(operators)
    times = np.linspace(0.0, 3.0, 31)
    here = solve(model, times, rest_start(model)).outputs

    def rate(t, y):
        u, v, w = y
        return [v, (7.0 * np.sin(2 * np.pi * 0.8 * t) - k * (u - w)) / m, (k * (u - w) - 5.0 * w) / c]

    there = solve_ivp(rate, (0.0, 3.0), np.zeros(3), method="DOP853", t_eval=times, rtol=1e-12, atol=1e-14).y
    assert np.abs(here[:, 0] - there[0]).max() < 1e-9 * np.abs(there[0]).max()
    assert np.abs(here[:, 1] - there[2]).max() < 1e-9 * np.abs(there[2]).max()


def test_joints_with_mass_are_refused(comm):
    with pytest.raises(ModelError, match="mass = 0"):
        sdls119_model(comm, {"supports.mass": 0.1})


def test_start_in_flight():
    """A mass that is let fall from rest above its spring: ballistic until it lands, with the speed of free fall."""
    with dense_operators([[bouncing.STIFFNESS]], [[bouncing.MASS]], None, [
        (np.array([-bouncing.MASS * bouncing.GRAVITY]), Sine(frequency=1e-9, phase=np.pi / 2), False)
    ], contacts=contact_on(0, bouncing.STIFFNESS, 1)) as operators:
        model = dense_model(operators)
    drop = 0.3
    start = Start(np.array([drop]), np.zeros(1), np.array([bouncing.STIFFNESS * drop]))
    here = solve(model, np.linspace(0.0, 0.4, 5), start)
    landing = here.events[0]
    assert not landing.opens and landing.time == pytest.approx(np.sqrt(2 * drop / bouncing.GRAVITY), rel=1e-12)
    assert landing.speed == pytest.approx(-np.sqrt(2 * drop * bouncing.GRAVITY), rel=1e-12)


def test_jump_of_a_load_between_instants_is_met_where_it_is():
    """An oscillator under a force that begins off all instants, in closed form."""
    k, m, begin = 50.0, 2.0, 0.123456789
    with dense_operators([[k]], [[m]], None, [(np.array([3.0]), Step(amplitude=2.0, start=begin), False)]) as operators:
        model = dense_model(operators)
    times = np.linspace(0.0, 2.0, 21)
    here = solve(model, times, rest_start(model))
    since, omega = np.maximum(times - begin, 0.0), np.sqrt(k / m)
    assert here.outputs[:, 0] == pytest.approx(6.0 / k * (1 - np.cos(omega * since)), abs=1e-13 * 12.0 / k)
    assert here.accelerations[5:, 0] == pytest.approx(6.0 / m * np.cos(omega * since[5:]), abs=1e-12 * 6.0 / m)
    assert here.peak_values[0, 0] == pytest.approx(12.0 / k, rel=1e-13)


def test_archived_instants_do_not_change_the_answer(comm):
    """Other intervals mean other propagators, samples and halves: the same events, to round-off."""
    model = sdls119_model(comm, {LOAD: 4.0})
    start = static_start(model)
    coarse, fine = (solve(model, np.linspace(0.0, 0.6, n), start, peaks=False) for n in (31, 121))
    assert [(e.contact, e.opens) for e in coarse.events] == [(e.contact, e.opens) for e in fine.events]
    # Both are good to the 1e-11 or better that the Runge-Kutta method confirms: events, forces and displacements agree as well.
    assert [e.time for e in coarse.events] == pytest.approx([e.time for e in fine.events], abs=1e-12)
    assert np.abs(coarse.outputs - fine.outputs[::4]).max() < 1e-11 * np.abs(fine.outputs).max()
    assert np.abs(coarse.force - fine.force[::4]).max() < 1e-10 * np.abs(fine.force).max()


def test_march_in_a_basis_has_the_error_of_the_basis_alone(comm):
    """A Krylov basis that is exact to 1e-9 at its test frequencies keeps P3 to 1e-7; Newmark's at 5 ms is 5e-3."""
    from uplift.drivers.analysis.assembled_scene import prepare

    scene = sdls119_scene({LOAD: 4.0})
    times = np.linspace(0.0, 0.6, 31)
    with prepare(scene, comm) as assembly:
        whole = dense_model(assembly.operators)
        basis = krylov_basis(assembly.operators, KrylovSettings(tolerance=1e-9))
        with project(assembly.operators, basis) as reduced:
            small = dense_model(reduced)
    assert len(small.mass) < len(whole.mass)
    there, here = (solve(model, times, static_start(model), peaks=False) for model in (whole, small))
    assert len(here.events) == len(there.events) > 0
    assert np.abs(here.outputs - there.outputs)[:, :2].max() < 1e-7 * np.abs(there.outputs[:, :2]).max()
