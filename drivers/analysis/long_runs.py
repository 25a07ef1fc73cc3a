"""Long runs: checkpoints in the folder of the results, and what signals do."""

from __future__ import annotations

import hashlib
import json
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uplift.drivers.analysis.progress import Progress
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import Scene
from uplift.solvers.errors import Stopped

if TYPE_CHECKING:
    from uplift.drivers.analysis.assembled_scene import AssembledScene
    from uplift.solvers.watch import Watch


def identity(scene: Scene, folder: Path, request: Request, *options: str) -> str:
    """Return the digest of all that the histories follow from: the scene, the files in `folder` that it names, what is asked."""
    files = {}

    def visit(entry: Any) -> None:
        if isinstance(entry, dict):
            entry = list(entry.values())
        if isinstance(entry, list):
            for item in entry:
                visit(item)
        elif isinstance(entry, str) and entry and (folder / entry).is_file():
            files[entry] = hashlib.blake2b((folder / entry).read_bytes()).hexdigest()

    visit(scene.source)
    asked = [request.method, request.passes, request.tolerance, request.basis, *options]
    text = json.dumps([scene.source, files, asked], sort_keys=True, default=str)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


class Signals:
    """SIGINT and SIGTERM end a run in order: a watched loop hears of them, anything else ends at once. `with` restores them."""

    NUMBERS = (signal.SIGINT, signal.SIGTERM)

    def __init__(self) -> None:
        """Begin with no loop to tell."""
        self.watch: Watch | None = None

    def __enter__(self) -> Signals:
        """Take the signals."""
        self._before = [signal.signal(number, self._heard) for number in self.NUMBERS]
        return self

    def take_again(self) -> None:
        """Take the signals once more: libraries that begin after this one take some of them, or back to their default."""
        for number in self.NUMBERS:
            signal.signal(number, self._heard)

    def __exit__(self, *_: object) -> None:
        """Give them back."""
        for number, handler in zip(self.NUMBERS, self._before, strict=True):
            signal.signal(number, handler)

    def _heard(self, number: int, frame: Any) -> None:
        watch = self.watch
        if watch is not None and watch.listening and not watch.signal:
            watch.signal = number
            return
        checkpoint = watch.checkpoint if watch is not None else None
        kept = checkpoint is not None and checkpoint.holds
        raise Stopped(number, f"; the last checkpoint stays in {checkpoint.folder}" if checkpoint and kept else "; nothing was written",
                      together=False)


@contextmanager
def watched(
    assembly: AssembledScene, identity: str, folder: Path, signals: Signals, *, seconds: float, resume: bool, quiet: bool
) -> Iterator[Watch]:
    """Give the watch of a run whose checkpoints lie in `folder`, written every `seconds` s (0: none).

    They are removed when the block ends well, and stay if it does not (collective). Raises `ModelError` if they cannot be written.
    """
    from uplift.solvers.checkpoint import Checkpoint
    from uplift.solvers.watch import Watch

    checkpoint = None
    if seconds > 0 or resume:
        comm, labels = assembly.operators.comm, assembly.plate.labels
        checkpoint = Checkpoint(folder, identity, comm, labels, seconds=seconds or float("inf"), resume=resume)
    with Progress(quiet=quiet) as progress:
        signals.take_again()
        signals.watch = Watch(checkpoint=checkpoint, progress=progress if progress.shown else None)
        try:
            yield signals.watch
        except BaseException:
            if checkpoint is not None and not checkpoint.holds:
                checkpoint.leave()
            raise
        if checkpoint is not None:
            checkpoint.clear()
