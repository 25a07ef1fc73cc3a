"""The acceleration that a state asks for."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from uplift.forms.operators import Operators
from uplift.solvers.linear import SAME_PATTERN, LinearSolver, definite_solver
from uplift.solvers.time_domain.state import State, loads_at

REFINEMENTS = 10
"""Each takes away all but the part that the small stiffness is of a dof's mass: 4e-6 beside 1e15 N/m, 600 kg and steps of 5 ms."""

BALANCED = 1e-9
"""A force that is left of the loads by less than this part of them is round-off: the state is one of rest."""


def balance_acceleration(
    operators: Operators,
    state: State,
    values: np.ndarray,
    time_scale: float,
    *,
    damped: bool = True,
    rigid_modes: np.ndarray | None = None,
) -> None:
    """Set the acceleration that the equation of motion asks for: M a = f - C v - K u (collective).

    `values` (n_loads,) are the load histories at this instant. Dofs without mass (rotations, massless joints) follow from their own
    equilibrium, differentiated twice; it enters through a small stiffness weighed with `time_scale`^2 s2, whose effect on the others,
    which stiff springs feel, is taken away by refinement.
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
    if right.norm(PETSc.NormType.NORM_INFINITY) > BALANCED * _largest_force(operators, values):
        matrix = operators.mass.copy()
        if operators.comm.allreduce(bool(massless.any()), op=MPI.LOR):
            matrix.axpy(1e-13 * time_scale**2, operators.stiffness, structure=SAME_PATTERN)
        with definite_solver(matrix, "initial_", "initial acceleration", rigid_modes) as solver:
            _refined(solver, operators, right, massless, state.acceleration)
        matrix.destroy()
    right.destroy()
    work.destroy()


def _refined(solver: LinearSolver, operators: Operators, right: Any, massless: np.ndarray, acceleration: Any) -> None:
    """Solve M a = f on the dofs with mass, those without in equilibrium, by a solver of M and a small stiffness (collective)."""
    left, change = right.copy(), operators.new_vector()
    whole = right.norm()
    for _ in range(REFINEMENTS):
        solver.solve(left, change, check=True)
        acceleration.axpy(1.0, change)
        operators.mass.mult(acceleration, left)
        left.aypx(-1.0, right)
        left.array[massless] = 0.0
        if left.norm() <= np.finfo(float).eps * whole:
            break
    left.destroy()
    change.destroy()


def _largest_force(operators: Operators, values: np.ndarray) -> float:
    """Return the largest entry of the load vectors times the values (n_loads,) of their histories."""
    entries = [abs(value) * load.vector.norm(PETSc.NormType.NORM_INFINITY) for value, load in zip(values, operators.loads, strict=True)]
    return max(entries, default=0.0)
