"""How a march in time is kept in a checkpoint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from uplift.solvers.time_domain.kept import Kept
from uplift.solvers.time_domain.observers import Observer
from uplift.solvers.time_domain.state import State
from uplift.solvers.watch import Watch

KINDS = ("same", "shares", "fields")


class KeptMarch:
    """A march in its checkpoint: the stepper and all who look at it, each by its number."""

    def __init__(self, watch: Watch | None, comm: Any, stepper: Any, observers: Sequence[Observer]) -> None:
        """Take what is saved, and written over by `read`; `comm` holds all ranks that work on the model."""
        self._checkpoint = watch.checkpoint if watch is not None else None
        self._name = watch.name("march") if watch is not None else ""
        self._comm, self._stepper, self._observers = comm, stepper, observers

    def save(self, n: int) -> None:
        """Write everything as it stands after step `n` (collective)."""
        checkpoint = self._checkpoint
        assert checkpoint is not None
        arrays = {"step": np.array(n)}
        for number, part in enumerate((self._stepper, *self._observers)):
            kept = part.kept()
            for name, array in kept.same.items():
                arrays[f"same {number} {name}"] = array
            for name, array in kept.shares.items():
                # Rank by rank, not summed: sums are taken at the end, in the same order as without a break.
                parts = self._comm.gather(array)
                arrays[f"shares {number} {name}"] = np.array(parts if parts is not None else [])
            for name, array in kept.fields.items():
                whole = checkpoint.rows.gather(array)
                arrays[f"fields {number} {name}"] = whole if whole is not None else np.zeros(0)
        checkpoint.save(self._name, arrays)

    def read(self, start: State) -> int:
        """Return to the checkpoint of a march from `start`, if there is one; return the step that it was made after, -1 without one.

        Collective.
        """
        checkpoint = self._checkpoint
        found = checkpoint.load(self._name) if checkpoint is not None else None
        if checkpoint is None or found is None:
            return -1
        names = self._comm.bcast([(name, array.shape, array.dtype) for name, array in found.items()] if self._comm.rank == 0 else None)
        parts = [Kept() for _ in range(1 + len(self._observers))]
        step = -1
        for name, shape, kind in names:
            array = found.get(name)
            if name == "step":
                step = int(self._comm.bcast(array))
                continue
            how, number, own = name.split(" ", 2)
            value = (
                self._comm.bcast(array) if how == "same"
                else self._shares(array) if how == "shares"
                else checkpoint.rows.scatter(array, shape[1:], kind)
            )
            getattr(parts[int(number)], how)[own] = value
        self._stepper.restore(start, parts[0])
        for observer, kept in zip(self._observers, parts[1:], strict=True):
            observer.restore(kept)
        return step

    def _shares(self, stacked: np.ndarray | None) -> np.ndarray:
        """Give each rank its own share again; on another number of ranks, the sum of all to the first (collective)."""
        parts = None
        if stacked is not None:
            size = self._comm.size
            parts = list(stacked) if len(stacked) == size else [sum(stacked), *[0.0 * stacked[0]] * (size - 1)]
        return np.asarray(self._comm.scatter(parts))
