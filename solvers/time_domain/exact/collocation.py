"""Exponential collocation: contact forces as polynomials in time, everything linear exact.

In a step h the tensions of the bonded contacts at Lobatto's points are q = q_free + G r, with r the release forces there and constant G.
Where a contact is open throughout, r = q; where it is closed, r = 0. Both sides of the equation are iterated, which contracts by
(w h)^2 / 2 or better, w the contacts' frequency. A contact that opens or closes at a fraction b of the step carries the polynomial of q
from b on, or up to it: its response is that of a force that begins inside the step, and no kink is smeared.

While no contact changes, polynomials of degree 2 and 3 are of order 4 and 6; with kinks the order is about 3 (measured in the tests).
Stable for any frequency of the structure, since that part is exact; the iteration needs w h <= 1.
"""

from __future__ import annotations

import math

import numpy as np

from uplift.solvers.errors import SolverError
from uplift.solvers.time_domain.exact.contact_set import Augmented
from uplift.solvers.time_domain.exact.first_order import FirstOrder
from uplift.solvers.time_domain.exact.forcing import Forcing
from uplift.solvers.time_domain.exact.step_response import StepResponse

ITERATIONS = 200
SETTLED = 1e-12
"""The iteration ends when release forces change by less than this part of the largest."""
SAMPLES = 12
"""Equidistant points of a step between which a contact changes at most once."""


class Collocation:
    """The march of one system under one set of loads with a polynomial degree and a longest step."""

    def __init__(self, system: FirstOrder, loads: Forcing, order: int, longest: float) -> None:
        """Take the degree of the contact forces, 2 or 3, and the longest step in s; every interval of the loads is divided evenly."""
        self.base, self._loads, self._order = Augmented(system, loads), loads, order
        self._divisions = np.maximum(1, np.ceil(loads.lengths / longest * (1 - 1e-9))).astype(int)
        self._responses: dict[float, StepResponse] = {}
        at = np.linspace(0.0, 1.0, SAMPLES + 1)
        self._at, self._sample_powers = at, np.vander(at, order + 1, increasing=True)
        self.steps = self.iterations = self.kinks = 0

    def run(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return states (n_edges, N) and release forces (n_edges, n_c) N at the edges of the loads, from the state (n,) at the first."""
        base, loads = self.base, self._loads
        whole = np.zeros(base.size)
        whole[: base.n], whole[base.n] = state, 1.0
        states, releases = [], []
        guess: np.ndarray | None = None
        for length, divisions, coefficients in zip(loads.lengths, self._divisions.tolist(), loads.coefficients, strict=True):
            whole[base.n + 1 :] = coefficients.ravel()
            response = self._response(length / divisions)
            first = self._tension_now(response, whole)
            states.append(whole.copy())
            releases.append(np.maximum(first, 0.0))
            for _ in range(divisions):
                whole, guess = self._advance(response, whole, first, guess)
                first = guess[-1]
        states.append(whole)
        releases.append(np.maximum(self._tension_now(response, whole), 0.0))
        return np.array(states), np.array(releases)

    def _response(self, length: float) -> StepResponse:
        key = float(f"{length:.9e}")
        if key not in self._responses:
            self._responses[key] = StepResponse(self.base, length, self._order)
        return self._responses[key]

    def _tension_now(self, response: StepResponse, state: np.ndarray) -> np.ndarray:
        """Return the tensions (n_c,) N at one instant under the release forces that follow from them."""
        E = self.base.system.E
        known = response.tension @ state
        tension = known
        for _ in range(ITERATIONS):
            new = known + E @ np.maximum(tension, 0.0)
            if np.abs(new - tension).max(initial=0.0) <= SETTLED * np.abs(new).max(initial=0.0):
                return new
            tension = new
        raise SolverError("the contact forces of an instant do not settle: take the march from event to event")

    def _advance(
        self, response: StepResponse, state: np.ndarray, first: np.ndarray, guess: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the state (N,) a step later and the tensions (order + 1, n_c) N at its points.

        `first` (n_c,) are the tensions at its beginning, `guess` those at the points of the step before.
        """
        n_c, free = len(first), response.free @ state
        tension = self._extrapolated(response, first, guess)
        release, more = np.maximum(tension, 0.0), np.zeros(0)
        for _ in range(ITERATIONS):
            self.iterations += 1
            kinks = self._found(response, tension)
            release = np.where((tension > 0) if kinks is None else np.where(kinks[3], tension[0] > 0, tension > 0), tension, 0.0)
            answer = free + response.forced @ release.ravel()
            if kinks is not None:
                added, more = response.from_kinks(*kinks[:3])
                answer = answer + added.ravel()
            new = np.concatenate([first, answer]).reshape(-1, n_c)
            change, tension = np.abs(new - tension).max(initial=0.0), new
            if change <= SETTLED * np.abs(new).max(initial=0.0):
                break
        else:
            raise SolverError("contact forces do not settle within a step: take shorter steps, or the march from event to event")
        self.steps += 1
        later = state + response.step @ state
        later[: self.base.n] += response.end @ release.ravel()
        if kinks is not None:
            later[: self.base.n] += more
            self.kinks += len(kinks[0])
        return later, tension

    def _extrapolated(self, response: StepResponse, first: np.ndarray, guess: np.ndarray | None) -> np.ndarray:
        """Return a first guess (order + 1, n_c) of the tensions: the polynomial of the step before, moved to begin at `first`."""
        if guess is None:
            return np.repeat(first[None], self._order + 1, axis=0)
        ahead = np.vander(1 + response.points, self._order + 1, increasing=True) @ (response.powers @ guess)
        tension: np.ndarray = ahead + (first - ahead[0])
        return tension

    def _found(
        self, response: StepResponse, tension: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
        """Return contact, fraction of the step and powers of the force of each kink, and which contacts (n_c,) have one, or None."""
        powers = response.powers @ tension
        open_ = self._sample_powers @ powers > 0
        sample, contact = np.nonzero(open_[1:] != open_[:-1])
        if not sample.size:
            return None
        low, high = self._at[sample], self._at[sample + 1]
        own = powers[:, contact]
        begin = _roots(own, low, high)
        shifted = np.zeros((len(contact), self._order + 1))
        for k in range(1, self._order + 1):  # the constant is zero at a root
            shifted[:, k] = sum(math.comb(m, k) * own[m] * begin ** (m - k) for m in range(k, self._order + 1))
        opens = open_[sample + 1, contact]
        changing = np.zeros(tension.shape[1], dtype=bool)
        changing[contact] = True
        return contact, begin, np.where(opens, 1.0, -1.0)[:, None] * shifted, changing


def _roots(powers: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return one root of each polynomial (order + 1, n) between `low` and `high` (n,), where it changes sign, by Newton's method."""
    slopes = powers[1:] * np.arange(1, len(powers))[:, None]
    up = _value(powers, high) > 0
    at = 0.5 * (low + high)
    for _ in range(8):
        value = _value(powers, at)
        beyond = (value > 0) == up
        high, low = np.where(beyond, at, high), np.where(beyond, low, at)
        slope = _value(slopes, at)
        new = at - value / np.where(slope == 0, 1.0, slope)
        at = np.where((new >= low) & (new <= high), new, 0.5 * (low + high))
    return at


def _value(powers: np.ndarray, at: np.ndarray) -> np.ndarray:
    total = np.zeros_like(at)
    for row in powers[::-1]:
        total = total * at + row
    return total
