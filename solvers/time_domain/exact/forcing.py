"""Signals as piecewise polynomials on intervals that end at every knot and at every archived instant.

A table and a ramp are linear between their knots. A smooth signal is interpolated at Chebyshev points inside each interval, which is
halved until the polynomial is within TOLERANCE of the signal. A jump is a knot: interpolation uses inner points, so that each side of it
has its own value.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uplift.forms.loads.signals import Constant, Noise, Ricker, Sine, Step, Sweep, Table
from uplift.solvers.errors import SolverError

TOLERANCE = 1e-11
"""A polynomial is this near to its signal, as a part of the signal's largest value in the run."""
DEGREE = 6
"""Of the polynomials of smooth signals."""
HALVINGS = 20
"""A signal that needs more halvings of an interval is not piecewise smooth between its knots."""

History = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Forcing:
    """Polynomials of all load histories: value(t) = sum over k of coefficients[..., k] * ((t - edges[i]) / unit)^k in interval i."""

    edges: np.ndarray
    """(n + 1,) s: every archived instant and every knot is one of them."""
    unit: float
    """s, the most frequent length of an interval."""
    constant: np.ndarray
    """(n_loads,): values of the loads that never change; zero for the others."""
    varying: np.ndarray
    """(n_v,): the loads that do."""
    coefficients: np.ndarray
    """(n, n_v, degree + 1)."""

    @property
    def degree(self) -> int:
        """Of the polynomials."""
        return self.coefficients.shape[2] - 1

    @property
    def lengths(self) -> np.ndarray:
        """(n,) s of the intervals."""
        return np.diff(self.edges)


def forcing(histories: tuple[History, ...], instants: np.ndarray) -> Forcing:
    """Return the polynomials of `histories` over `instants` (nt,) s, which increase. Raises `SolverError` for a signal that is none."""
    constant = np.array([h.value if isinstance(h, Constant) else 0.0 for h in histories])
    varying = np.array([j for j, h in enumerate(histories) if not isinstance(h, Constant)], dtype=int)
    edges = merged(instants, [knots(histories[j]) for j in varying])
    degree = 0 if not varying.size else max(1 if _linear(histories[j]) else DEGREE for j in varying)
    for j in varying:
        if not _linear(histories[j]):
            edges = _refined(histories[j], edges)
    lengths = np.diff(edges)
    unit = _most_frequent(lengths)
    coefficients = np.zeros((len(lengths), len(varying), degree + 1))
    for k, j in enumerate(varying):
        own = 1 if _linear(histories[j]) else DEGREE
        coefficients[:, k, : own + 1] = _monomials(_sampled(histories[j], edges, _points(own)), own, lengths / unit)
    return Forcing(edges, unit, constant, varying, coefficients)


def knots(history: History) -> np.ndarray:
    """Return the times at which a signal or one of its derivatives jumps. Raises `SolverError` for a signal without known knots."""
    if isinstance(history, Table):
        return history.times
    if isinstance(history, Step):
        return np.array([history.start, history.start + history.rise])
    if isinstance(history, Ricker):
        return np.array([history.start])
    if isinstance(history, Sine):
        return np.array([history.start, history.end])
    if isinstance(history, Sweep):
        return np.array([history.start, history.start + history.taper, history.end - history.taper, history.end])
    if isinstance(history, Noise):
        return np.array([history.start, history.start + history.rise, history.end - history.decay, history.end])
    raise SolverError(f"the knots of a signal of kind {type(history).__name__} are not known: the exact method cannot take it")


def _linear(history: History) -> bool:
    return isinstance(history, Table | Step)


def merged(instants: np.ndarray, others: list[np.ndarray]) -> np.ndarray:
    """Return `instants` and all `others` between the first and the last of them, those within round-off of one another as one."""
    first, last = instants[0], instants[-1]
    near = 1e-12 * max(abs(first), abs(last))
    inside = [times[(times > first + near) & (times < last - near)] for times in others]
    extra = np.sort(np.concatenate([*inside, np.zeros(0)]))
    if extra.size:
        extra = extra[np.concatenate([[True], np.diff(extra) > near])]
        after = np.searchsorted(instants, extra)
        extra = extra[np.minimum(extra - instants[after - 1], instants[after] - extra) > near]
    return np.sort(np.concatenate([instants, extra]))


def _points(degree: int) -> np.ndarray:
    """Return the Chebyshev points (degree + 1,) of the interval from 0 to 1, none at its ends."""
    return 0.5 - 0.5 * np.cos(np.pi * (2 * np.arange(degree + 1) + 1) / (2 * degree + 2))


def _sampled(history: History, edges: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the values (n, n_points) at the same points of every interval."""
    times = edges[:-1, None] + np.diff(edges)[:, None] * points
    return history(times.ravel()).reshape(times.shape)


def _monomials(values: np.ndarray, degree: int, lengths: np.ndarray) -> np.ndarray:
    """Return coefficients (n, degree + 1) in time over the unit from values at the Chebyshev points of intervals of `lengths` units."""
    unit_interval = values @ np.linalg.inv(np.vander(_points(degree), increasing=True)).T
    return unit_interval / lengths[:, None] ** np.arange(degree + 1)


def _refined(history: History, edges: np.ndarray) -> np.ndarray:
    """Halve intervals until polynomials of degree DEGREE are near enough."""
    between = np.linspace(0.02, 0.98, 2 * DEGREE + 1)
    at_points = np.vander(between, DEGREE + 1, increasing=True) @ np.linalg.inv(np.vander(_points(DEGREE), increasing=True))
    largest = np.abs(_sampled(history, edges, between)).max()
    doubtful = np.ones(len(edges) - 1, dtype=bool)
    for _ in range(HALVINGS):
        starts = np.flatnonzero(doubtful)
        if not starts.size:
            return edges
        pairs = np.stack([edges[starts], edges[starts + 1]], axis=1)
        times = pairs[:, :1] + np.diff(pairs) * np.concatenate([_points(DEGREE), between])
        values = history(times.ravel()).reshape(times.shape)
        error = np.abs(values[:, : DEGREE + 1] @ at_points.T - values[:, DEGREE + 1 :]).max(axis=1)
        wrong = starts[error > TOLERANCE * largest]
        whole = np.sort(np.concatenate([edges, 0.5 * (edges[wrong] + edges[wrong + 1])]))
        halves = np.isin(whole[:-1], edges[wrong]) | np.isin(whole[:-1], 0.5 * (edges[wrong] + edges[wrong + 1]))
        edges, doubtful = whole, halves
    raise SolverError("a signal is not smooth between its knots: the exact method cannot take it as a piecewise polynomial")


def _most_frequent(lengths: np.ndarray) -> float:
    """Return the length that most of the time is covered by, of lengths that agree to round-off."""
    shortest_first = np.sort(lengths)
    groups = np.split(shortest_first, np.flatnonzero(np.diff(shortest_first) > 1e-9 * shortest_first[1:]) + 1)
    return float(np.median(max(groups, key=lambda group: group.sum())))
