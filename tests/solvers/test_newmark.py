import numpy as np
import pytest

from tests import oscillator
from tests.small import contact_on, dense_operators, marched, petsc_matrix, petsc_vector
from uplift.forms.loads.signals import Constant
from uplift.meshes.checked import ModelError
from uplift.solvers.contact.memory import closed
from uplift.solvers.errors import SolverError
from uplift.solvers.linear import DirectSolver
from uplift.solvers.time_domain.balance import balance_acceleration
from uplift.solvers.time_domain.initial import settled_state, static_state
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.scheme import Scheme, generalised_alpha, hilber_hughes_taylor
from uplift.solvers.time_domain.state import Drive, State, at_rest

pytestmark = pytest.mark.both


def oscillator_operators(**options):
    loads = [(oscillator.FORCE, Constant(1.0), True)]
    return dense_operators(oscillator.STIFFNESS, oscillator.MASS, oscillator.DAMPING, loads, **options)


def run(scheme, step, duration=2.0):
    with oscillator_operators() as operators, Newmark(operators, scheme, step) as method:
        start = State(petsc_vector(oscillator.U0), petsc_vector(oscillator.V0), operators.new_vector(), closed(0))
        with start:
            history = transient(method, start, round(duration / step))
    return history.times, history.probes


@pytest.mark.parametrize(
    ("scheme", "order"),
    [
        (Scheme(), 2),
        (Scheme(0.3025, 0.6), 1),
        (Scheme(1.0, 1.5), 1),
        (hilber_hughes_taylor(0.3), 2),
        (generalised_alpha(0.0), 2),
        (generalised_alpha(0.5), 2),
        (generalised_alpha(1.0), 2),
    ],
)
def test_order_of_the_scheme(scheme, order):
    """Least-squares slope over three steps, with damping and with initial displacement and velocity."""
    steps = np.array([0.004, 0.002, 0.001])
    errors = []
    for step in steps:
        times, here = run(scheme, step)
        errors.append(np.max(np.abs(here - oscillator.step_response(times))))
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order - 0.1 < slope < order + 0.1
    # The most dissipative of the second-order schemes has the largest error constant: 3e-5 at this step.
    assert errors[-1] < (5e-5 if order == 2 else 0.3)


def test_small_steps_keep_their_digits():
    """The error falls as dt^2 down to 1e-5 s: the acceleration is solved for, not taken as a difference."""
    times, here = run(Scheme(), 1e-5, duration=0.2)
    error = np.max(np.abs(here - oscillator.step_response(times)))
    assert error < 1e-10


def test_undamped_average_acceleration_keeps_its_energy():
    stiffness, mass = oscillator.STIFFNESS, oscillator.MASS
    with dense_operators(stiffness, mass) as operators, Newmark(operators, Scheme(), 0.05) as method:
        start = State(petsc_vector(oscillator.U0), petsc_vector(oscillator.V0), operators.new_vector(), closed(0))
        drive = Drive(np.zeros((2001, 0)), 0.0)
        method.begin(start, drive)
        energies = []
        for n in range(1, 2001):
            u, v = np.real(method.state.displacement.array), np.real(method.state.velocity.array)
            energies.append(0.5 * (u @ stiffness @ u + v @ mass @ v))
            method.advance(drive, n, n)
    # 2000 steps of round-off.
    assert np.ptp(energies) < 1e-11 * energies[0]


def test_static_and_settled_states_agree():
    static = np.linalg.solve(oscillator.STIFFNESS, oscillator.FORCE)
    with oscillator_operators() as operators:
        with static_state(operators) as state:
            assert np.real(state.displacement.array) == pytest.approx(static, rel=1e-14)
        with settled_state(operators, Scheme(1.0, 1.5), 10.0, 20) as state:
            assert np.real(state.displacement.array) == pytest.approx(static, rel=1e-4)


def test_acceleration_balances_the_forces_and_massless_dofs_follow():
    mass = np.diag([2.0, 0.0])
    loads = [(np.array([4.0, 0.0]), Constant(1.0), True)]
    with dense_operators(oscillator.STIFFNESS, mass, None, loads) as operators, at_rest(operators) as state:
        balance_acceleration(operators, state, np.ones(1), 1e-2)
        # The second row holds at all times: -20 u1 + 20 u2 = 0, so both accelerate alike.
        assert np.real(state.acceleration.array) == pytest.approx([2.0, 2.0], rel=1e-9)


def test_release_forces_are_interpolated_between_archived_instants():
    """A force archived every 4th step acts as its linear interpolation at every step."""
    contacts = contact_on(0, 1.0, 1)
    with dense_operators([[4.0]], [[1.0]], contacts=contacts) as operators, Newmark(operators, Scheme(), 0.01) as method:
        archived = np.array([[0.0], [1.0], [-2.0], [0.5]])
        with at_rest(operators) as start:
            coarse = transient(method, start, 12, every=4, release=archived)
            fine_times = 0.01 * np.arange(13)
            fine = np.interp(fine_times, fine_times[::4], archived[:, 0])[:, None]
            exact = transient(method, start, 12, release=fine)
    assert coarse.probes == pytest.approx(exact.probes[::4], rel=1e-14)


def test_history_knows_its_peak():
    with oscillator_operators() as operators, Newmark(operators, Scheme(), 0.01) as method, at_rest(operators) as start:
        history = transient(method, start, 200, every=2)
    assert history.peak == np.argmax(np.max(np.abs(history.probes), axis=1))
    assert history.peak_field == pytest.approx(history.probes[history.peak])


@pytest.mark.parametrize(("beta", "gamma", "key"), [(0.2, 0.5, "beta"), (0.25, 0.4, "gamma"), (0.0, 0.5, "beta")])
def test_conditionally_stable_parameters_are_refused(beta, gamma, key):
    with pytest.raises(ModelError) as error:
        Scheme(beta, gamma)
    assert error.value.key == key


def test_singular_system_is_an_error():
    matrix, right = petsc_matrix(np.array([[1.0, -1.0], [-1.0, 1.0]])), petsc_vector([1.0, 0.0])
    solution = right.duplicate()
    with pytest.raises(SolverError, match="rocking frame"), DirectSolver(matrix, "t_", definite=True, what="rocking frame") as solver:
        solver.solve(right, solution, check=True)


@pytest.mark.parametrize("stiff", [1.0, 1e15, 1e18])
def test_the_first_acceleration_beside_a_dof_without_mass_does_not_feel_how_stiff_the_others_are(stiff):
    """At rest a sudden force of 3 N on 600 kg makes 3 / 600 m/s2 whatever holds them, and a massless node on a spring goes along."""
    loads = [([3.0, 0.0], np.ones_like, False)]
    with dense_operators([[stiff + 1, -1], [-1, 1]], np.diag([600.0, 0.0]), None, loads) as operators:
        history = marched(operators, Scheme(), 5e-3, 1, at_rest(operators))
    assert history.accelerations[0] == pytest.approx([0.005, 0.005], rel=1e-14)
