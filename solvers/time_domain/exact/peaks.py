"""Largest and smallest values of observed quantities over all time, also between archived instants.

A quantity is sampled a radian of the fastest oscillation apart. Where it turns between two samples it stays below the point where the
tangents meet; only where that exceeds what was found so far is the turning point itself looked for, to round-off.
"""

from __future__ import annotations

import numpy as np

from uplift.solvers.time_domain.exact.crossing import bracketed
from uplift.solvers.time_domain.exact.event_march import Piece
from uplift.solvers.time_domain.exact.observed import Observed
from uplift.solvers.time_domain.exact.propagators import TERMS

MAX_SETS = 50
"""Contact sets whose sampled rows are kept."""


class Peaks:
    """The extremes so far of n quantities: `value` and `time`, each (2, n), largest first."""

    def __init__(self, observed: Observed) -> None:
        """Begin without any."""
        self._observed = observed
        self._rows: dict[bytes, np.ndarray] = {}
        n = observed.n_outputs + 2 * observed.n_contacts
        self.value = np.stack([np.full(n, -np.inf), np.full(n, np.inf)])
        self.time = np.zeros((2, n))

    def observe(self, piece: Piece) -> None:
        """Take one piece of the motion into account."""
        regime, key = piece.regime, piece.regime.open.tobytes()
        if key not in self._rows:
            if len(self._rows) >= MAX_SETS:
                self._rows.clear()
            self._rows[key] = regime.sampled(self._observed.rows(regime))
        sampled = self._rows[key]
        if piece.level > regime.samples or piece.level < 0:
            end = regime.after(piece.state, piece.length, piece.level)
            values = np.stack([sampled[0] @ piece.state, sampled[0] @ end])
            spacing = piece.length
        else:
            values = sampled[: 1 + 2 ** (regime.samples - piece.level)] @ piece.state
            spacing = regime.unit / 2**regime.samples
        for side, sign in enumerate((1.0, -1.0)):
            self._samples(side, sign, values, piece.begin, spacing)
            self._turns(side, sign, values, piece, spacing)

    def _samples(self, side: int, sign: float, values: np.ndarray, begin: float, spacing: float) -> None:
        at = np.argmax(sign * values[:, 0], axis=0)
        best = np.take_along_axis(values[:, 0], at[None], axis=0)[0]
        better = sign * best > sign * self.value[side]
        self.value[side, better], self.time[side, better] = best[better], begin + spacing * at[better]

    def _turns(self, side: int, sign: float, values: np.ndarray, piece: Piece, spacing: float) -> None:
        before, after = sign * values[:-1], sign * values[1:]
        turns = (before[:, 1] > 0) & (after[:, 1] < 0)
        if not turns.any():
            return
        span = np.where(turns, before[:, 1] - after[:, 1], 1.0)
        meet = before[:, 0] + before[:, 1] * (after[:, 0] - before[:, 0] - after[:, 1] * spacing) / span
        for sample, i in np.argwhere(turns & (meet > sign * self.value[side])):
            if meet[sample, i] <= sign * self.value[side, i]:
                continue
            value, time = self._turning_point(piece, int(sample), int(i), spacing)
            if sign * value > sign * self.value[side, i]:
                self.value[side, i], self.time[side, i] = value, time

    def _turning_point(self, piece: Piece, sample: int, i: int, spacing: float) -> tuple[float, float]:
        """Return value and time of quantity `i` where its rate is zero within a sample of a piece."""
        regime, state, time, length = piece.regime, piece.state, piece.begin, spacing
        row, rate = self._rows[regime.open.tobytes()][0, :, i]
        if 0 <= piece.level <= regime.samples:
            for bit in range(regime.samples):
                if sample >> bit & 1:
                    state = regime.advance(state, regime.samples - bit)
            time, level = time + sample * spacing, regime.samples
        else:
            level = piece.level if piece.level >= 0 else regime.levels
        rising = float(rate @ state) > 0
        while level < regime.levels:
            level, length = level + 1, length / 2
            ahead = regime.advance(state, level)
            if (float(rate @ ahead) > 0) == rising:
                state, time = ahead, time + length
        terms, term = [], row
        for k in range(1, TERMS + 2):
            terms.append(float(term @ state))
            term = term @ regime.generator * (length / k)
        coefficients = np.array(terms)
        at = bracketed(coefficients[1:] * np.arange(1, len(coefficients)), 0.0, 1.0)
        return float(np.polynomial.polynomial.polyval(at, coefficients)), time + at * length
