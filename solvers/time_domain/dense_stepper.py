"""Time stepping of a model in a basis: one product of a small dense matrix a step.

a1 = R [u_alpha*, v_alpha*, d_alpha], d the loads and contact forces, with R from one Cholesky factorisation of the effective matrix of
`uplift.solvers.time_domain.scheme`: a step is one product of a dense m x (2 m + n_d) matrix and a few sums of vectors. 5,000 steps take
0.04 s with 20 vectors and 0.25 s with 100. Velocities are times dt and accelerations times dt^2, so that all parts keep one size, whatever
the frequency of a vector. All ranks do the same.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from uplift.forms.operators import Operators
from uplift.solvers.contact.laws import contact_step
from uplift.solvers.contact.memory import ContactMemory, ContactStep, closed
from uplift.solvers.dense import solve_definite
from uplift.solvers.time_domain.kept import Kept
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import Drive, Instants, State


class DenseStepper:
    """A model in a basis on its way in steps of one length."""

    block = 256
    """Instants at most that `advance` gives at once."""

    def __init__(self, operators: Operators, scheme: Scheme, step: float, *, exact_uplift: bool = False) -> None:
        """Factorise the effective matrix; `step` in s; `exact_uplift` finds the release forces at every step."""
        self.operators, self.scheme, self.step = operators, scheme, step
        m, law = operators.n, operators.contacts.law
        self._mass = _array(operators.mass)
        damping = step * _array(operators.damping) if operators.damping is not None else np.zeros((m, m))
        stiffness = step**2 * _array(operators.stiffness)
        loads = [np.real(load.vector.array_r) for load in operators.loads]
        forces = np.column_stack([*loads, operators.contacts.push.toarray()]) if loads else operators.contacts.push.toarray()
        self._balance = np.hstack([-stiffness, -damping, step**2 * forces])
        inertia, damped, stiff = scheme.effective(1.0)
        effective = inertia * self._mass + damped * damping + stiff * stiffness
        self._answer = solve_definite(effective, self._balance, "reduced time step")
        self._carried = solve_definite(effective, -scheme.alpha_m * self._mass, "reduced time step") if scheme.alpha_m else None
        # A release force r1 acts as (1 - alpha_f) r1 at the instant of balance and moves the contacts by beta a1.
        self._per_release = (1 - scheme.alpha_f) * self._answer[:, m + m + len(loads) :]
        self._pull = law.stiffness[:, None] * operators.contacts.elongation.local.toarray()
        self.contacts: ContactStep | None = None
        """None where contacts stay bonded."""
        if exact_uplift and law.n_channels:
            moved, _ = scheme.corrector(1.0)
            self.contacts = contact_step(law, moved * (self._pull @ self._per_release), step)
        self._known = np.zeros(2 * m + len(loads) + law.n_channels)
        """(q, dt q', loads, release forces) at the last instant; views of it: motion, loads, release."""
        self._motion = self._known[: 2 * m].reshape(2, m)
        self._loads, self._release = np.split(self._known[2 * m :], [len(loads)])
        self._acceleration = np.zeros(m)
        self._memory = closed(law.n_channels)

    def __enter__(self) -> DenseStepper:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Do nothing: all that it holds is arrays."""

    def begin(self, start: State, drive: Drive) -> Instants:
        """Take the state at time 0, which is left as it is, and find its acceleration."""
        if drive.release is not None:
            self._memory = ContactMemory(drive.release[0], np.zeros(0))
        elif self.contacts is None:
            self._memory = closed(len(start.release))
        else:
            self._memory = self.contacts.begin(start.contacts)
        self._motion[0], self._motion[1] = np.real(start.displacement.array_r), self.step * np.real(start.velocity.array_r)
        self._loads[:], self._release[:] = drive.values[0], self._memory.release
        self._acceleration = self._balanced(self._balance @ self._known)
        return self._instants(0, self._motion[None].copy(), self._acceleration[None], [self._memory])

    def _balanced(self, force: np.ndarray) -> np.ndarray:
        """Return dt^2 times the acceleration that forces (m,), times dt^2, ask for.

        Coordinates without mass follow from their equilibrium, differentiated twice.
        """
        heavy = np.diag(self._mass) != 0
        acceleration = np.zeros(len(force))
        acceleration[heavy] = solve_definite(self._mass[np.ix_(heavy, heavy)], force[heavy], "reduced initial acceleration")
        if not heavy.all():
            stiffness = _array(self.operators.stiffness)[~heavy]
            right = -stiffness @ acceleration
            acceleration[~heavy] = solve_definite(stiffness[:, ~heavy], right, "reduced initial acceleration")
        return acceleration

    def advance(self, drive: Drive, first: int, last: int) -> Instants:
        """Take the steps that end at the instants `first` to `last`."""
        scheme, old_share, contacts = self.scheme, self.scheme.alpha_f, self.contacts if drive.release is None else None
        moved, faster = scheme.corrector(1.0)
        new = np.array([[moved], [faster]])
        (_, curved), gained = scheme.predictor(1.0)
        old = np.array([[curved], [gained]])
        known, motion, acceleration, memory = self._known, self._motion, self._acceleration, self._memory
        motions, accelerations = np.empty((last - first + 1, *motion.shape)), np.empty((last - first + 1, len(acceleration)))
        memories = []
        answer, pull, per_release = self._answer, self._pull, self._per_release
        for k, n in enumerate(range(first, last + 1)):
            before = known.copy() if old_share else known
            motion[0] += motion[1]
            motion += old * acceleration
            self._loads[:] = drive.values[n]
            self._release[:] = 0.0 if drive.release is None else drive.release[n]
            acting = (1 - old_share) * known + old_share * before if old_share else known
            acceleration = answer @ acting if self._carried is None else answer @ acting + self._carried @ acceleration
            if contacts is not None:
                memory = contacts.advance(pull @ (motion[0] + moved * acceleration), memory, drive.scale)
                self._release[:] = memory.release
                acceleration += per_release @ memory.release
            elif drive.release is not None:
                memory = ContactMemory(drive.release[n], memory.inner)
            motion += new * acceleration
            motions[k], accelerations[k] = motion, acceleration
            memories.append(memory)
        self._acceleration, self._memory = acceleration, memory
        return self._instants(first, motions, accelerations, memories)

    def _instants(self, first: int, motions: np.ndarray, accelerations: np.ndarray, memories: list[ContactMemory]) -> Instants:
        release, inner = np.array([memory.release for memory in memories]), np.array([memory.inner for memory in memories])
        return Instants(first, motions[:, 0], motions[:, 1] / self.step, accelerations / self.step**2, release, inner)

    def kept(self) -> Kept:
        """Return what a checkpoint has to keep."""
        same = {"known": self._known, "acceleration": self._acceleration, "release": self._memory.release, "inner": self._memory.inner}
        return Kept(same | (self.contacts.counts() if self.contacts is not None else {}))

    def restore(self, start: State, kept: Kept) -> None:
        """Take in again what `kept` gave, in place of the state of time 0."""
        self._known[:] = kept.same["known"]
        self._acceleration = kept.same["acceleration"]
        self._memory = ContactMemory(kept.same["release"], kept.same["inner"])
        if self.contacts is not None:
            self.contacts.recount(kept.same)


def _array(matrix: Any) -> np.ndarray:
    return np.real(matrix.getDenseArray()).copy()
