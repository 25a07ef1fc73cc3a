"""Response spectra against closed forms, a fine integration by other means, and accelerations against each other."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from uplift.solvers.spectra import response_spectrum, second_differences
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.scheme import Scheme


def test_step_of_acceleration():
    """u = -a/w^2 (1 - e^(-zwt) (cos wd t + z/sqrt(1-z^2) sin wd t)): its first peak is at wd t = pi."""
    times, zeta = np.arange(0, 4.0, 0.01), 0.05
    spectrum = response_spectrum(np.full((len(times), 1), 2.0), 0.01, np.array([0.5, 3.0, 17.0]), (zeta,))
    peak = 1 + np.exp(-zeta * np.pi / np.sqrt(1 - zeta**2))
    omega = 2 * np.pi * spectrum.frequencies
    # 40 instants a period: cos(pi/40) = 1 - 0.0031.
    assert spectrum.displacement[0, :, 0] == pytest.approx(2.0 * peak / omega**2, rel=3.1e-3)
    assert np.all(spectrum.displacement[0, :, 0] <= 2.0 * peak / omega**2 * (1 + 1e-12))
    undamped = response_spectrum(np.full((len(times), 1), 2.0), 0.01, np.array([3.0]), (0.0,))
    assert undamped.acceleration[0, 0, 0] == pytest.approx(4.0, rel=3.1e-3)


def test_harmonic_at_resonance_reaches_its_steady_state():
    """Absolute acceleration of the steady state at resonance: A sqrt(1 + 4 z^2) / (2 z)."""
    f, zeta = 2.0, 0.05
    times = np.arange(0, 20.0, 0.002)
    spectrum = response_spectrum(np.sin(2 * np.pi * f * times)[:, None], 0.002, np.array([f]), (zeta,))
    # What linear interpolation takes from a sine of 250 samples a period is 1e-4.
    assert spectrum.acceleration[0, 0, 0] == pytest.approx(np.sqrt(1 + 4 * zeta**2) / (2 * zeta), rel=3.2e-3)
    undamped = response_spectrum(np.sin(2 * np.pi * f * times)[:, None], 0.002, np.array([f]), (0.0,))
    # u = (w t cos w t - sin w t) A / (2 w^2): it grows to w t / (2 w^2) at the end of the record.
    omega = 2 * np.pi * f
    assert undamped.displacement[0, 0, 0] == pytest.approx(times[-1] / (2 * omega), rel=4e-3)


def test_free_vibration_after_a_short_pulse():
    """A triangle of area I, short beside the period, leaves an oscillator with the velocity I."""
    a = np.zeros((2001, 1))
    a[1] = 3.0
    step, f, zeta = 1e-3, 1.0, 0.02
    spectrum = response_spectrum(a, step, np.array([f]), (zeta,))
    impulse, omega = 3.0 * step, 2 * np.pi * f
    lag = np.arctan(np.sqrt(1 - zeta**2) / zeta)
    peak = impulse / omega * np.exp(-zeta / np.sqrt(1 - zeta**2) * lag)
    assert spectrum.displacement[0, 0, 0] == pytest.approx(peak, rel=1e-5)


@pytest.mark.parametrize(("f", "zeta"), [(0.1, 0.02), (2.3, 0.10), (18.0, 0.05), (50.0, 0.02)])
def test_against_an_independent_fine_integration(f, zeta):
    rng = np.random.default_rng(3)
    step = 0.01
    a = np.cumsum(rng.standard_normal(150)) * np.hanning(150)
    times = step * np.arange(len(a))
    omega = 2 * np.pi * f

    def motion(t, y):
        return [y[1], -2 * zeta * omega * y[1] - omega**2 * y[0] - np.interp(t, times, a)]

    fine = np.linspace(0, times[-1], 20001)
    done = solve_ivp(motion, (0, times[-1]), [0.0, 0.0], t_eval=fine, method="DOP853", rtol=1e-9, atol=1e-12, max_step=step / 2)
    absolute = np.abs(2 * zeta * omega * done.y[1] + omega**2 * done.y[0]).max()
    spectrum = response_spectrum(a[:, None], step, np.array([f]), (zeta,))
    assert spectrum.acceleration[0, 0, 0] <= absolute * (1 + 1e-6)
    assert spectrum.acceleration[0, 0, 0] == pytest.approx(absolute, rel=3.2e-3)
    assert spectrum.displacement[0, 0, 0] == pytest.approx(np.abs(done.y[0]).max(), rel=3.2e-3)


def test_states_at_the_samples_are_exact():
    """At 40 samples a period and more nothing is sought between them: the recurrence alone, at a step where its weights are small."""
    step, omega, zeta = 1e-5, 2 * np.pi * 0.5, 0.3
    times = step * np.arange(40001)
    spectrum = response_spectrum(np.ones((len(times), 1)), step, np.array([0.5]), (zeta,))
    damped = omega * np.sqrt(1 - zeta**2)
    t = times[-1]
    exact = (1 - np.exp(-zeta * omega * t) * (np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t))) / omega**2
    assert spectrum.displacement[0, 0, 0] == pytest.approx(exact, rel=1e-11)


def test_rigid_oscillators_follow_the_floor():
    times = np.arange(0, 2.0, 0.01)
    a = np.column_stack([np.sin(2 * np.pi * times), np.hanning(len(times))])
    spectrum = response_spectrum(a, 0.01, np.array([50.0]), (0.05,))
    assert spectrum.acceleration[0, 0] == pytest.approx(spectrum.floor, rel=0.02)


@pytest.mark.parametrize("bad", [{"frequencies": np.array([0.0])}, {"damping": (1.0,)}, {"damping": (-0.1,)}, {"step": 0.0}])
def test_bad_questions_are_refused(bad):
    with pytest.raises(ValueError, match="expected"):
        response_spectrum(**{"acceleration": np.ones((4, 1)), "step": 0.1} | bad)


def test_recorded_accelerations_are_those_of_the_displacements(assembly):
    scheme, step = Scheme(0.25, 0.5), 0.005
    operators = assembly.operators
    with static_state(operators, exact_uplift=True) as start, Newmark(operators, scheme, step, exact_uplift=True) as method:
        history = transient(method, start, 600)
    recorded = history.accelerations
    averaged = 0.25 * recorded[:-2] + 0.5 * recorded[1:-1] + 0.25 * recorded[2:]
    differences = second_differences(history.probes, step)
    # Two differences of numbers of 0.05 m over 2.5e-5 s2 keep 1e-17 / 2.5e-5.
    assert np.max(np.abs(differences[1:-1] - averaged)) < 1e-9 * np.max(np.abs(recorded))
    assert np.max(np.abs(recorded)) > 1.0
