"""Envelopes over time of the section forces all over a plate: least and largest value of each component at each place, and when."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from uplift.drivers.analysis.envelope_data import EnvelopeData
from uplift.forms.operators import Operators
from uplift.solvers.time_domain.kept import Kept
from uplift.solvers.time_domain.state import Instants

if TYPE_CHECKING:
    from uplift.drivers.analysis.task import Task
    from uplift.forms.recovery.force_field import ForceField

BLOCK_BYTES = 2**26
"""In a basis the products of components and instants are made in blocks of this size."""


def envelopes_in_time(task: Task, times: np.ndarray, every: int) -> list[Envelopes]:
    """Return who keeps the envelopes of a march with archived instants `times` (nt,) s, if the scene asks for that."""
    field = task.assembly.plate.forces.field
    return [] if field is None else [Envelopes(field, task.operators, times, every)]


def envelopes_of(task: Task, times: np.ndarray, displacement: Callable[[int], np.ndarray | None]) -> EnvelopeData | None:
    """Return the envelopes of what `displacement` gives at each instant of `times` (nt,) s, in all dofs (collective).

    None where the scene does not ask for them or the displacements were not kept.
    """
    field = task.assembly.plate.forces.field
    if field is None:
        return None
    envelopes = Envelopes(field, task.assembly.operators, times, 1)
    for row in range(len(times)):
        values = displacement(row)
        if values is None:
            return None
        envelopes.take(row, values)
    return envelopes.finished()


class Envelopes:
    """Looks at the archived instants of a march, or is shown fields; in a basis it keeps the coordinates and does all at the end."""

    def __init__(self, field: ForceField, operators: Operators, times: np.ndarray, every: int) -> None:
        """Take the archived instants (nt,) s of a march, of which every `every`-th step is archived."""
        self._field, self._operators, self._times, self._every = field, operators, times, every
        n = field.rows.shape[0]
        self._least, self._largest = np.full(n, np.inf), np.full(n, -np.inf)
        self._when = np.zeros((2, n), dtype=int)
        self._place, self._places = _numbered(field.places, operators.world)
        self._coordinates = np.zeros((len(times), operators.n_local if operators.reduction is not None else 0))

    def observe(self, instants: Instants) -> None:
        """Take in the archived ones of some instants (collective)."""
        which, rows = instants.archived(self._every)
        if self._operators.reduction is not None:
            self._coordinates[rows] = instants.displacement[which]
            return
        for one, row in zip(which, rows, strict=True):
            self.take(int(row), instants.displacement[one])

    def take(self, row: int, values: np.ndarray) -> None:
        """Take in this rank's part (n_local,) of the displacements, in all dofs, at the archived instant `row` (collective)."""
        self._update((self._field.rows @ self._field.known(values))[:, None], np.array([row]), slice(None))

    def _update(self, values: np.ndarray, rows: np.ndarray, part: slice) -> None:
        """Take in values (n_rows, k) of some rows at the archived instants `rows` (k,), in their order."""
        for number, (bound, best, sign) in enumerate(((self._least, np.argmin, -1.0), (self._largest, np.argmax, 1.0))):
            at = best(values, axis=1)
            found = values[np.arange(len(values)), at]
            beyond = sign * found > sign * bound[part]
            bound[part][beyond] = found[beyond]
            self._when[number, part][beyond] = rows[at[beyond]]

    def finished(self) -> EnvelopeData | None:
        """Return the envelopes on rank 0, else None (collective); places are in the order of their coordinates."""
        field, comm = self._field, self._operators.world
        if self._operators.reduction is not None:
            self._from_coordinates(self._operators.reduction.vectors)
        n = len(field.places)
        arrays = (self._least, self._largest, self._times[self._when[0]], self._times[self._when[1]])
        parts = comm.gather((self._place, *(array.reshape(n, -1) for array in arrays)))
        if parts is None:
            return None
        number, *whole = (np.concatenate(part) for part in zip(*parts, strict=True))
        order = np.argsort(number)
        return EnvelopeData(self._places, field.names, field.units, *(part[order] for part in whole))

    def _from_coordinates(self, vectors: np.ndarray) -> None:
        """Multiply components x vectors x instants, block by block."""
        known = np.stack([self._field.known(column) for column in vectors.T], axis=1)
        n, nt = self._field.rows.shape[0], len(self._times)
        size = max(1, BLOCK_BYTES // (8 * max(nt, vectors.shape[1])))
        for at in range(0, n, size):
            part = slice(at, min(at + size, n))
            self._update((self._field.rows[part] @ known) @ self._coordinates.T, np.arange(nt), part)

    def kept(self) -> Kept:
        """Return what a checkpoint has to keep."""
        if self._operators.reduction is not None:
            return Kept({"coordinates": self._coordinates})
        own = np.stack([self._least, self._largest, *self._when.astype(float)]).reshape(4, len(self._place), -1)
        parts = self._operators.world.allgather((self._place, own))
        order = np.argsort(np.concatenate([number for number, _ in parts]))
        return Kept({"extremes": np.concatenate([values for _, values in parts], axis=1)[:, order]})

    def restore(self, kept: Kept) -> None:
        """Take in again what `kept` gave, on any number of ranks."""
        if self._operators.reduction is not None:
            self._coordinates[:] = kept.same["coordinates"]
            return
        mine = kept.same["extremes"][:, self._place].reshape(4, -1)
        self._least[:], self._largest[:], self._when[:] = mine[0], mine[1], mine[2:].astype(int)


def _numbered(places: np.ndarray, comm: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers (n,) of this rank's places (n, 3) m in the order of the coordinates of all, and all in that order (collective)."""
    parts = comm.allgather(places)
    whole = np.concatenate(parts)
    order = np.lexsort(np.round(whole / max(float(np.ptp(whole, axis=0).max()), np.finfo(float).tiny), 9).T)
    number = np.empty(len(whole), dtype=int)
    number[order] = np.arange(len(whole))
    first = sum(len(part) for part in parts[: comm.rank])
    return number[first : first + len(places)], whole[order]
