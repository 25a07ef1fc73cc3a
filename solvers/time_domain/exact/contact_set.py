"""The linear regime of one set of open contacts: its generator, its propagators, and the rows that watch for the next event.

The state is X = (x, 1, s), s the polynomial coefficients of the signals (see `uplift.solvers.time_domain.exact.forcing`), which obey linear
equations too: s_k' = (k + 1) s_(k+1) / unit. Between two events X' = G X, with nothing left to integrate.
"""

from __future__ import annotations

import math

import numpy as np

from uplift.solvers.errors import SolverError
from uplift.solvers.time_domain.exact.first_order import FirstOrder
from uplift.solvers.time_domain.exact.forcing import Forcing
from uplift.solvers.time_domain.exact.propagators import TERMS, advanced, doubled, halvings

MOST_SAMPLES = 9
"""log2 of the samples of a step: each holds rows of all contacts."""


class Augmented:
    """The system with its loads as states: what all sets of contacts share."""

    def __init__(self, system: FirstOrder, loads: Forcing) -> None:
        """Append the constant one and the coefficients of the varying loads to the state."""
        n, n_v, per_load = len(system.A), len(loads.varying), loads.degree + 1
        self.system, self.n = system, n
        self.size = n + 1 + n_v * per_load
        self.F = np.zeros((len(loads.constant), self.size))
        """(n_loads, N): load values per state."""
        self.F[:, n] = loads.constant
        self.shift = np.zeros((self.size, self.size))
        """(N, N) 1/s: the motion of the coefficients alone."""
        for k, load in enumerate(loads.varying):
            first = n + 1 + k * per_load
            self.F[load, first] = 1.0
            for power in range(1, per_load):
                self.shift[first + power - 1, first + power] = power / loads.unit
        samples = max(0, math.ceil(math.log2(max(system.fastest * loads.unit, 1.0))))
        self.samples = min(samples, MOST_SAMPLES)
        """log2 of how many samples of a unit resolve the fastest oscillation by a radian."""
        self.unit = loads.unit / 2 ** (samples - self.samples)
        """s, the longest step: the most frequent interval of the loads, or a part of it that is not too large to be sampled."""

    def rows(self, of_x: np.ndarray, of_f: np.ndarray) -> np.ndarray:
        """Return rows (k, N) of X from rows of x (k, n) and of f (k, n_loads)."""
        whole = of_f @ self.F
        whole[:, : self.n] += of_x
        return whole


class ContactSet:
    """One set of open contacts; matrices of the event search are made when the first event asks for them."""

    def __init__(self, base: Augmented, open_: np.ndarray) -> None:
        """Take the contacts (n_c,) that are open. Raises `SolverError` if nothing but them holds the model at once."""
        system, self.open = base.system, open_.copy()
        n_c = len(open_)
        tension = base.rows(system.Q, system.D)
        self.release = np.zeros((n_c, base.size))
        """(n_c, N) N: release forces per state."""
        index = np.flatnonzero(open_)
        if index.size:
            try:
                self.release[index] = np.linalg.solve(np.eye(index.size) - system.E[np.ix_(index, index)], tension[index])
            except np.linalg.LinAlgError:
                raise SolverError("a set of open contacts leaves the structure without an answer") from None
        self.generator = base.shift.copy()
        self.generator[: base.n] += base.rows(system.A, system.B)
        self.generator[: base.n] += system.P[:, index] @ self.release[index]
        # Compression of the closed contacts, release force of the open ones: neither may become negative.
        self.margin = np.where(open_[:, None], self.release, -(tension + system.E @ self.release))
        """(n_c, N) N."""
        self.rate = self.margin @ self.generator
        """(n_c, N) N/s."""
        self.levels = max(halvings(self.generator, base.unit), base.samples)
        self.unit, self.samples = base.unit, base.samples
        self.steps = doubled(self.generator, base.unit, self.levels)
        """exp(G H / 2^l) - 1 for l = 0 ... levels."""
        self._watch = self.sampled(self.margin)
        self._series: np.ndarray | None = None

    def sampled(self, rows: np.ndarray) -> np.ndarray:
        """Return rows (k, N) and those of their rates at the beginning of a unit and the end of each sample, (1 + 2^samples, 2, k, N)."""
        first = np.concatenate([rows, rows @ self.generator])
        later = first + first @ self.steps[self.samples]
        for level in range(self.samples, 0, -1):
            later = np.concatenate([later, later + later @ self.steps[level]])
        return np.concatenate([first, later]).reshape(1 + 2**self.samples, 2, *rows.shape)

    def watched(self, state: np.ndarray, level: int) -> np.ndarray:
        """Return margins N and rates N/s (n, 2, n_c) from a state on, at the samples of a step H / 2^level or at its ends."""
        if level > self.samples:
            ends = np.stack([state, self.advance(state, level)], axis=1)
            return np.moveaxis(self._watch[0] @ ends, 2, 0)
        values: np.ndarray = self._watch[: 1 + 2 ** (self.samples - level)] @ state
        return values

    @property
    def series(self) -> np.ndarray:
        """(TERMS + 1, n_c, N): Taylor coefficients of the margins in time over the shortest step."""
        if self._series is None:
            shortest = self.unit / 2**self.levels
            terms = [self.margin]
            for k in range(1, TERMS + 1):
                terms.append(terms[-1] @ self.generator * (shortest / k))
            self._series = np.stack(terms)
        return self._series

    def advance(self, state: np.ndarray, level: int) -> np.ndarray:
        """Return the state H / 2^level later."""
        moved: np.ndarray = state + self.steps[level] @ state
        return moved

    def edge_values(self, state: np.ndarray) -> np.ndarray:
        """Return margins and rates (2, n_c) at one state."""
        values: np.ndarray = self._watch[0] @ state
        return values

    def after(self, state: np.ndarray, length: float, level: int) -> np.ndarray:
        """Return the state at the end of a step H / 2^level, or with level -1 of a time of `length` s within the shortest step."""
        return self.advance(state, level) if level >= 0 else advanced(self.generator, state, length)

    def level_within(self, length: float) -> int:
        """Return the level of the longest step that fits into `length` s, or -1 if none does."""
        level = max(0, math.ceil(math.log2(self.unit / length) - 1e-12))
        return level if level <= self.levels else -1

    @property
    def bytes(self) -> int:
        """Size of the matrices that are kept."""
        return (len(self.steps) * self.steps[0].nbytes) + self._watch.nbytes
