"""Largest and smallest values of observed quantities over all time, also between archived instants.

A quantity is sampled a radian of the fastest oscillation apart. Where it turns between two samples it stays below the point where the
tangents meet; only where that exceeds what was found so far is the turning point itself looked for, to round-off.
"""

from __future__ import annotations

import numpy as np

from uplift.solvers.time_domain.exact.contact_set import ContactSet
from uplift.solvers.time_domain.exact.crossing import bracketed
from uplift.solvers.time_domain.exact.event_march import Piece
from uplift.solvers.time_domain.exact.observed import Observed
from uplift.solvers.time_domain.exact.propagators import TERMS

MAX_SETS = 50
"""Contact sets whose sampled rows are kept."""
MAX_SAMPLES = 8192
"""Samples that are looked at together."""


class Peaks:
    """The extremes so far of n quantities: `value` and `time`, each (2, n), largest first."""

    def __init__(self, observed: Observed) -> None:
        """Begin without any."""
        self._observed = observed
        self._rows: dict[bytes, np.ndarray] = {}
        self._waiting: list[Piece] = []
        self._samples_waiting = 0
        n = observed.n_outputs + 2 * observed.n_contacts
        self.value = np.stack([np.full(n, -np.inf), np.full(n, np.inf)])
        self.time = np.zeros((2, n))

    def observe(self, piece: Piece) -> None:
        """Take one piece of the motion into account, now or with others that follow."""
        self._waiting.append(piece)
        self._samples_waiting += 1 if _is_short(piece) else 2 ** (piece.regime.samples - piece.level)
        if self._samples_waiting > MAX_SAMPLES:
            self.finish()

    def finish(self) -> None:
        """Take all pieces into account that wait."""
        groups: dict[tuple[bytes, int], list[Piece]] = {}
        for piece in self._waiting:
            groups.setdefault((piece.regime.open.tobytes(), -1 if _is_short(piece) else piece.level), []).append(piece)
        self._waiting, self._samples_waiting = [], 0
        for (_, level), pieces in groups.items():
            self._together(pieces, level)

    def _sampled(self, regime: ContactSet) -> np.ndarray:
        """Return the rows (1 + 2^samples, 2, n, N) of quantities and rates at the samples of a unit."""
        key = regime.open.tobytes()
        if key not in self._rows:
            if len(self._rows) >= MAX_SETS:
                self._rows.clear()
            self._rows[key] = regime.sampled(self._observed.rows(regime))
        return self._rows[key]

    def _together(self, pieces: list[Piece], level: int) -> None:
        """Take in pieces of one contact set that have as many samples each: those of `level`, or -1 for the two ends alone."""
        regime = pieces[0].regime
        rows, begins = self._sampled(regime), np.stack([piece.state for piece in pieces])
        if level < 0:
            ends = np.stack([regime.after(piece.state, piece.length, piece.level) for piece in pieces])
            values = np.stack([begins @ rows[0].reshape(-1, rows.shape[-1]).T, ends @ rows[0].reshape(-1, rows.shape[-1]).T], axis=1)
            spacing = np.array([piece.length for piece in pieces])
        else:
            part = rows[: 1 + 2 ** (regime.samples - level)]
            values = begins @ part.reshape(-1, rows.shape[-1]).T
            spacing = np.full(len(pieces), regime.unit / 2**regime.samples)
        values = values.reshape(len(pieces), -1, 2, rows.shape[2])
        for side, sign in enumerate((1.0, -1.0)):
            self._samples(side, sign, values, pieces, spacing)
            self._turns(side, sign, values, pieces, spacing)

    def _samples(self, side: int, sign: float, values: np.ndarray, pieces: list[Piece], spacing: np.ndarray) -> None:
        count, n = values.shape[1], values.shape[3]
        flat = values[:, :, 0].reshape(-1, n)
        at = np.argmax(sign * flat, axis=0)
        best = flat[at, np.arange(n)]
        for i in np.flatnonzero(sign * best > sign * self.value[side]):
            piece, sample = divmod(int(at[i]), count)
            self.value[side, i], self.time[side, i] = best[i], pieces[piece].begin + sample * spacing[piece]

    def _turns(self, side: int, sign: float, values: np.ndarray, pieces: list[Piece], spacing: np.ndarray) -> None:
        before, after = sign * values[:, :-1], sign * values[:, 1:]
        rise, fall = before[:, :, 1], after[:, :, 1]
        turns = (rise > 0) & (fall < 0)
        span = np.where(turns, rise - fall, 1.0)
        meet = before[:, :, 0] + rise * (after[:, :, 0] - before[:, :, 0] - fall * spacing[:, None, None]) / span
        higher = np.argwhere(turns & (meet > sign * self.value[side]))
        for piece, sample, i in higher[np.argsort(-meet[tuple(higher.T)])]:
            if meet[piece, sample, i] <= sign * self.value[side, i]:
                continue
            value, time = self._turning_point(pieces[piece], int(sample), int(i))
            if sign * value > sign * self.value[side, i]:
                self.value[side, i], self.time[side, i] = value, time

    def _turning_point(self, piece: Piece, sample: int, i: int) -> tuple[float, float]:
        """Return value and time of quantity `i` where its rate is zero within a sample of a piece."""
        regime, state, time = piece.regime, piece.state, piece.begin
        row, rate = self._sampled(regime)[0, :, i]
        if _is_short(piece):
            length, level = piece.length, piece.level if piece.level >= 0 else regime.levels
        else:
            for bit in range(regime.samples):
                if sample >> bit & 1:
                    state = regime.advance(state, regime.samples - bit)
            length, level = regime.unit / 2**regime.samples, regime.samples
            time += sample * length
        sign = float(rate @ state)
        while level < regime.levels:
            level, length = level + 1, length / 2
            ahead = regime.advance(state, level)
            if float(rate @ ahead) * sign > 0:
                state, time = ahead, time + length
        terms, term = [], row
        for k in range(1, TERMS + 2):
            terms.append(float(term @ state))
            term = term @ regime.generator * (length / k)
        coefficients = np.array(terms)
        at = bracketed(coefficients[1:] * np.arange(1, len(coefficients)), 0.0, 1.0)
        return float(np.polynomial.polynomial.polyval(at, coefficients)), time + at * length


def _is_short(piece: Piece) -> bool:
    """Return whether a piece lies within one sample."""
    return piece.level < 0 or piece.level > piece.regime.samples
