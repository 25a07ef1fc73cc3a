"""Implicit time integration in acceleration form, with uplift exact at every step and one factorisation in all.

u1 = u0 + dt v0 + dt^2 ((1/2 - beta) a0 + beta a1),  v1 = v0 + dt ((1 - gamma) a0 + gamma a1), and with * for the known parts of u1, v1,

    A a1 = f_alpha - alpha_m M a0 - C v_alpha* - K u_alpha*,    A = (1 - alpha_m) M + (1 - alpha_f) (gamma dt C + beta dt^2 K),

x_alpha = (1 - alpha_f) x1 + alpha_f x0. Newmark's method is alpha_m = alpha_f = 0. Second order for gamma = 1/2 - alpha_m + alpha_f, else
first; unconditionally stable for the parameters that `Scheme` admits. Solving for the acceleration keeps its digits when dt
is small, where the difference of two displacements over dt^2 would not.

The contacts stay bonded in K. What an open one must not carry is taken away by release forces on the right-hand side, which
follow exactly from the compliance of the contacts in one step: one extra solve for each contact before the first step, and then
one solve a step, as in a linear run.

Sources: N. M. Newmark, J. Eng. Mech. Div. ASCE 85 (1959) 67; Hughes, The Finite Element Method, chapter 9; Chung and Hulbert,
J. Appl. Mech. 60 (1993) 371.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from uplift.forms.operators import Operators
from uplift.solvers.contact.auxiliary_nodes import FreeNodes
from uplift.solvers.contact.step import ContactProblem
from uplift.solvers.linear import SAME_PATTERN, SMALL, LinearSolver, definite_solver
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import State, add_push

FEW = 16
"""Up to so many contacts it is quicker to take them all than to pick the open ones."""


class ContactCompliance:
    """Answers of one factorised matrix to unit release forces, and the contact problem they make."""

    def __init__(self, operators: Operators, solver: LinearSolver, factor: float) -> None:
        """Solve once for each channel (collective); `factor` turns a solution into the displacement it stands for."""
        contacts = operators.contacts
        n = contacts.law.n_channels
        self.answers = np.zeros((n, operators.n_local))
        """(n_channels, n_local): solutions for unit release forces, this rank's rows."""
        pull = sparse.diags(contacts.law.stiffness) @ contacts.elongation.local
        self.pull = pull.toarray() if operators.n_local <= SMALL else pull.tocsr()
        """(n_channels, n_local) N/m: this rank's share of the tensions of the bonded contacts."""
        right, solution = operators.new_vector(), operators.new_vector()
        for j in range(n):
            right.array[:] = contacts.push[:, [j]].toarray().ravel()
            solver.solve(right, solution, check=True)
            self.answers[j] = np.real(solution.array_r)
        right.destroy()
        solution.destroy()
        partial = np.stack([contacts.elongation.partial(answer) for answer in self.answers]) if n else np.zeros((0, 0))
        per_push = factor * contacts.elongation.total(partial).T
        self.problem = ContactProblem(contacts.law, contacts.law.stiffness[:, None] * per_push)


class Newmark:
    """Time stepping of one model with one step length; `with` frees the factors."""

    def __init__(
        self,
        operators: Operators,
        scheme: Scheme,
        step: float,
        *,
        damped: bool = True,
        exact_uplift: bool = False,
        prefix: str = "newmark_",
        motions: np.ndarray | None = None,
    ) -> None:
        """Factorise the effective matrix, or with the rigid `motions` (k, n_local) set up its iterative solution (collective).

        `step` in s; `damped=False` leaves the damping out; `exact_uplift` finds the release forces at every step, else
        contacts stay bonded but for release forces that are given.
        """
        self.operators = operators
        self.scheme = scheme
        self.step = step
        self.damping = operators.damping if damped else None
        keep = 1 - scheme.alpha_f
        effective = operators.mass.copy()
        effective.scale(1 - scheme.alpha_m)
        effective.axpy(keep * scheme.beta * step**2, operators.stiffness, structure=SAME_PATTERN)
        if self.damping is not None:
            effective.axpy(keep * scheme.gamma * step, self.damping, structure=SAME_PATTERN)
        self._effective = effective
        self.motions = motions
        self.solver = definite_solver(effective, prefix, "time step", motions)
        self._right, self._work, self._mean = (operators.new_vector() for _ in range(3))
        self._steps = 0
        self.load_scale = 0.0
        """Forces below 1e-12 of this, in N, are round-off to the contacts."""
        self.nodes = FreeNodes(operators.contacts.law, step)
        self.compliance: ContactCompliance | None = None
        if exact_uplift and operators.contacts.law.n_channels:
            # A release force r1 acts as (1 - alpha_f) r1 at the instant of balance and moves the contacts by beta dt^2 a1.
            self.compliance = ContactCompliance(operators, self.solver, keep * scheme.beta * step**2)

    def __enter__(self) -> Newmark:
        """Return itself."""
        return self

    def __exit__(self, *args: object) -> None:
        """Free the factors and work vectors."""
        self.solver.__exit__(*args)
        for thing in (self._effective, self._right, self._work, self._mean):
            thing.destroy()

    def advance(self, state: State, loads: tuple[np.ndarray, np.ndarray], given: np.ndarray | None = None) -> None:
        """Replace `state` by the state one step later (collective).

        `loads` are the values (n_loads,) of the load histories at the beginning and the end of the step. `given`
        (n_channels,) N are the release forces at its end; without them they are exact, or zero if uplift is not exact.
        """
        scheme, dt = self.scheme, self.step
        right = self._balance(state, loads)
        before = state.release
        if given is not None:
            state.release = given
            add_push(self.operators, (1 - scheme.alpha_f) * given + scheme.alpha_f * before, right)
        elif scheme.alpha_f != 0:
            add_push(self.operators, scheme.alpha_f * before, right)
        # The first step and every power of two are checked: cheap, and a factor gone bad is seen early.
        self.solver.solve(right, state.acceleration, check=(self._steps & (self._steps - 1)) == 0)
        self._steps += 1
        state.displacement.axpy(dt**2 * scheme.beta, state.acceleration)
        state.velocity.axpy(dt * scheme.gamma, state.acceleration)
        if self.compliance is not None and given is None:
            self._release(state, before)

    def _balance(self, state: State, loads: tuple[np.ndarray, np.ndarray]) -> Any:
        """Bring displacement and velocity to their known parts one step later; return the right-hand side without release forces."""
        operators, scheme, dt, right = self.operators, self.scheme, self.step, self._right
        keep, old = 1 - scheme.alpha_f, scheme.alpha_f
        right.zeroEntries()
        for value, load in zip(keep * loads[1] + old * loads[0], operators.loads, strict=True):
            if value != 0:
                right.axpy(value, load.vector)
        if scheme.alpha_m != 0:
            operators.mass.mult(state.acceleration, self._work)
            right.axpy(-scheme.alpha_m, self._work)
        u, v, a = state.displacement, state.velocity, state.acceleration
        for vector, matrix, changes in (
            (u, operators.stiffness, ((dt, v), (dt**2 * (0.5 - scheme.beta), a))),
            (v, self.damping, ((dt * (1 - scheme.gamma), a),)),
        ):
            if old != 0:
                vector.copy(self._mean)
            for factor, rate in changes:
                if factor != 0:
                    vector.axpy(factor, rate)
            if matrix is None:
                continue
            if old != 0:
                self._mean.axpby(keep, old, vector)
            matrix.mult(self._mean if old != 0 else vector, self._work)
            right.axpy(-1.0, self._work)
        return right

    def _release(self, state: State, before: np.ndarray) -> None:
        """Find the release forces and add the motion that they cause to a state without them."""
        scheme, compliance = self.scheme, self.compliance
        assert compliance is not None
        elongation = self.operators.contacts.elongation
        tension = elongation.total(compliance.pull @ np.real(state.displacement.array_r))
        if self.nodes.any:
            motion = self.nodes.still(before) if state.nodes is None else state.nodes
            state.release, state.nodes = self.nodes.solve(compliance.problem, tension, before, motion, self.load_scale)
        else:
            state.release = compliance.problem.solve(tension, before, self.load_scale)
        if state.release.any():
            acting = np.flatnonzero(state.release) if len(state.release) > FEW else slice(None)
            self._work.array[:] = ((1 - scheme.alpha_f) * state.release[acting]) @ compliance.answers[acting]
            state.acceleration.axpy(1.0, self._work)
            state.displacement.axpy(self.step**2 * scheme.beta, self._work)
            state.velocity.axpy(self.step * scheme.gamma, self._work)
