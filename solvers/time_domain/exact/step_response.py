"""Responses of the bonded system over one step to loads and to contact forces that are polynomials in time.

For a force P s^k / T^k from 0 to T the state moves by Psi_k(T) = integral of exp(A (T - s)) P (s / T)^k ds. It is a Taylor series for
a short T, and for twice the time Psi_k(2 T) = 2^-k (exp(A T) Psi_k(T) + sum over i of binomial(k, i) Psi_i(T)). That needs no
eigenvectors, which a system with free motions or critical damping lacks, and does not divide by A.
"""

from __future__ import annotations

import math

import numpy as np

from uplift.solvers.time_domain.exact.contact_set import Augmented
from uplift.solvers.time_domain.exact.propagators import TERMS, doubled, halvings

KINK_POINTS = 12
"""Equidistant fractions of a step between which responses to forces that begin inside it are interpolated."""


def lobatto(order: int) -> np.ndarray:
    """Return the points (order + 1,) of Lobatto's rule on the interval from 0 to 1, for order 1, 2 or 3."""
    inner = {1: [], 2: [0.5], 3: [0.5 - 0.5 / math.sqrt(5), 0.5 + 0.5 / math.sqrt(5)]}[order]
    return np.array([0.0, *inner, 1.0])


def moments(generator: np.ndarray, push: np.ndarray, time: float, highest: int) -> tuple[np.ndarray, np.ndarray]:
    """Return exp(A T) - 1 (n, n) and Psi_k(T) P (highest + 1, n, n_c) for k = 0 ... `highest`."""
    levels = halvings(generator, time)
    steps = doubled(generator, time, levels)
    short = time / 2**levels
    terms = [push * short]
    for m in range(1, TERMS + 1):
        terms.append(generator @ terms[-1] * (short / m))
    # The integral of (T - s)^m s^k / (m! T^(m + k + 1)) is k! / (m + k + 1)!.
    found = np.stack([
        sum(term * (math.factorial(m) * math.factorial(k) / math.factorial(m + k + 1)) for m, term in enumerate(terms))
        for k in range(highest + 1)
    ])
    for level in range(levels, 0, -1):
        found = _joined(found, found + steps[level] @ found, 0.5)
    return steps[0], found


def _joined(later: np.ndarray, carried: np.ndarray, share: float) -> np.ndarray:
    """Return Psi_k of two times one after the other, the second 1 - `share` of their sum, from Psi_k of both, the first carried on."""
    highest = len(later) - 1
    found = [
        share**k * carried[k]
        + sum(math.comb(k, i) * share ** (k - i) * (1 - share) ** i * later[i] for i in range(k + 1))
        for k in range(highest + 1)
    ]
    return np.stack(found)


class StepResponse:
    """Constant matrices of one step of a length h; N states with the loads, n of them the system's, n_c contacts."""

    def __init__(self, base: Augmented, length: float, order: int) -> None:
        """Take the length of the step in s and the degree of the contact forces in it."""
        system, n = base.system, base.n
        generator = base.shift.copy()
        generator[:n] += base.rows(system.A, system.B)
        self.length, self.points = length, lobatto(order)
        self.tension = base.rows(system.Q, system.D)
        """(n_c, N) N: tensions at once."""
        powers = np.linalg.inv(np.vander(self.points, increasing=True))
        self.powers = powers
        """(order + 1, order + 1): powers of s / h from values at the points."""
        free, forced = [], []
        for point in self.points[1:]:
            step, psi = moments(generator, np.vstack([system.P, np.zeros((base.size - n, system.P.shape[1]))]), point * length, order)
            free.append(self.tension + self.tension @ step)
            whole = np.einsum("k,kl,knc->lnc", point ** np.arange(order + 1), powers, psi[:, :n], optimize=True)
            forced.append(np.einsum("in,lnc->ilc", system.Q, whole, optimize=True))
        self.free = np.concatenate(free)
        """(order * n_c, N) N: tensions at the points after the first without release forces in the step."""
        n_c = len(system.Q)
        self.forced = np.stack(forced).reshape(order * n_c, (order + 1) * n_c)
        """Tensions there per release force at the points."""
        for j in range(order):
            self.forced[j * n_c : (j + 1) * n_c, (j + 1) * n_c : (j + 2) * n_c] += system.E
        self.step = step
        """exp(G h) - 1 (N, N)."""
        self.end = np.ascontiguousarray(whole.transpose(1, 0, 2).reshape(n, -1))
        """(n, (order + 1) * n_c): the state at the end per release force at the points."""
        self._kinks: np.ndarray | None = None
        self._system, self._order = system, order

    def from_kinks(self, contacts: np.ndarray, begins: np.ndarray, powers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what forces that begin inside the step add to the tensions at its points (order, n_c) and to the state at its end (n,).

        Kink b is on contact `contacts[b]`, begins at the fraction `begins[b]` and is sum over k of `powers[b, k]` ((s - begin) / h)^k.
        """
        table, n_c = self._kink_table(), len(self._system.Q)
        tensions, state = np.zeros((self._order, n_c)), np.zeros(len(self._system.A))
        degrees = np.arange(self._order + 1)
        for contact, begin, coefficients in zip(contacts, begins, powers, strict=True):
            for j, point in enumerate(self.points[1:]):
                if point <= begin:
                    continue
                # The table is in powers of s over the time that is left.
                weighted = np.outer(_lagrange(point - begin), coefficients * (point - begin) ** degrees).ravel()
                here = weighted @ table[contact][:, : n_c if j < self._order - 1 else None]
                tensions[j] += here[:n_c]
                if j == self._order - 1:
                    state += here[n_c:]
        return tensions, state

    def _kink_table(self) -> np.ndarray:
        """Return (n_c, (KINK_POINTS + 1) * (order + 1), n_c + n): tensions and state after each fraction of the step, by contact."""
        if self._kinks is None:
            system, order = self._system, self._order
            step, first = moments(system.A, system.P, self.length / KINK_POINTS, order)
            found = [np.zeros_like(first), first]
            for m in range(1, KINK_POINTS):
                found.append(_joined(first, found[-1] + step @ found[-1], m / (m + 1)))
            state = np.stack(found)
            whole = np.concatenate([np.einsum("in,mknc->mkic", system.Q, state, optimize=True), state], axis=2)
            self._kinks = np.ascontiguousarray(whole.transpose(3, 0, 1, 2)).reshape(len(system.Q), -1, len(system.Q) + len(system.A))
        return self._kinks


def _lagrange(at: float) -> np.ndarray:
    """Return the weights (KINK_POINTS + 1,) of values at equidistant points from 0 to 1 in their interpolation."""
    scaled = at * KINK_POINTS - np.arange(KINK_POINTS + 1)
    hit = np.flatnonzero(np.abs(scaled) < 1e-12)
    if hit.size:
        return np.eye(KINK_POINTS + 1)[hit[0]]
    weights = _BARYCENTRIC / scaled
    normalised: np.ndarray = weights / weights.sum()
    return normalised


_BARYCENTRIC = np.array([(-1.0) ** k * math.comb(KINK_POINTS, k) for k in range(KINK_POINTS + 1)])
