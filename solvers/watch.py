"""What goes on beside a long loop: progress, checkpoints, and the wish to stop.

The ranks of a loop meet every fraction of a second and otherwise go on alone. Where they meet next is counted in the loop's own steps and
agreed among them, so that a step costs one comparison of integers more.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from uplift.solvers.checkpoint import Checkpoint
from uplift.solvers.errors import Stopped

MEETING = 0.25
"""s between two meetings of the ranks: how late a signal is heard and a checkpoint begun, beside the step that is under way."""

WORTH_KEEPING = 1.0
"""s of work from which on a loop that is complete is kept for a run that goes on after it."""

NEVER = np.iinfo(np.int64).max


class Watch:
    """Watches the long loops of one run."""

    def __init__(
        self, *, checkpoint: Checkpoint | None = None, progress: Callable[[str, int, int], None] | None = None
    ) -> None:
        """`progress(what, done, total)` is called on rank 0 whenever the ranks meet."""
        self.checkpoint = checkpoint
        self.progress = progress
        self.listening = False
        """Whether a loop is under way that will hear of a signal."""
        self.signal = 0
        """Number of the signal that came, if one did; a signal handler sets it."""
        self._counts: dict[str, int] = {}

    def name(self, what: str) -> str:
        """Return the name under which the next loop of the kind `what` is kept: march-1, march-2, ..."""
        self._counts[what] = self._counts.get(what, 0) + 1
        return f"{what}-{self._counts[what]}"


class Loop:
    """One loop of `total` steps under a watch; `with` it, and `meet` whenever `done >= next`."""

    def __init__(self, watch: Watch | None, comm: Any, what: str, total: int, done: int, save: Callable[[], None]) -> None:
        """`save()` writes a checkpoint of the loop as it stands (collective)."""
        self._watch = watch
        self._comm = comm
        self._what = what
        self._total = total
        self._save = save
        self._begun = done
        self._start = self._saved = time.perf_counter()
        self.next = NEVER if watch is None else done + 1

    def __enter__(self) -> Loop:
        """Begin to listen for signals."""
        if self._watch is not None:
            self._watch.listening = True
            self._show(self._begun)
        return self

    def __exit__(self, *_: object) -> None:
        """End to listen."""
        if self._watch is not None:
            self._watch.listening = False

    def meet(self, done: int) -> None:
        """Show the progress, write a checkpoint if one is due, agree on the next meeting (collective).

        Raises `Stopped` where a signal has come, after a checkpoint.
        """
        watch, now = self._watch, time.perf_counter()
        assert watch is not None
        checkpoint = watch.checkpoint
        due = checkpoint is not None and now - self._saved >= checkpoint.seconds
        pace = (done - self._begun) / max(now - self._start, 1e-9)
        # Rank 0 alone decides when; a signal counts wherever it came.
        mine = (watch.signal, due, done + max(1, int(MEETING * pace))) if self._comm.rank == 0 else (watch.signal, 0, 0)
        agreed = np.array(mine, dtype=np.int64)
        if self._comm.size > 1:
            self._comm.Allreduce(MPI.IN_PLACE, agreed, op=MPI.MAX)
        stop, write, self.next = (int(v) for v in agreed)
        self._show(done)
        if checkpoint is not None and (write or stop):
            self._save()
            self._saved = time.perf_counter()
        if stop:
            where = f" at {done} of {self._total} {self._what}"
            if checkpoint is None:
                raise Stopped(stop, f"{where}; nothing was written")
            raise Stopped(stop, f"{where}; {checkpoint.state_in_words(self._comm)}")

    def finish(self) -> None:
        """Keep the complete loop if it took long (collective)."""
        self._show(self._total)
        checkpoint = self._watch.checkpoint if self._watch is not None else None
        if checkpoint is not None:
            long = self._comm.bcast(time.perf_counter() - self._saved > min(WORTH_KEEPING, checkpoint.seconds))
            if long and self._begun < self._total:
                self._save()

    def _show(self, done: int) -> None:
        if self._watch is not None and self._watch.progress is not None and self._comm.rank == 0:
            self._watch.progress(self._what, done, self._total)
