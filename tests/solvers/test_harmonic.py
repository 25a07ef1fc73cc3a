import numpy as np
import pytest
from scipy.special import gammaincc

from tests import oscillator
from tests.small import contact_on, dense_operators
from uplift.forms.loads.signals import Constant, Ricker
from uplift.solvers.frequency_domain.harmonic import FourierResponse, harmonic_sweep, shares_beyond
from uplift.solvers.frequency_domain.window import Window
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import at_rest

pytestmark = pytest.mark.complex


def operators_with(history, **options):
    return dense_operators(oscillator.STIFFNESS, oscillator.MASS, oscillator.DAMPING, [(oscillator.FORCE, history, False)], **options)


def test_sweep_equals_the_closed_form():
    omega = np.linspace(0, 20, 41)
    with operators_with(Constant(1.0)) as operators:
        transfer = harmonic_sweep(operators, omega)
    exact = np.array([oscillator.frequency_response(w) for w in omega])
    assert np.max(np.abs(transfer.probes[:, :, 0] - exact)) < 1e-13 * np.max(np.abs(exact))
    assert transfer.fields[:, 0, :] == pytest.approx(transfer.probes[:, :, 0])


def test_unit_release_forces_are_the_columns_after_the_loads():
    omega = np.array([0.0, 3.0])
    with operators_with(Constant(1.0), contacts=contact_on(1, 7.0, 2)) as operators:
        transfer = harmonic_sweep(operators, omega)
    for i, w in enumerate(omega):
        dynamic = oscillator.STIFFNESS - w**2 * oscillator.MASS + 1j * w * oscillator.DAMPING
        assert transfer.probes[i, :, 1] == pytest.approx(np.linalg.solve(dynamic, [0.0, 1.0]), rel=1e-13)
        assert transfer.elongation[i, 0, 1] == pytest.approx(transfer.probes[i, 1, 1])


def test_band_limited_response_equals_small_time_steps():
    """A pulse that dies out within the window, in a band that holds it: time stepping converges to it."""
    pulse = Ricker(1.0, 0.7, 3.0)
    window = Window(160.0, 8192, 8.0)
    errors, felt = [], []
    with operators_with(pulse) as operators:
        history = FourierResponse(operators, window, harmonic_sweep(operators, 2 * np.pi * window.frequencies)).history(None)
        for per_sample in (8, 16):
            step = window.length / window.samples / per_sample
            with Newmark(operators, Scheme(), step) as method, at_rest(operators) as start:
                stepped = transient(method, start, per_sample * 1024, every=per_sample)
            errors.append(np.max(np.abs(history.probes[:1025] - stepped.probes)) / np.max(np.abs(stepped.probes)))
            felt.append(np.max(np.abs(history.accelerations[:1025] - stepped.accelerations)) / np.max(np.abs(stepped.accelerations)))
    # What separates them is the second-order error of time stepping alone.
    assert errors[1] < 1e-4
    assert 3.9 < errors[0] / errors[1] < 4.1
    assert felt[1] < 1e-3 and 3.9 < felt[0] / felt[1] < 4.1
    assert history.peak_field == pytest.approx(history.probes[history.peak], abs=1e-12)


def test_static_load_answers_statically():
    window = Window(10.0, 64, 2.0)
    with operators_with(Constant(1.0)) as operators:
        history = FourierResponse(operators, window, harmonic_sweep(operators, 2 * np.pi * window.frequencies)).history(None)
    static = np.linalg.solve(oscillator.STIFFNESS, oscillator.FORCE)
    assert history.probes == pytest.approx(np.tile(static, (64, 1)), rel=1e-12)


@pytest.mark.parametrize(("samples", "cutoff"), [(64, 1.0), (64, 3.2), (32, 1.6), (1024, 0.5)])
def test_energy_beyond_the_band_is_that_of_the_closed_form(samples, cutoff):
    """The energy of a Ricker pulse goes with f^4 exp(-2 (f / f0)^2), so that its tail is an incomplete gamma function."""
    pulse, window = Ricker(3.0, 1.2, 5.0), Window(40.0, 4 * samples, cutoff)
    with operators_with(pulse) as operators:
        shares = shares_beyond(operators, window)
    # The tail begins half a line of the spectrum above the last frequency that is solved.
    tails = [gammaincc(2.5, 2 * ((f + 0.0125) / 1.2) ** 2) for f in (cutoff, samples / 20)]
    assert shares == pytest.approx(tails, rel=0.005, abs=1e-12)


def test_what_is_left_at_the_end_of_a_window_is_reported():
    """A constant load is static and leaves nothing; what a pulse leaves falls with the length of the window as the slowest mode decays."""

    def left(history, static, length):
        operators = dense_operators(oscillator.STIFFNESS, oscillator.MASS, oscillator.DAMPING, [(oscillator.FORCE, history, static)])
        window = Window(length, 2048, 8.0)
        with operators:
            response = FourierResponse(operators, window, harmonic_sweep(operators, 2 * np.pi * window.frequencies))
            return response.left_over(response.history(None))

    assert left(Constant(1.0), True, 60.0) == 0
    omega, _, ratio = oscillator.modes()
    at_60, at_120 = (left(Ricker(1.0, 0.7, 3.0), False, length) for length in (60.0, 120.0))
    # The last part begins at 57 s and at 114 s.
    assert at_120 / at_60 == pytest.approx(np.exp(-np.min(omega * ratio) * 57.0), rel=0.1)
