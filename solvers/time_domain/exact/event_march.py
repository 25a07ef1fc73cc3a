"""The march from event to event: the exact motion of a model whose contacts open and close.

In an interval of the loads the state moves by one product, if the margins of all contacts stay positive at samples a radian of the fastest
oscillation apart and nowhere dip between two of them. Else the interval is walked in halves, down to a step that a Taylor polynomial spans;
its root is the event, to round-off. The contact that reached zero changes sides, and the march goes on in the new set.

There are no impacts between a body and a spring: forces are continuous, so that events cannot crowd.
Source of that: M. K. Camlibel, J.-S. Pang, J. Shen, Conewise linear systems, SIAM J. Control Optim. 45 (2006) 1769.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uplift.solvers.errors import SolverError
from uplift.solvers.time_domain.exact.contact_set import Augmented, ContactSet
from uplift.solvers.time_domain.exact.crossing import first_crossing
from uplift.solvers.time_domain.exact.first_order import FirstOrder
from uplift.solvers.time_domain.exact.forcing import Forcing
from uplift.solvers.time_domain.exact.propagators import advanced

ROUND_OFF = 1e-13
"""A force below this part of the largest contact force so far counts as zero."""
MOST_EVENTS = 1000
"""Of one contact within one interval of the loads: more of them make no progress in time."""
KEPT_BYTES = 500_000_000
"""Of the matrices of contact sets that are kept for another visit."""


@dataclass(frozen=True)
class Event:
    """A contact that opens or closes."""

    contact: int
    opens: bool
    time: float
    """s."""
    speed: float
    """m/s of the gap: positive where it opens, negative where it closes."""


@dataclass(frozen=True)
class Piece:
    """A part of the motion within one contact set and one interval of the loads."""

    regime: ContactSet
    begin: float
    """s."""
    length: float
    """s."""
    level: int
    """The piece is H / 2^level long; -1 for one of another length, shorter than the shortest step."""
    state: np.ndarray
    """(N,) at its beginning."""


class EventMarch:
    """The march of one system under one set of loads."""

    def __init__(self, system: FirstOrder, loads: Forcing, flexibility: np.ndarray, observe: Callable[[Piece], None]) -> None:
        """Take the flexibility (n_c,) m/N that turns release forces into gaps; `observe` is shown every piece in order."""
        self.base, self._loads, self._flexibility, self._observe = Augmented(system, loads), loads, flexibility, observe
        self._sets: dict[bytes, ContactSet] = {}
        self._largest = 0.0
        self._at_once = 0
        self.events: list[Event] = []
        self.sets_made = 0

    def run(self, state: np.ndarray, open_: np.ndarray) -> None:
        """March from the state (n,) at the first edge of the loads, with the contacts `open_` (n_c,) open, to the last."""
        base, loads = self.base, self._loads
        whole = np.zeros(base.size)
        whole[: base.n], whole[base.n] = state, 1.0
        regime = self._set(open_)
        for begin, length, coefficients in zip(loads.edges[:-1].tolist(), loads.lengths.tolist(), loads.coefficients, strict=True):
            whole[base.n + 1 :] = coefficients.ravel()
            whole, regime = self._interval(whole, regime, begin, length)
        self._observe(Piece(regime, float(loads.edges[-1]), 0.0, -1, whole))

    def _set(self, open_: np.ndarray) -> ContactSet:
        key = open_.tobytes()
        if key not in self._sets:
            made = ContactSet(self.base, open_)
            self.sets_made += 1
            if (len(self._sets) + 1) * made.bytes > KEPT_BYTES and self._sets:
                self._sets.pop(next(iter(self._sets)))
            self._sets[key] = made
        return self._sets[key]

    def _interval(self, state: np.ndarray, regime: ContactSet, begin: float, length: float) -> tuple[np.ndarray, ContactSet]:
        """Return state and set at the end of an interval of the loads."""
        position, end = 0.0, length * (1 - 1e-13)
        most = len(self.events) + MOST_EVENTS * (len(regime.open) + 1)
        while position < end:
            if len(self.events) > most:
                raise SolverError(f"contacts open and close without end at {begin + position:.6g} s")
            left = length - position
            level = regime.level_within(left)
            if level < 0:
                walked, state, contact = self._crumb(state, regime, begin + position, left)
            else:
                walked, state, contact = self._step(state, regime, begin + position, level)
            position += walked
            if contact >= 0:
                regime = self._toggled(state, regime, contact, begin + position, walked)
        return state, regime

    def _step(self, state: np.ndarray, regime: ContactSet, time: float, level: int) -> tuple[float, np.ndarray, int]:
        """Walk one step H / 2^level or up to the event in it: return the time walked, the state and the contact that changes, or -1."""
        values, spacing = regime.watched(state, level), regime.unit / 2 ** max(level, regime.samples)
        if self._far_from_events(values, spacing):
            return regime.unit / 2**level, self._clean(state, regime, time, 0.0, level)[0], -1
        wrong = self._changed(values[0])
        if wrong >= 0:
            return 0.0, state, wrong
        doubtful = self._doubtful(values, spacing).any(axis=1)
        first = int(np.argmax(doubtful))
        if not doubtful[first]:
            return regime.unit / 2**level, self._clean(state, regime, time, 0.0, level)[0], -1
        walked = 0.0
        for bit in range(regime.samples - level, -1, -1):
            if first >> bit & 1:
                state, walked = self._clean(state, regime, time, walked, regime.samples - bit)
        level = max(level, regime.samples)
        while level < regime.levels:
            level += 1
            if not self._doubtful(regime.watched(state, level), regime.unit / 2**level).any():
                state, walked = self._clean(state, regime, time, walked, level)
        more, state, contact = self._crumb(state, regime, time + walked, regime.unit / 2**regime.levels)
        return walked + more, state, contact

    def _clean(self, state: np.ndarray, regime: ContactSet, time: float, walked: float, level: int) -> tuple[np.ndarray, float]:
        """Walk a step without an event."""
        length = regime.unit / 2**level
        self._observe(Piece(regime, time + walked, length, level, state))
        return regime.advance(state, level), walked + length

    def _crumb(self, state: np.ndarray, regime: ContactSet, time: float, length: float) -> tuple[float, np.ndarray, int]:
        """Walk a piece of at most the shortest step by Taylor polynomials, as `_step` does."""
        edges = regime.edge_values(state)
        wrong = self._changed(edges)
        if wrong >= 0:
            return 0.0, state, wrong
        end = advanced(regime.generator, state, length)
        values = np.stack([edges, regime.edge_values(end)])
        shortest = regime.unit / 2**regime.levels
        found, contact = length / shortest, -1
        for i in np.flatnonzero(self._doubtful(values, length)[0]):
            crossing = first_crossing(regime.series[:, i] @ state, found, self._small)
            if crossing is not None:
                found, contact = crossing, int(i)
        walked = length if contact < 0 else found * shortest
        if walked > 0:
            self._observe(Piece(regime, time, walked, -1, state))
        return walked, end if contact < 0 else advanced(regime.generator, state, walked), contact

    @property
    def _small(self) -> float:
        return ROUND_OFF * self._largest

    def _far_from_events(self, values: np.ndarray, spacing: float) -> bool:
        """Return whether margins (n, 2, n_c) are so large that none can reach zero between samples `spacing` s apart.

        The tangents at the ends of a sample meet at most half a sample's steepest fall below the smaller end.
        """
        margins = values[:, 0]
        far = float(margins.min(initial=np.inf)) > 0.5 * spacing * float(np.abs(values[:, 1]).max(initial=0.0))
        if far:
            self._largest = max(self._largest, float(margins.max(initial=0.0)))
        return far

    def _changed(self, values: np.ndarray) -> int:
        """Return the first contact whose margin (2, n_c: value, rate) is below zero or about to be, or -1."""
        margin, rate = values
        self._largest = max(self._largest, float(np.abs(margin).max(initial=0.0)))
        small = self._small
        wrong = (margin < -small) | ((margin <= small) & (rate < -small * self.base.system.fastest))
        first = int(np.argmax(wrong)) if wrong.size else 0
        return first if wrong.size and wrong[first] else -1

    def _doubtful(self, values: np.ndarray, spacing: float) -> np.ndarray:
        """Return (n - 1, n_c) where a margin ends below zero or may dip below it, from samples (n, 2, n_c) `spacing` s apart.

        A dip is lowest above the point where the tangents at its two ends meet.
        """
        before, after = values[:-1], values[1:]
        fall, rise = before[:, 1], after[:, 1]
        small = self._small
        below: np.ndarray = after[:, 0] < -small
        dips = (fall < 0) & (rise > 0)
        if dips.any():
            span = np.where(dips, fall - rise, -1.0)
            lowest = before[:, 0] + fall * (after[:, 0] - before[:, 0] - rise * spacing) / span
            below |= dips & (lowest < -small)
        return below

    def _toggled(self, state: np.ndarray, regime: ContactSet, contact: int, time: float, walked: float) -> ContactSet:
        """Return the set with the other state of one contact, and note the event."""
        self._at_once = self._at_once + 1 if walked == 0 else 0
        if self._at_once > 4 * (len(regime.open) + 4):
            raise SolverError("the open contacts of an instant cannot be found")
        opens = not regime.open[contact]
        fall = float(regime.rate[contact] @ state)
        self.events.append(Event(contact, opens, time, float(self._flexibility[contact]) * (-fall if opens else fall)))
        open_ = regime.open.copy()
        open_[contact] = opens
        return self._set(open_)
