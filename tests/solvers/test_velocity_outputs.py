"""Outputs that hold a part of the velocity, by every method."""

import dataclasses

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tests import oscillator
from tests.small import dense_operators
from uplift.forms.loads.signals import Constant, Ricker
from uplift.forms.operators import OutputGroup, Outputs
from uplift.solvers.bases.basis import Basis
from uplift.solvers.bases.project import project
from uplift.solvers.frequency_domain.harmonic import harmonic_sweep
from uplift.solvers.frequency_domain.laplace import laplace_run
from uplift.solvers.time_domain.march import stepper_of, transient
from uplift.solvers.time_domain.scheme import Scheme, generalised_alpha, hilber_hughes_taylor
from uplift.solvers.time_domain.state import at_rest

SCHEMES = [Scheme(), Scheme(0.3025, 0.6), hilber_hughes_taylor(0.2), generalised_alpha(0.4)]
WEIGHTS = np.array([[2.0, -1.0], [0.5, 3.0]])
STEP, STEPS = 0.02, 400


def model(history):
    """The oscillator of two dofs with a group of outputs 4 u0 + WEIGHTS u'."""
    loads = [(oscillator.FORCE, history, False)]
    operators = dense_operators(oscillator.STIFFNESS, oscillator.MASS, oscillator.DAMPING, loads)
    local = sparse.csr_matrix([[4.0, 0.0], [4.0, 0.0]])
    group = OutputGroup("damped", ("a", "b"), ("N", "N"), local, per_velocity=sparse.csr_matrix(WEIGHTS))
    return dataclasses.replace(operators, outputs=Outputs.of([*operators.outputs.groups, group], MPI.COMM_SELF))


def in_basis(operators):
    return project(operators, Basis(np.array([[1.0, 0.3], [0.2, -1.0]]), MPI.COMM_SELF))


def velocities(displacement):
    """Those of the average acceleration from rest: (v0 + v1) / 2 = (u1 - u0) / dt."""
    found = np.zeros_like(displacement)
    for n in range(1, len(found)):
        found[n] = 2 * (displacement[n] - displacement[n - 1]) / STEP - found[n - 1]
    return found


@pytest.mark.parametrize("reduced", [False, True])
def test_a_march_adds_the_velocity(reduced):
    with model(Ricker(2.0, 1.0, 1.5)) as operators, (in_basis(operators) if reduced else model(Ricker(2.0, 1.0, 1.5))) as marched:
        with at_rest(marched) as start, stepper_of(marched, Scheme(), STEP) as stepper:
            history = transient(stepper, start, STEPS)
    expected = 4 * history.probes[:, :1] + velocities(history.probes) @ WEIGHTS.T
    # The recurrence adds up the round-off of all steps.
    assert history.group("damped") == pytest.approx(expected, abs=1e-9 * np.max(np.abs(expected)))


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("signal", [Ricker(2.0, 1.0, 1.5), Constant(1.0)])
def test_the_laplace_sweep_in_a_basis_equals_the_march(scheme, signal):
    """Also for a load that is there at once, whose acceleration at time 0 is in the velocity."""
    with model(signal) as whole, in_basis(whole) as operators, at_rest(operators) as start:
        with stepper_of(operators, scheme, STEP) as stepper:
            stepped = transient(stepper, start, STEPS)
        run = laplace_run(operators, scheme, STEP, STEPS, start)
    assert run.history.group("damped") == pytest.approx(stepped.group("damped"), abs=1e-9 * np.max(np.abs(stepped.group("damped"))))


@pytest.mark.complex
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("signal", [Ricker(2.0, 1.0, 1.5), Constant(1.0)])
def test_the_laplace_sweep_equals_the_march(scheme, signal):
    with model(signal) as operators, at_rest(operators) as start:
        with stepper_of(operators, scheme, STEP) as stepper:
            stepped = transient(stepper, start, STEPS, every=2)
        run = laplace_run(operators, scheme, STEP, STEPS, start, every=2)
    assert run.history.group("damped") == pytest.approx(stepped.group("damped"), abs=1e-9 * np.max(np.abs(stepped.group("damped"))))


@pytest.mark.complex
def test_a_harmonic_velocity_is_i_omega_times_the_displacement():
    omega = np.array([3.0, 40.0])
    with model(Constant(1.0)) as operators:
        transfer = harmonic_sweep(operators, omega)
    for k, w in enumerate(omega):
        dynamic = oscillator.STIFFNESS + 1j * w * oscillator.DAMPING - w**2 * oscillator.MASS
        u = np.linalg.solve(dynamic, oscillator.FORCE)
        assert transfer.group("damped")[k, :, 0] == pytest.approx(4 * u[0] + 1j * w * WEIGHTS @ u, rel=1e-11)


def test_a_model_without_such_outputs_keeps_no_rows_for_them():
    with dense_operators(oscillator.STIFFNESS, oscillator.MASS) as operators:
        assert operators.outputs.per_velocity is None
