"""Convolution quadrature against the time stepping whose answer it must be."""

from dataclasses import replace

import numpy as np
import pytest

from tests import bouncing, oscillator
from tests.small import dense_operators
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.forms.loads.signals import Constant, Ricker
from uplift.solvers.frequency_domain.laplace import Circle, laplace_run
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.scheme import Scheme, generalised_alpha, hilber_hughes_taylor
from uplift.solvers.time_domain.state import at_rest

pytestmark = pytest.mark.complex
SCHEMES = [Scheme(), Scheme(0.3025, 0.6), hilber_hughes_taylor(0.2), generalised_alpha(0.4)]


def test_transform_and_its_inverse():
    circle = Circle(Scheme(), 0.1, 37)
    values = np.random.default_rng(9).normal(size=(38, 2))
    here = circle.forward(values)
    assert here[3] == pytest.approx(circle.points[3] ** np.arange(38) @ values, abs=1e-12)
    # rho^-n enlarges round-off to eps^(2/3).
    assert circle.inverse(here) == pytest.approx(values, abs=1e-10)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("history", [Ricker(2.0, 1.0, 1.5), Constant(1.0)])
def test_linear_answer_equals_time_stepping(scheme, history):
    """Also for a load that is there at once, which gives the start an acceleration."""
    loads = [(oscillator.FORCE, history, False)]
    with dense_operators(oscillator.STIFFNESS, oscillator.MASS, oscillator.DAMPING, loads) as operators, at_rest(operators) as start:
        with Newmark(operators, scheme, 0.02) as method:
            stepped = transient(method, start, 400, every=2)
        run = laplace_run(operators, scheme, 0.02, 400, start, every=2)
    assert run.history.times == pytest.approx(stepped.times)
    assert np.max(np.abs(run.history.probes - stepped.probes)) < 1e-9 * np.max(np.abs(stepped.probes))
    assert run.history.peak == stepped.peak
    assert run.history.peak_field == pytest.approx(stepped.peak_field, rel=1e-8)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_bouncing_mass(scheme):
    """Dropped onto its spring from where that is unstrained."""
    with bouncing.operators() as operators, at_rest(operators) as start:
        operators.loads[0] = replace(operators.loads[0], static=False, history=Ricker(3.0, 2.0, 0.4))
        with Newmark(operators, scheme, 2e-3, exact_uplift=True) as method:
            stepped = transient(method, start, 1000)
        run = laplace_run(operators, scheme, 2e-3, 1000, start)
    assert np.max(stepped.release) > 0
    assert np.max(np.abs(run.history.probes - stepped.probes)) < 1e-8 * np.max(np.abs(stepped.probes))


def both(scene, comm, step=0.005, steps=600, scheme=None):
    scheme = scheme or Scheme()
    with prepare(scene, comm) as assembly, static_state(assembly.operators, exact_uplift=True) as start:
        with Newmark(assembly.operators, scheme, step, exact_uplift=True) as method:
            stepped = transient(method, start, steps)
        run = laplace_run(assembly.operators, scheme, step, steps, start)
    return stepped, run.history


CHANGES = {
    "reference": {},
    "gap": {"supports": {"gap": 0.005}},
    "soft supports": {"supports": {"stiffness": (1e15, 1e7)}},
    "stiff supports": {"supports": {"stiffness": (1e15, 1e9)}},
    "undamped": {"material": {"alpha": 0.0, "beta": 0.0}},
    "soft plate": {"material": {"young": 1.4e7}},
    "no gravity": {"gravity": 0.0},
    "released sideways": {"supports": {"sideways": "released", "contact": (1e10, 1e15)}},
}


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=pytest.mark.ranks if name in ("gap", "released sideways") else ()) for name in CHANGES
])
def test_sweep_and_march_equal_time_stepping_on_plates(sdls119a, comm, name):
    model = sdls119a.model
    for key, change in CHANGES[name].items():
        if key == "supports":
            change = (replace(model.supports[0], **change),)
        elif key == "material":
            change = replace(model.material, **change)
        model = replace(model, **{key: change})
    stepped, here = both(replace(sdls119a, model=model), comm)
    assert np.max(stepped.release) > 0
    scale = np.max(np.abs(stepped.probes))
    assert np.max(np.abs(here.probes - stepped.probes)) < 1e-8 * scale
    assert np.max(np.abs(here.reactions - stepped.reactions)) < 1e-7 * np.max(np.abs(stepped.reactions))


@pytest.mark.ranks
def test_accelerations_are_those_of_time_stepping_smoothed(assembly):
    """Second differences of the sweep's displacements: the accelerations of Newmark's method, weighed 1/4, 1/2, 1/4."""
    scheme, step = Scheme(0.25, 0.5), 0.01
    with static_state(assembly.operators, exact_uplift=True) as start:
        with Newmark(assembly.operators, scheme, step, exact_uplift=True) as method:
            stepped = transient(method, start, 300).accelerations
        run = laplace_run(assembly.operators, scheme, step, 300, start)
    smooth = 0.25 * stepped[:-2] + 0.5 * stepped[1:-1] + 0.25 * stepped[2:]
    # Displacements of 0.05 m agree to 2e-10; over (0.01 s)^2 that is 1e-7 m/s2.
    assert np.max(np.abs(run.history.accelerations[1:-1] - smooth)) < 1e-6
    assert np.max(np.abs(smooth)) > 1.0
