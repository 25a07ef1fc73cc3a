"""The ledger of energies of an exact march: integrals of powers that are quadratic in the state, taken without quadrature.

With X' = G X the integral of X^T S X over a time h is X^T W(h) X, W' = S + G^T W + W G: a Taylor series over the shortest step, then
W(2 h) = W + E^T W E. For the work, S holds the loads from outside times the velocity; for damping, the velocity's dissipation.
"""

from __future__ import annotations

import numpy as np

from uplift.solvers.history import Ledger
from uplift.solvers.time_domain.exact.contact_set import Augmented, ContactSet
from uplift.solvers.time_domain.exact.event_march import Piece
from uplift.solvers.time_domain.exact.model import DenseModel
from uplift.solvers.time_domain.exact.observed import Observed
from uplift.solvers.time_domain.exact.propagators import TERMS

INTEGRAL_TERMS = 20
"""Of the series of W: |G| h <= 1/2 enters twice, and 1 / 20! is below round-off."""


class _Integrals:
    """Work and dissipation in one contact set."""

    def __init__(self, regime: ContactSet, power: tuple[np.ndarray, np.ndarray]) -> None:
        self._regime, self._power = regime, power
        self._forms: dict[int, np.ndarray] = {}

    def over_step(self, state: np.ndarray, level: int) -> np.ndarray:
        """Return work and dissipation (2,) J over a step H / 2^level from a state on."""
        forms = self._at(level)
        return np.array([state @ (forms[0] @ state), state @ (forms[1] @ state)])

    def over(self, state: np.ndarray, length: float) -> np.ndarray:
        """Return the same over a time that is not longer than the shortest step."""
        terms = [state]
        for k in range(1, TERMS + 1):
            terms.append(self._regime.generator @ terms[-1] * (length / k))
        series = np.stack(terms)
        order = np.arange(TERMS + 1)
        weights = length / (order[:, None] + order + 1)
        return np.array([np.sum(weights * (series @ form @ series.T)) for form in self._power])

    def _at(self, level: int) -> np.ndarray:
        """Return the two forms W (2, N, N) of a step H / 2^level."""
        if level in self._forms:
            return self._forms[level]
        regime = self._regime
        if level == regime.levels:
            shortest = regime.unit / 2**regime.levels
            form = np.stack([self._series(power * shortest, regime.generator * shortest) for power in self._power])
        else:
            difference, half = regime.steps[level + 1], self._at(level + 1)
            moved = half + half @ difference
            form = half + moved + difference.T @ moved
        self._forms[level] = form
        return form

    @staticmethod
    def _series(power: np.ndarray, generator: np.ndarray) -> np.ndarray:
        term, total = power, power.copy()
        for k in range(2, INTEGRAL_TERMS + 1):
            product = term @ generator
            term = (product + product.T) / k
            total += term
        return total


class Energies:
    """Adds up work and dissipation piece by piece, and takes the stored energies at archived instants."""

    def __init__(self, model: DenseModel, base: Augmented, observed: Observed) -> None:
        """Begin at the first archived instant."""
        self._model, self._base, self._observed = model, base, observed
        self._plate = model.stiffness - model.springs - model.unilateral
        self._external = [j for j, internal in enumerate(model.internal) if not internal]
        self._sets: dict[bytes, _Integrals] = {}
        self._flows = np.zeros(2)
        self._rows: list[tuple[float, ...]] = []

    def observe(self, piece: Piece) -> None:
        """Add one piece of the motion."""
        if piece.length == 0:
            return
        key = piece.regime.open.tobytes()
        if key not in self._sets:
            self._sets[key] = _Integrals(piece.regime, self._powers(piece.regime))
        integrals = self._sets[key]
        self._flows = self._flows + (
            integrals.over_step(piece.state, piece.level) if piece.level >= 0 else integrals.over(piece.state, piece.length)
        )

    def _powers(self, regime: ContactSet) -> tuple[np.ndarray, np.ndarray]:
        """Return the symmetric forms (N, N) W of the loads' and of the dampers' power."""
        velocity = self._observed.displacement(regime) @ regime.generator
        work = self._base.F[self._external].T @ (self._model.loads[:, self._external].T @ velocity)
        return 0.5 * (work + work.T), velocity.T @ (self._model.damping @ velocity)

    def archive(self, regime: ContactSet, state: np.ndarray) -> None:
        """Note the energies of an archived instant."""
        model, rows = self._model, self._observed.displacement(regime)
        u, v = rows @ state, rows @ (regime.generator @ state)
        net = np.where(regime.open, 0.0, regime.margin @ state)
        springs = 0.5 * float(u @ model.springs @ u) + 0.5 * float(net**2 @ model.law.flexibility)
        self._rows.append((0.5 * float(v @ model.mass @ v), 0.5 * float(u @ self._plate @ u), springs, self._flows[1], self._flows[0]))

    def ledger(self) -> Ledger:
        """Return the ledger at the archived instants."""
        return Ledger(*np.array(self._rows).reshape(-1, 5).T)
