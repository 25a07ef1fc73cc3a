"""What is compared, and with what: traces of a run, their errors, extrapolated references, orders and the efficient front."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

QUANTITIES = ("displacement", "contact forces", "uplift")


@dataclass(frozen=True)
class Trace:
    """What is compared of one run."""

    probe: np.ndarray
    """(nt, n_components) m: displacements of the first probe at the common instants."""
    force: np.ndarray
    """(nt, n) N, or N/m on spread supports, compression positive: at the observed contacts and the common instants."""
    open_time: np.ndarray
    """(n,) s: how long each observed contact was open, crossings interpolated linearly between the steps."""

    @property
    def parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The three in the order of `QUANTITIES`."""
        return self.probe, self.force, self.open_time


def open_time(tension: np.ndarray, step: float) -> np.ndarray:
    """Return the time (n,) s for which histories (nt, n), linear over each step, are positive.

    The tension of the bonded contact is the right history: it is the support's stiffness times the rise of the plate above
    it, open or closed, and passes smoothly through zero.
    """
    here, there = tension[:-1], tension[1:]
    above = np.maximum(here, 0.0) + np.maximum(there, 0.0)
    size = np.abs(here) + np.abs(there)
    return step * np.sum(np.divide(above, size, out=np.zeros_like(size), where=size > 0), axis=0)


def errors(trace: Trace, reference: Trace) -> np.ndarray:
    """Return the largest difference of each quantity relative to the largest value of the reference, (3,).

    Where the reference is zero throughout, as where nothing lifts, the difference itself is returned.
    """
    values = []
    for here, there in zip(trace.parts, reference.parts, strict=True):
        size, difference = np.max(np.abs(there), initial=0.0), np.max(np.abs(here - there), initial=0.0)
        values.append(difference / size if size > 0 else difference)
    return np.array(values)


def combined(parts: Sequence[tuple[float, Trace]]) -> Trace:
    """Return the linear combination of traces."""
    sums = [sum(factor * trace.parts[i] for factor, trace in parts) for i in range(3)]
    return Trace(*map(np.asarray, sums))


def richardson(coarse: Trace, fine: Trace, order: float = 2.0) -> Trace:
    """Return the limit that two levels, the second half as coarse as the first, point to: fine + (fine - coarse) / (2^order - 1).

    Source: Richardson, Phil. Trans. R. Soc. A 210 (1911) 307.
    """
    weight = 1 / (2**order - 1)
    return combined([(1 + weight, fine), (-weight, coarse)])


@dataclass(frozen=True)
class Reference:
    """A refined answer and the estimate of its own error."""

    trace: Trace
    error: np.ndarray
    """(3,): as `errors` measures, between the two extrapolations; the better one of them is `trace`."""
    made_of: str
    """Which runs it is extrapolated from, in words."""


def extrapolated(levels: Sequence[Trace], made_of: str, order: float = 2.0) -> Reference:
    """Extrapolate three levels, each half as coarse as the one before, twice: from the first two and from the last two.

    The difference of the two is the error estimate. It is that of the worse extrapolation, so an upper one as long as the levels
    converge.
    """
    worse, better = richardson(levels[0], levels[1], order), richardson(levels[1], levels[2], order)
    return Reference(better, errors(worse, better), made_of)


def extrapolated_twice(in_step: Sequence[Trace], in_mesh: Sequence[Trace], coarser: Sequence[Trace], made_of: str) -> Reference:
    """Extrapolate in the mesh, and add what the extrapolation in the step changes.

    `in_step` holds three levels of the step on one mesh and, last, the run on it with the step of `in_mesh`; `coarser` the same on a
    coarser mesh. Error estimates add up: of the mesh, of the step, and by how much the change by the step depends on the mesh.
    """
    mesh = extrapolated(in_mesh, made_of)
    changes = [(extrapolated(levels[:3], made_of), levels[3]) for levels in (in_step, coarser)]
    traces = [combined([(1.0, mesh.trace), (1.0, step.trace), (-1.0, common)]) for step, common in changes]
    return Reference(traces[0], mesh.error + changes[0][0].error + errors(traces[1], traces[0]), made_of)


def order(parameters: Sequence[float], values: Sequence[float]) -> float:
    """Return the least-squares slope of log(values) over log(parameters) for the last three levels, nan where they are fewer or zero."""
    x, y = np.asarray(parameters, dtype=float)[-3:], np.asarray(values, dtype=float)[-3:]
    if len(x) < 3 or not (np.all(x > 0) and np.all(y > 0) and np.all(np.isfinite(y))):
        return float("nan")
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def efficient(seconds: Sequence[float], values: Sequence[float]) -> list[int]:
    """Return, in the order of seconds, the runs that no other beats in both: each next one takes longer and errs less.

    A run whose error is nan or infinite has none to offer.
    """
    front: list[int] = []
    best = float("inf")
    for i in sorted(range(len(seconds)), key=lambda i: (seconds[i], values[i])):
        if values[i] < best:
            front.append(i)
            best = values[i]
    return front
