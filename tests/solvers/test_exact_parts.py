"""Parts of the exact time integration: polynomials of signals, propagators, collocation, the choice between the two."""

import numpy as np
import pytest
from scipy import linalg

from tests.small import dense_operators
from uplift.forms.contact.law import UpliftLaw
from uplift.forms.loads.signals import Constant, Noise, Ricker, Sine, Step, Sweep, Table
from uplift.solvers.errors import SolverError
from uplift.solvers.time_domain.exact.choice import choose, contact_frequency
from uplift.solvers.time_domain.exact.first_order import first_order
from uplift.solvers.time_domain.exact.forcing import TOLERANCE, forcing
from uplift.solvers.time_domain.exact.model import DenseModel, dense_model
from uplift.solvers.time_domain.exact.propagators import doubled, halvings
from uplift.solvers.time_domain.exact.solution import by_collocation, differences, from_events, solve
from uplift.solvers.time_domain.exact.starts import rest_start, static_start
from uplift.solvers.time_domain.exact.step_response import moments


@pytest.mark.parametrize(
    "signal",
    [
        Ricker(2.0, 1.0, 1.2, 0.437),
        Sine(amplitude=3.0, frequency=2.0, phase=0.3, start=0.111, end=1.577),
        Step(amplitude=2.0, start=0.333),
        Step(amplitude=2.0, start=0.333, rise=0.2),
        Sweep(first=1.0, last=8.0, start=0.05, end=1.9, taper=0.2, spacing="logarithmic"),
        Noise(seed=3, high=12.0, start=0.1, end=1.8, rise=0.3, decay=0.2),
        Table(np.array([0.05, 0.4, 0.9, 1.7]), np.array([1.0, -2.0, 0.5, 3.0])),
    ],
)
def test_polynomials_are_as_near_to_a_signal_as_stated(signal):
    """At random times, and on both sides of its jumps, which are edges of intervals."""
    instants = np.linspace(0.0, 2.0, 41)
    loads = forcing((Constant(4.0), signal), instants)
    assert set(instants) <= set(loads.edges)
    times = np.sort(np.random.default_rng(1).uniform(0.0, 2.0, 5000))
    interval = np.searchsorted(loads.edges, times, side="right") - 1
    local = (times - loads.edges[interval]) / loads.unit
    values = np.sum(loads.coefficients[interval, 0] * local[:, None] ** np.arange(loads.degree + 1), axis=1)
    exact = signal(times)
    assert np.abs(values - exact).max() < 2 * TOLERANCE * np.abs(exact).max()
    assert loads.constant.tolist() == [4.0, 0.0]


def test_signal_of_unknown_knots_is_refused():
    with pytest.raises(SolverError, match="knots"):
        forcing((lambda times: times,), np.linspace(0.0, 1.0, 3))


def test_halves_of_an_exponential():
    """Against scipy's exponential, for a free, a stiff damped and an oscillating part together."""
    generator = linalg.block_diag([[0.0, 1.0], [0.0, 0.0]], [[-300.0]], [[0.0, 40.0], [-40.0, -1.0]])
    levels = halvings(generator, 0.3)
    steps = doubled(generator, 0.3, levels)
    for level in (0, 1, levels):
        expected = linalg.expm(generator * 0.3 / 2**level) - np.eye(5)
        # Round-off grows with the angle that is gone through, 12 rad.
        assert np.abs(steps[level] - expected).max() < 1e-13


def test_moments_of_a_polynomial_force():
    """A free mass under a force s^k / T^k moves by T^2 k! / (k + 2)!, and its velocity by T / (k + 1)."""
    time, generator, push = 0.7, np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    _, psi = moments(generator, push, time, 3)
    for k in range(4):
        assert psi[k, :, 0] == pytest.approx([time**2 / ((k + 1) * (k + 2)), time / (k + 1)], rel=1e-13)


def chain(pull, n_c=3):
    """Masses in a row on one-sided springs, shaken; with a large `pull` all contacts stay open."""
    n = n_c
    between = 900.0 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    contact = np.full(n, 1500.0)
    mass = np.diag(np.linspace(1.0, 2.0, n))
    return DenseModel(
        mass=mass, damping=0.002 * between + 0.3 * mass, stiffness=between + np.diag(contact),
        loads=np.stack([-9.81 * np.diag(mass) + pull, np.linspace(40.0, 70.0, n)], axis=1),
        histories=(Constant(1.0), Sine(frequency=1.7, phase=0.4)), static=(True, False), internal=(False, False),
        push=np.eye(n), elongation=np.eye(n), law=UpliftLaw(contact, 1 / contact), names=tuple("abcdefghijklmnopqrstuvwxyz"[:n]),
        outputs=np.eye(n), output_release=np.zeros((n, n)), output_constant=np.zeros(n), output_names=tuple(f"u{i}" for i in range(n)),
        output_units=("m",) * n, springs=np.zeros((n, n)), unilateral=np.diag(contact),
    )


def slope(model, order, steps):
    """Least-squares slope of the collocation's error over `steps`, from a start with velocity, against the march from event to event."""
    instants = np.linspace(0.0, 0.96, 13)
    start = static_start(model)
    start.velocity[:] = 0.3
    system, loads = first_order(model), forcing(model.histories, instants)
    exact = from_events(model, system, loads, instants, start, peaks=False)
    errors = [
        differences(model, exact, here.outputs, here.force).relative
        for here in (by_collocation(model, system, loads, instants, start, order=order, step=step) for step in steps)
    ]
    return np.polyfit(np.log(steps), np.log(errors), 1)[0], exact, errors


@pytest.mark.parametrize(("order", "expected"), [(2, 4), (3, 6)])
def test_order_of_the_collocation_while_no_contact_changes(order, expected):
    found, exact, errors = slope(chain(pull=400.0), order, 0.08 / np.array([4, 8, 16]))
    assert not exact.events and np.all(exact.release > 0)
    assert expected - 0.3 < found < expected + 0.5
    assert errors[-1] > 1e-13  # above round-off


@pytest.mark.parametrize("order", [2, 3])
def test_order_of_the_collocation_with_kinks(order):
    """The polynomial of degree p that stands for a tension whose third derivative jumps is the limit: order 3 or better."""
    found, exact, errors = slope(chain(pull=0.0), order, 0.08 / np.array([8, 16, 32, 64]))
    assert len(exact.events) >= 10
    assert 2.7 < found < 5.0


def test_contact_frequency_of_a_mass_on_a_spring():
    with dense_operators([[800.0]], [[2.0]]) as operators:
        assert contact_frequency(first_order(dense_model(operators))) == 0.0
    model = chain(pull=0.0, n_c=1)
    assert contact_frequency(first_order(model)) == pytest.approx(np.sqrt(1500.0 / 1.0), rel=1e-12)


def test_choice_between_the_two():
    few, many = first_order(chain(0.0, 3)), first_order(chain(0.0, 24))
    assert choose(few, 0.01).events and "3 contacts" in choose(few, 0.01).reason
    assert not choose(many, 0.01).events and "24 contacts" in choose(many, 0.01).reason
    # Contacts of 39 rad/s and instants 100 s apart: far more than six halvings.
    assert choose(many, 100.0).events and "too stiff" in choose(many, 100.0).reason


def test_many_contacts_reach_their_tolerance():
    """The stated error is above the true one, and below the tolerance."""
    model = chain(pull=0.0, n_c=24)
    instants, start = np.linspace(0.0, 1.0, 26), static_start(chain(0.0, 24))
    here = solve(model, instants, start, tolerance=1e-5)
    exact = from_events(model, first_order(model), forcing(model.histories, instants), instants, start, peaks=False)
    assert here.events is None and "collocation" in here.reason and len(exact.events) > 24
    true = differences(model, exact, here.outputs, here.force).relative
    assert true < here.error < 1e-5


def test_differences_are_the_error_in_time_of_another_run():
    model = chain(pull=0.0)
    instants = np.linspace(0.0, 0.5, 6)
    here = solve(model, instants, rest_start(model), peaks=False)
    outputs = here.outputs.copy()
    outputs[3, 1] += 0.25 * np.abs(here.outputs).max()
    found = differences(model, here, outputs, here.force)
    assert found.outputs == pytest.approx([0.0, 0.25 * np.abs(here.outputs).max(), 0.0])
    assert found.force.tolist() == [0.0, 0.0, 0.0]
    assert found.relative == pytest.approx(0.25)
