"""Newmark's method in acceleration form, with the effective matrix factorised once.

u1 = u0 + dt v0 + dt^2 ((1/2 - beta) a0 + beta a1),  v1 = v0 + dt ((1 - gamma) a0 + gamma a1),
(M + gamma dt C + beta dt^2 K) a1 = f1 - C v* - K u*, with u*, v* the parts of u1, v1 that are known.

Second order for gamma = 1/2, else first; unconditionally stable for 2 beta >= gamma >= 1/2. Solving for the acceleration
keeps its digits when dt is small, where the difference of two displacements over dt^2 would not.
Source: Hughes, The Finite Element Method, chapter 9; N. M. Newmark, J. Eng. Mech. Div. ASCE 85 (1959).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from forms.operators import Operators
from solvers.history import History
from solvers.linear import DirectSolver
from solvers.parameters import Scheme


@dataclass
class State:
    """Displacement, velocity and acceleration (PETSc vectors) at one instant; `with` destroys them."""

    displacement: Any
    velocity: Any
    acceleration: Any

    def __enter__(self) -> State:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Destroy the vectors."""
        for vector in (self.displacement, self.velocity, self.acceleration):
            vector.destroy()


def at_rest(operators: Operators) -> State:
    """Return the state of zero displacement, velocity and acceleration."""
    return State(operators.new_vector(), operators.new_vector(), operators.new_vector())


class Newmark:
    """Time stepping of one model with one step length; `with` frees the factors."""

    def __init__(
        self, operators: Operators, scheme: Scheme, step: float, *, damped: bool = True, prefix: str = "newmark_"
    ) -> None:
        """Factorise the effective matrix (collective). `step` in s; `damped=False` leaves the damping out."""
        self.operators = operators
        self.scheme = scheme
        self.step = step
        self.damping = operators.damping if damped else None
        effective = operators.mass.copy()
        same = PETSc.Mat.Structure.SAME_NONZERO_PATTERN
        effective.axpy(scheme.beta * step**2, operators.stiffness, structure=same)
        if self.damping is not None:
            effective.axpy(scheme.gamma * step, self.damping, structure=same)
        self._effective = effective
        self.solver = DirectSolver(effective, prefix, definite=True, what="time step")
        self._right, self._work = operators.new_vector(), operators.new_vector()
        self._steps = 0

    def __enter__(self) -> Newmark:
        """Return itself."""
        return self

    def __exit__(self, *args: object) -> None:
        """Free the factors and work vectors."""
        self.solver.__exit__(*args)
        for thing in (self._effective, self._right, self._work):
            thing.destroy()

    def predict(self, state: State) -> None:
        """Replace displacement and velocity by the known parts u*, v* of their values one step later."""
        dt, beta, gamma = self.step, self.scheme.beta, self.scheme.gamma
        state.displacement.axpy(dt, state.velocity)
        if beta != 0.5:
            state.displacement.axpy(dt**2 * (0.5 - beta), state.acceleration)
        if gamma != 1.0:
            state.velocity.axpy(dt * (1 - gamma), state.acceleration)

    def correct(self, state: State, right: Any) -> None:
        """Solve for the new acceleration and complete displacement and velocity; `right` holds f1 and is overwritten."""
        self.operators.stiffness.mult(state.displacement, self._work)
        right.axpy(-1.0, self._work)
        if self.damping is not None:
            self.damping.mult(state.velocity, self._work)
            right.axpy(-1.0, self._work)
        # The first step and every power of two are checked: cheap, and a factor gone bad is seen early.
        self.solver.solve(right, state.acceleration, check=(self._steps & (self._steps - 1)) == 0)
        self._steps += 1
        state.displacement.axpy(self.step**2 * self.scheme.beta, state.acceleration)
        state.velocity.axpy(self.step * self.scheme.gamma, state.acceleration)

    def load(self, values: np.ndarray, push: np.ndarray | None) -> Any:
        """Return the load vector for values (n_loads,) of the load histories and release forces (n_c,) N."""
        self._right.zeroEntries()
        for value, load in zip(values, self.operators.loads, strict=True):
            if value != 0:
                self._right.axpy(value, load.vector)
        if push is not None and push.any():
            self._right.array[:] += self.operators.contacts.push @ push
        return self._right


def balance_acceleration(operators: Operators, state: State, load_values: np.ndarray, time_scale: float, *, damped: bool = True) -> None:
    """Set the acceleration that the equation of motion asks for: M a = f - C v - K u (collective).

    `load_values` (n_loads,) are the load histories at this instant. Dofs without mass (massless joints) follow from
    their own equilibrium, differentiated twice; it enters through a stiffness weighed with `time_scale`^2 s2, small
    enough to leave the others alone.
    """
    massless = float(np.min(np.abs(operators.mass.getDiagonal().array), initial=np.inf))
    massless = operators.comm.allreduce(massless, op=min)
    matrix = operators.mass.copy()
    if massless == 0:
        matrix.axpy(1e-13 * time_scale**2, operators.stiffness, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    right, work = operators.new_vector(), operators.new_vector()
    for value, load in zip(load_values, operators.loads, strict=True):
        right.axpy(value, load.vector)
    operators.stiffness.mult(state.displacement, work)
    right.axpy(-1.0, work)
    if operators.damping is not None and damped:
        operators.damping.mult(state.velocity, work)
        right.axpy(-1.0, work)
    with DirectSolver(matrix, "initial_", definite=True, what="initial acceleration") as solver:
        solver.solve(right, state.acceleration, check=right.norm() > 0)
    for thing in (matrix, right, work):
        thing.destroy()


def load_values(operators: Operators, times: np.ndarray, *, static_only: bool = False) -> np.ndarray:
    """Return the load histories (nt, n_loads) at `times` (nt,) s; with `static_only` those of the static loads alone."""
    columns = [
        load.history(times) if load.static or not static_only else np.zeros(len(times)) for load in operators.loads
    ]
    return np.stack(columns, axis=1) if columns else np.zeros((len(times), 0))


def static_state(operators: Operators) -> State:
    """Return the static answer to the static loads, every contact bonded (collective). Raises `SolverError` if none exists."""
    state = at_rest(operators)
    values = load_values(operators, np.zeros(1), static_only=True)[0]
    right = operators.new_vector()
    for value, load in zip(values, operators.loads, strict=True):
        right.axpy(value, load.vector)
    with DirectSolver(operators.stiffness, "static_", definite=True, what="static initial state") as solver:
        solver.solve(right, state.displacement, check=right.norm() > 0)
    right.destroy()
    return state


def settled_state(operators: Operators, scheme: Scheme, step: float, steps: int) -> State:
    """Return the state after `steps` undamped steps under the static loads from rest, ending at time 0 (collective).

    With beta = 1, gamma = 1.5 and long steps this is the static answer, by numerical damping, as the source obtains it.
    """
    state = at_rest(operators)
    values = load_values(operators, np.zeros(1), static_only=True)[0]
    balance_acceleration(operators, state, values, step, damped=False)
    with Newmark(operators, scheme, step, damped=False, prefix="settle_") as method:
        for _ in range(steps):
            method.predict(state)
            method.correct(state, method.load(values, None))
    return state


def transient(
    method: Newmark, start: State, steps: int, *, every: int = 1, release: np.ndarray | None = None
) -> History:
    """March `steps` steps from time 0 and the displacement and velocity of `start`, which is left as it is (collective).

    Every `every`-th step is archived. `release` (n_archived, n_c) N are contact release forces known at the archived
    instants and interpolated linearly between them, zero if None.
    """
    operators = method.operators
    times = method.step * np.arange(steps + 1)
    archived = times[::every]
    values = load_values(operators, times)
    pushes = None
    if release is not None:
        pushes = np.stack([np.interp(times, archived, column) for column in release.T], axis=1)
    state = State(start.displacement.copy(), start.velocity.copy(), start.acceleration.copy())
    observed = operators.probes, operators.contacts.elongation
    parts = [np.zeros((len(archived), len(functionals.names))) for functionals in observed]
    with state:
        balance_acceleration(operators, state, values[0], method.step)
        farthest, peak, peak_field = -1.0, 0, None
        for n in range(steps + 1):
            if n > 0:
                method.predict(state)
                method.correct(state, method.load(values[n], None if pushes is None else pushes[n]))
            if n % every:
                continue
            here = np.real(state.displacement.array_r)
            row = n // every
            for part, functionals in zip(parts, observed, strict=True):
                part[row] = functionals.partial(here)
            reach = np.max(np.abs(operators.probes.total(parts[0][row])), initial=0.0)
            if reach > farthest:
                farthest, peak, peak_field = reach, row, here.copy()
    probes, elongation = (f.total(part) for f, part in zip(observed, parts, strict=True))
    return History(archived, probes, elongation, peak, peak_field)
