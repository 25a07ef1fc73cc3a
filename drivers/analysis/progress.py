"""The progress bar: on standard error, on a terminal, on rank 0."""

from __future__ import annotations

import sys
import time
from collections import deque
from typing import TextIO

from uplift.drivers.process import launch_rank

WIDTH = 30

MEMORY = 10.0
"""s: the remaining time follows from what was done in the last so many seconds, or the last half of a run that is shorter."""

SURE = 1.0
"""s of work before a remaining time is told."""


class Progress:
    """Draws one line that is overwritten; `with` it, and the line is gone at the end."""

    def __init__(self, *, quiet: bool, stream: TextIO | None = None) -> None:
        """Stay silent if `quiet`, on other ranks than 0, and where `stream` (standard error) is no terminal."""
        self._stream = stream or sys.stderr
        self.shown = not quiet and launch_rank() == 0 and self._stream.isatty()
        self._what = ""
        self._seen: deque[tuple[float, int]] = deque()

    def __enter__(self) -> Progress:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Clear the line."""
        if self.shown:
            self._stream.write("\r\x1b[K")
            self._stream.flush()

    def __call__(self, what: str, done: int, total: int) -> None:
        """Show that `done` of `total` steps or points are done."""
        if not self.shown:
            return
        now = time.perf_counter()
        if what != self._what or (self._seen and done < self._seen[-1][1]):
            self._what = what
            self._seen.clear()
        self._seen.append((now, done))
        self._stream.write(f"\r{line(what, done, total, self.remaining(total))}\x1b[K")
        self._stream.flush()

    def remaining(self, total: int) -> float | None:
        """Return the seconds that are left at the present pace; None while that is not known."""
        now, done = self._seen[-1]
        begin, _ = self._seen[0]
        while len(self._seen) > 2 and now - self._seen[1][0] > max(MEMORY, (now - begin) / 2):
            self._seen.popleft()
        then, before = self._seen[0]
        if now - then < SURE or done == before:
            return None
        return (total - done) * (now - then) / (done - before)


def line(what: str, done: int, total: int, remaining: float | None) -> str:
    """Return the line of a bar, `remaining` in s."""
    share = done / max(total, 1)
    full = int(WIDTH * share)
    left = "" if remaining is None or done >= total else f"  {_clock(remaining)} left"
    return f"{what} {done:,} / {total:,} [{'#' * full}{'.' * (WIDTH - full)}] {100 * share:3.0f} %{left}"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
