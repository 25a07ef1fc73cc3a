"""Implicit time stepping in acceleration form, with uplift exact at every step and one factorisation in all.

Solving for the acceleration of `uplift.solvers.time_domain.scheme` keeps its digits when dt is small, where the difference of two
displacements over dt^2 would not.

The contacts stay bonded in K. What an open one must not carry is taken away by release forces on the right-hand side, which
follow exactly from the compliance of the contacts in one step: one extra solve for each contact before the first step, and then
one solve a step, as in a linear run.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from uplift.forms.operators import Operators
from uplift.solvers.contact.laws import contact_step
from uplift.solvers.contact.memory import ContactMemory, ContactStep, closed
from uplift.solvers.linear import SAME_PATTERN, SMALL, LinearSolver, definite_solver
from uplift.solvers.time_domain.balance import balance_acceleration
from uplift.solvers.time_domain.kept import Kept
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import Drive, Instants, State, add_push

FEW_CONTACTS = 16
"""Up to so many contacts it is quicker to take them all than to pick the open ones."""

COLUMNS_AT_ONCE = 64
"""Unit release forces that are solved for together."""

VECTORS = ("displacement", "velocity", "acceleration")


class ContactCompliance:
    """Answers of one factorised matrix to unit release forces, and the tensions that they make in the bonded contacts."""

    def __init__(self, operators: Operators, solver: LinearSolver, factor: float) -> None:
        """Solve once for each channel (collective); `factor` turns a solution into the displacement it stands for."""
        contacts = operators.contacts
        n = contacts.law.n_channels
        self.answers = np.zeros((n, operators.n_local))
        """(n_channels, n_local): solutions for unit release forces, this rank's rows."""
        pull = sparse.diags(contacts.law.stiffness) @ contacts.elongation.local
        self.pull = pull.toarray() if operators.n_local <= SMALL else pull.tocsr()
        """(n_channels, n_local) N/m: this rank's share of the tensions of the bonded contacts."""
        push = contacts.push.tocsc()
        for j in range(0, n, COLUMNS_AT_ONCE):
            self.answers[j : j + COLUMNS_AT_ONCE] = solver.solve_columns(push[:, j : j + COLUMNS_AT_ONCE].toarray()).T
        partial = np.asarray(contacts.elongation.local @ self.answers.T).T
        per_push = factor * contacts.elongation.total(partial).T
        self.matrix = contacts.law.stiffness[:, None] * per_push
        """(n_channels, n_channels): tension of channel i per unit release force of channel j, dimensionless."""


class Newmark:
    """A model on its way in steps of one length; `with` frees the factors."""

    block = 1
    """Instants at most that `advance` gives at once."""

    def __init__(
        self,
        operators: Operators,
        scheme: Scheme,
        step: float,
        *,
        damped: bool = True,
        exact_uplift: bool = False,
        prefix: str = "newmark_",
        rigid_modes: np.ndarray | None = None,
    ) -> None:
        """Factorise the effective matrix, or with the `rigid_modes` (k, n_local) set up its iterative solution (collective).

        `step` in s; `damped=False` leaves the damping out; `exact_uplift` finds the release forces at every step, else
        contacts stay bonded but for release forces that are given. Many parameters because each is a choice of its own.
        """
        self.operators = operators
        self.scheme = scheme
        self.step = step
        self.damping = operators.damping if damped else None
        inertia, damping, stiffness = scheme.effective(step)
        effective = operators.mass.copy()
        effective.scale(inertia)
        effective.axpy(stiffness, operators.stiffness, structure=SAME_PATTERN)
        if self.damping is not None:
            effective.axpy(damping, self.damping, structure=SAME_PATTERN)
        self._effective = effective
        self._rigid_modes = rigid_modes
        self.solver = definite_solver(effective, prefix, "time step", rigid_modes)
        self._right, self._work, self._mean = (operators.new_vector() for _ in range(3))
        self._solved = 0
        self._state: State | None = None
        self.contacts: ContactStep | None = None
        """None where contacts stay bonded."""
        if exact_uplift and operators.contacts.law.n_channels:
            # A release force r1 acts as (1 - alpha_f) r1 at the instant of balance and moves the contacts by beta dt^2 a1.
            self._compliance = ContactCompliance(operators, self.solver, stiffness)
            self.contacts = contact_step(operators.contacts.law, self._compliance.matrix, step)

    def __enter__(self) -> Newmark:
        """Return itself."""
        return self

    def __exit__(self, *args: object) -> None:
        """Free the factors, work vectors and the state."""
        self.solver.__exit__(*args)
        for thing in (self._effective, self._right, self._work, self._mean):
            thing.destroy()
        if self._state is not None:
            self._state.__exit__()

    @property
    def state(self) -> State:
        """The state that the last step has led to."""
        assert self._state is not None
        return self._state

    def begin(self, start: State, drive: Drive) -> Instants:
        """Take the state at time 0, which is left as it is, and find its acceleration (collective)."""
        self._take(start)
        state = self.state
        if drive.release is not None:
            state.contacts = ContactMemory(drive.release[0], np.zeros(0))
        elif self.contacts is None:
            state.contacts = closed(self.operators.contacts.law.n_channels)
        else:
            state.contacts = self.contacts.begin(state.contacts)
        damped = self.damping is not None
        balance_acceleration(self.operators, state, drive.values[0], self.step, damped=damped, rigid_modes=self._rigid_modes)
        return self._instants(0)

    def _take(self, start: State) -> None:
        if self._state is not None:
            self._state.__exit__()
        self._state = start.copy()

    def advance(self, drive: Drive, first: int, last: int) -> Instants:
        """Take the step that ends at instant `first`, which is `last` as well (collective)."""
        operators, scheme, state = self.operators, self.scheme, self.state
        right = self._balance(drive.values[last - 1], drive.values[last])
        before = state.release
        given = None if drive.release is None else drive.release[last]
        if given is not None:
            add_push(operators, (1 - scheme.alpha_f) * given + scheme.alpha_f * before, right)
        elif scheme.alpha_f != 0:
            add_push(operators, scheme.alpha_f * before, right)
        # The first step and every power of two are checked: cheap, and a factor gone bad is seen early.
        self.solver.solve(right, state.acceleration, check=(self._solved & (self._solved - 1)) == 0)
        self._solved += 1
        self._correct(state.acceleration)
        if given is not None:
            state.contacts = ContactMemory(given, state.contacts.inner)
        elif self.contacts is not None:
            self._release(self.contacts, drive.scale)
        return self._instants(last)

    def _instants(self, number: int) -> Instants:
        state = self.state
        u, v, a = (np.real(vector.array_r)[None] for vector in (state.displacement, state.velocity, state.acceleration))
        return Instants(number, u, v, a, state.release[None], state.contacts.inner[None])

    def _correct(self, acceleration: Any) -> None:
        """Add to displacement and velocity what an acceleration at the end of the step makes of them."""
        moved, faster = self.scheme.corrector(self.step)
        self.state.displacement.axpy(moved, acceleration)
        self.state.velocity.axpy(faster, acceleration)

    def _balance(self, before: np.ndarray, now: np.ndarray) -> Any:
        """Bring displacement and velocity to their known parts one step later; return the right-hand side without release forces.

        `before` and `now` are the values (n_loads,) of the load histories at the beginning and the end of the step.
        """
        operators, scheme, state, right = self.operators, self.scheme, self.state, self._right
        keep, old = 1 - scheme.alpha_f, scheme.alpha_f
        right.zeroEntries()
        for value, load in zip(keep * now + old * before, operators.loads, strict=True):
            if value != 0:
                right.axpy(value, load.vector)
        if scheme.alpha_m != 0:
            operators.mass.mult(state.acceleration, self._work)
            right.axpy(-scheme.alpha_m, self._work)
        u, v, a = state.displacement, state.velocity, state.acceleration
        (ahead, curved), faster = scheme.predictor(self.step)
        for vector, matrix, changes in (
            (u, operators.stiffness, ((ahead, v), (curved, a))),
            (v, self.damping, ((faster, a),)),
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

    def _release(self, contacts: ContactStep, scale: float) -> None:
        """Find the release forces and add the motion that they cause to a state without them."""
        state = self.state
        elongation = self.operators.contacts.elongation
        tension = elongation.total(self._compliance.pull @ np.real(state.displacement.array_r))
        state.contacts = contacts.advance(tension, state.contacts, scale)
        release = state.release
        if release.any():
            acting = np.flatnonzero(release) if len(release) > FEW_CONTACTS else slice(None)
            self._work.array[:] = ((1 - self.scheme.alpha_f) * release[acting]) @ self._compliance.answers[acting]
            state.acceleration.axpy(1.0, self._work)
            self._correct(self._work)

    def kept(self) -> Kept:
        """Return what a checkpoint has to keep."""
        state = self.state
        fields = {name: np.real(getattr(state, name).array_r) for name in VECTORS}
        same = {"release": state.release, "inner": state.contacts.inner}
        return Kept(same | (self.contacts.counts() if self.contacts is not None else {}), fields=fields)

    def restore(self, start: State, kept: Kept) -> None:
        """Take in again what `kept` gave, in place of the state of time 0."""
        self._take(start)
        for name in VECTORS:
            getattr(self.state, name).array[:] = kept.fields[name]
        self.state.contacts = ContactMemory(kept.same["release"], kept.same["inner"])
        if self.contacts is not None:
            self.contacts.recount(kept.same)
