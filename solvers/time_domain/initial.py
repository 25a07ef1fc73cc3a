"""States that a march starts from: the static answer, settled by steps; the acceleration at time 0."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from uplift.forms.operators import Operators
from uplift.solvers.contact.step import settled_release
from uplift.solvers.linear import SAME_PATTERN, definite_solver
from uplift.solvers.time_domain.newmark import ContactCompliance, Newmark
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import State, at_rest, load_scale, load_values, loads_at, tensions

BALANCED = 1e-9
"""A force that is left of the loads by less than this part of them is round-off: the state is one of rest."""


def balance_acceleration(
    operators: Operators,
    state: State,
    values: np.ndarray,
    time_scale: float,
    *,
    damped: bool = True,
    motions: np.ndarray | None = None,
) -> None:
    """Set the acceleration that the equation of motion asks for: M a = f - C v - K u (collective).

    `values` (n_loads,) are the load histories at this instant. Dofs without mass (rotations, massless joints) follow from their own
    equilibrium, differentiated twice; it enters through a stiffness weighed with `time_scale`^2 s2, small enough to leave
    the others alone.
    """
    right, work = loads_at(operators, values, state.release), operators.new_vector()
    operators.stiffness.mult(state.displacement, work)
    right.axpy(-1.0, work)
    if operators.damping is not None and damped:
        operators.damping.mult(state.velocity, work)
        right.axpy(-1.0, work)
    state.acceleration.zeroEntries()
    diagonal = operators.mass.getDiagonal()
    massless = np.abs(diagonal.array_r) == 0
    diagonal.destroy()
    right.array[massless] = 0.0  # they are in equilibrium: what is left of their forces is round-off
    if right.norm(PETSc.NormType.NORM_INFINITY) > BALANCED * load_scale(operators, values[None, :]):
        matrix = operators.mass.copy()
        if operators.comm.allreduce(bool(massless.any()), op=MPI.LOR):
            matrix.axpy(1e-13 * time_scale**2, operators.stiffness, structure=SAME_PATTERN)
        with definite_solver(matrix, "initial_", "initial acceleration", motions) as solver:
            solver.solve(right, state.acceleration, check=True)
        matrix.destroy()
    right.destroy()
    work.destroy()


def static_state(operators: Operators, *, exact_uplift: bool = False, motions: np.ndarray | None = None) -> State:
    """Return the static answer to the static loads (collective); contacts bonded, or lifted where they pull.

    With the rigid `motions` (k, n_local) it is found iteratively. Raises `SolverError` if there is none.
    """
    state = at_rest(operators)
    values = load_values(operators, np.zeros(1), static_only=True)[0]
    right = loads_at(operators, values, state.release)
    with definite_solver(operators.stiffness, "static_", "static initial state", motions) as solver:
        solver.solve(right, state.displacement, check=right.norm() > 0)
        if exact_uplift and state.release.size:
            compliance = ContactCompliance(operators, solver, 1.0)
            scale = load_scale(operators, values[None, :])
            state.release = settled_release(compliance.problem, tensions(operators, state.displacement), scale)
            state.displacement.array[:] += state.release @ compliance.answers
    right.destroy()
    return state


def settled_state(
    operators: Operators,
    scheme: Scheme,
    step: float,
    steps: int,
    *,
    exact_uplift: bool = False,
    motions: np.ndarray | None = None,
) -> State:
    """Return the state after `steps` undamped steps under the static loads from rest, ending at time 0 (collective).

    With the rigid `motions` (k, n_local) systems are solved iteratively. With beta = 1, gamma = 1.5 and long steps
    this is the static answer, by numerical damping, as the source obtains it.
    """
    state = at_rest(operators)
    values = load_values(operators, np.zeros(1), static_only=True)[0]
    balance_acceleration(operators, state, values, step, damped=False, motions=motions)
    with Newmark(operators, scheme, step, damped=False, exact_uplift=exact_uplift, prefix="settle_", motions=motions) as method:
        method.load_scale = load_scale(operators, values[None, :])
        for _ in range(steps):
            method.advance(state, (values, values))
    return state
