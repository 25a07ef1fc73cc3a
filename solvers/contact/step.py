"""The small problem of uplift: which contacts are open at one instant, and with which release forces.

With q the tensions of the bonded contacts under everything but the release forces of this instant, and D their change per
unit release force, find for the normal channels

    f = q + D r - r <= 0  (no tension is left),   r >= 0  (the ground never pulls),   f r = 0.

I - D is a P-matrix (it is similar to a symmetric positive definite one: a spring takes less than the whole force put on
its end), so there is exactly one answer.

A sideways force that is released follows the state of its contact one step behind: it is free (no force is left) in the step
after one that ended with the contact open, and held otherwise. Released at once, it could leave a contact with no answer:
pulled open by the very force that its opening takes away.

Block principal pivoting finds it, in one try where no contact changes; where
blocks should cycle, single pivots by lowest index, which cannot, take over.
Sources: Cottle, Pang and Stone, The Linear Complementarity Problem, chapters 3 and 4; Judice and Pires, Comput. Oper. Res. 21 (1994) 587.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from uplift.forms.contact.law import UpliftLaw
from uplift.meshes.checked import ModelError
from uplift.solvers.errors import SolverError

KEPT_FACTORS = 2**28
"""Bytes of factors that are kept, beside the last."""


class ContactProblem:
    """The problem for one compliance D; factors are kept for every set of open contacts that has occurred."""

    def __init__(self, law: UpliftLaw, compliance: np.ndarray) -> None:
        """Take D (n_channels, n_channels): tension of channel i per unit release force of channel j, dimensionless."""
        self.law = law
        self.compliance = np.asarray(compliance, dtype=float)
        self._less_one = self.compliance - np.eye(len(self.compliance))
        self.tries = 0
        self.solved = 0
        self._factors: dict[bytes, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
        self._kept = 0
        self._tied = self.law.n_channels > self.law.n_contacts

    def solve(self, tension: np.ndarray, before: np.ndarray, scale: float = 0.0) -> np.ndarray:
        """Return the release forces r (n_channels,) in N.

        `tension` is q; `before` holds the release forces of the instant before: its open contacts are the first guess, and
        a sideways release force keeps its value where the contact is closed. Forces below 1e-12 of the largest tension or
        of `scale` N count as zero. Raises `SolverError` if there is no answer.
        """
        n_c = self.law.n_contacts
        self.solved += 1
        if n_c == 0:
            return np.zeros(0)
        open_ = before[:n_c] > 0
        if not self._tied and not open_.any() and tension.max() <= 1e-12 * scale:
            self.tries += 1
            return np.zeros(n_c)
        largest = np.abs(tension).max()
        if not np.isfinite(largest):
            raise SolverError("the contact forces are no longer finite: the time integration has diverged")
        small = 1e-12 * max(largest, scale)
        best, patience = n_c + 1, 10
        while True:
            self.tries += 1
            release = self._for_set(open_, tension, before)
            left = tension + self._less_one @ release
            excess = np.where(open_, -release[:n_c], left[:n_c])
            if excess.max() <= small:
                np.maximum(release[:n_c], 0.0, out=release[:n_c])
                return release
            wrong = excess > small
            count = int(wrong.sum())
            if count < best:
                best, patience = count, 10
            else:
                patience -= 1
            if patience > 0:
                open_ = open_ ^ wrong
            else:
                open_ = open_.copy()
                open_[int(np.argmax(wrong))] ^= True
            if patience < -20 * (n_c + 10):
                raise SolverError("the open contacts of a time step cannot be found")

    def shift(self, least: np.ndarray) -> np.ndarray:
        """Return what release forces `least` (n_c,) N of the normal channels add to the net tensions (n_channels,) N of the contacts."""
        return self._less_one[:, : self.law.n_contacts] @ least

    def _for_set(self, open_: np.ndarray, tension: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the release forces if just the contacts `open_` (n_c,) are open."""
        n_c = self.law.n_contacts
        release = before.copy()
        release[:n_c] = 0.0
        free = open_
        if self._tied:
            free = np.concatenate([open_, before[self.law.owner[n_c:]] > 0])
            release[free] = 0.0
            tension = tension + self.compliance[:, n_c:] @ release[n_c:]
        index, factor, pivots = self._factored(free)
        if not index.size:
            return release
        release[index], _ = lapack.dgetrs(factor, pivots, tension[index])
        return release

    def _factored(self, free: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the channels `free` (n_channels,) or (n_c,) by number and the factors of their block of I - D."""
        key = free.tobytes()
        if key not in self._factors:
            block = -self._less_one[np.ix_(free, free)]
            factor, pivots, failed = lapack.dgetrf(block, overwrite_a=True) if free.any() else (block, block, 0)
            if failed:
                raise SolverError("a set of open contacts leaves the structure without an answer")
            if self._kept + factor.nbytes + len(key) > KEPT_FACTORS:
                self._factors.clear()
                self._kept = 0
            self._factors[key] = np.flatnonzero(free), factor, pivots
            self._kept += factor.nbytes + len(key)
        return self._factors[key]

    def least_stiffness(self, open_: np.ndarray) -> float:
        """Return the stiffness that is left with the contacts `open_` (n_c,) open, as a part of theirs.

        It is the smallest singular value of their block of I - D, by inverse iteration on its factors: from above, to some percent,
        and the closer the nearer it is to zero.
        """
        index, factor, pivots = self._factored(open_)
        if not index.size:
            return 1.0
        vector = np.cos(np.arange(index.size))  # no symmetry of a structure makes this one orthogonal to the answer
        largest = 0.0
        for _ in range(INVERSE_ITERATIONS):
            vector /= np.linalg.norm(vector)
            once, _ = lapack.dgetrs(factor, pivots, vector)
            vector, _ = lapack.dgetrs(factor, pivots, once, trans=1)
            largest = max(largest, float(np.linalg.norm(once)))
            if not np.isfinite(largest):
                return 0.0
        return 1.0 / largest


INVERSE_ITERATIONS = 8
"""Where the smallest singular value is a hundredth of the next, two are enough."""


def pulls(law: UpliftLaw, tension: np.ndarray, scale: float) -> bool:
    """Tell whether a bonded contact pulls, by its tensions (n_channels,) N; else none opens. `scale` is that of `ContactProblem.solve`."""
    return bool(np.max(tension[: law.n_contacts]) > 1e-12 * max(np.max(np.abs(tension)), scale))


STATIC_ROUNDS = 10
"""Sideways forces follow the contacts one round behind; more than a few rounds means that there is no lasting answer."""


def settled_release(problem: ContactProblem, tension: np.ndarray, scale: float) -> np.ndarray:
    """Return the release forces (n_channels,) N of a state that lasts, from the tensions (n_channels,) N of the bonded contacts.

    `scale` in N is that of `ContactProblem.solve`. Raises `ModelError` if the loads lift or tip the structure off its contacts
    and nothing else holds it.
    """
    release = np.zeros(problem.law.n_channels)
    try:
        for _ in range(STATIC_ROUNDS):
            before, release = release, problem.solve(tension, release, scale)
            if np.array_equal(before > 0, release > 0):
                break
    except SolverError:
        raise _not_held() from None
    try:
        left = problem.least_stiffness(release[: problem.law.n_contacts] > 0)
    except SolverError:
        left = 0.0
    if left < HELD:
        raise _not_held()
    return release


HELD = 1e-12
"""A structure that keeps less than this part of the stiffness of its open contacts is held by round-off."""


def _not_held() -> ModelError:
    return ModelError(
        "supports", "the static loads lift or tip the plate off its supports, and nothing else holds it: it has no static state; "
        "hold it by a spring, or let a transient run begin with start = 'rest'"
    )
