"""Checkpoints: the state of a long loop in HDF5 files that a kill at any moment leaves whole.

A file is made in memory, written under another name, synchronised with the disk and renamed: until that moment the one
before stands. Each bears the identity of its run, of the model's rows and of its own contents; what differs is refused by name.
Arrays over the rows of the model are stored in an order that knows nothing of ranks: by the rows' labels, which are places.
"""

from __future__ import annotations

import hashlib
import io
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from uplift.meshes.checked import ModelError
from uplift.meshes.findings import say
from uplift.solvers.hdf5_reading import READ_ERRORS, numbers, see_sound

FORMAT = "uplift checkpoint 1"

KEY = "--resume"

T = TypeVar("T")


def on_first_rank(comm: Any, function: Callable[[], T]) -> T:
    """Return on every rank what `function` returns on rank 0; a `ModelError` that it raises there is raised everywhere (collective)."""
    answer: Any = None
    if comm.rank == 0:
        try:
            answer = function(), None
        except ModelError as error:
            answer = None, (error.key, error.message)
    result, wrong = comm.bcast(answer)
    if wrong is not None:
        raise ModelError(*wrong)
    return result  # what rank 0 returned


class RowOrder:
    """The rows of a distributed system in the order of their labels, which does not depend on the number of ranks."""

    def __init__(self, comm: Any, labels: np.ndarray) -> None:
        """Take this rank's labels (n_local, k), integers, each row's different from all others' (collective)."""
        self.comm = comm
        parts = comm.gather(np.ascontiguousarray(labels, dtype=np.int64))
        self._counts = comm.gather(len(labels))
        self._order: np.ndarray | None = None
        digest = None
        if parts is not None:
            whole = np.concatenate(parts)
            self._order = np.lexsort(whole.T[::-1])
            whole = whole[self._order]
            if len(whole) > 1 and not np.any(whole[1:] != whole[:-1], axis=1).all():
                raise RuntimeError("two rows of the system bear the same label")
            digest = hashlib.blake2b(whole.tobytes(), digest_size=16).hexdigest()
        self.digest: str = comm.bcast(digest)
        """Digest of all labels in order."""
        self._n_local = len(labels)

    def gather(self, local: np.ndarray) -> np.ndarray | None:
        """Return on rank 0 an array (n, ...) over all rows from each rank's part (n_local, ...), None elsewhere (collective)."""
        local = np.ascontiguousarray(local)
        width = int(np.prod(local.shape[1:], dtype=int))
        if self._order is None:
            self.comm.Gatherv(local, None)
            return None
        assert self._counts is not None
        whole = np.empty((len(self._order), *local.shape[1:]), dtype=local.dtype)
        self.comm.Gatherv(local, [whole, [count * width for count in self._counts]])
        return whole[self._order]

    def scatter(self, whole: np.ndarray | None, shape: tuple[int, ...], kind: Any) -> np.ndarray:
        """Return this rank's part (n_local, *shape) of an array (n, *shape) of numbers `kind` on rank 0 (collective)."""
        local = np.empty((self._n_local, *shape), dtype=kind)
        width = int(np.prod(shape, dtype=int))
        if self._order is None:
            self.comm.Scatterv(None, local)
            return local
        assert whole is not None and self._counts is not None
        by_rank = np.empty_like(whole, dtype=kind)
        by_rank[self._order] = whole
        self.comm.Scatterv([by_rank, [count * width for count in self._counts]], local)
        return local


class Checkpoint:
    """The checkpoints of one run in one folder."""

    def __init__(
        self, folder: Path, identity: str, comm: Any, labels: np.ndarray, *, seconds: float = 60.0, resume: bool = False
    ) -> None:
        """Make the folder (collective). Raises `ModelError` if it cannot be written.

        `identity` is that of the scene and of what is asked of it, `labels` (n_local, k) those of the rows (see `RowOrder`).
        A checkpoint is due every `seconds` s of work. With `resume` what lies in the folder is read, else it is replaced.
        """
        self.folder = folder
        self.seconds = seconds
        self.resume = resume
        self.rows = RowOrder(comm, labels)
        self._identity = identity
        self._comm = comm
        self._written: set[str] = set()
        self._failed = ""
        on_first_rank(comm, self._prepare)

    def _prepare(self) -> None:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if self.folder.is_symlink():
                raise ModelError("--checkpoint", f"{self.folder} is a link; expected a folder, in which checkpoints are made and removed")
            with tempfile.TemporaryFile(dir=self.folder):
                pass
        except OSError as error:
            raise ModelError("--checkpoint", f"cannot write into {self.folder}: {error.strerror}") from None
        there = self._own()
        if self.resume and not any(self.folder.glob("*.h5")):  # a damaged one is named when it is read
            say("checkpoint", f"no checkpoint in {self.folder}: the run begins at its beginning")
        if there and not self.resume:
            say("checkpoint", f"{self.folder} holds checkpoints of an earlier run, which this one replaces; --resume would go on from them")

    def load(self, name: str) -> dict[str, np.ndarray] | None:
        """Return on rank 0 the arrays that were saved under a name, an empty dictionary elsewhere; None on all if there are none.

        Raises `ModelError` if the file is not a whole checkpoint of this very run (collective).
        """
        if not self.resume:
            return None
        found: dict[str, np.ndarray] = {}

        def read() -> bool:
            path = self._path(name)
            if not path.exists():
                return False
            found.update(read_file(path, self._identity, self.rows.digest))
            self._written.add(path.name)
            return True

        return found if on_first_rank(self._comm, read) else None

    def save(self, name: str, arrays: dict[str, np.ndarray]) -> bool:
        """Write arrays under a name, from rank 0; return whether that went well (collective).

        Where it fails the checkpoint before it stays, and a line says so.
        """
        return bool(self._comm.bcast(self._save(name, arrays) if self._comm.rank == 0 else None))

    def _save(self, name: str, arrays: dict[str, np.ndarray]) -> bool:
        path = self._path(name)
        try:
            if not self._written:
                # The first of this run: from here on, nothing of an earlier one may be taken for its continuation.
                for other in self._own():
                    if other != path:
                        other.unlink()
            write_file(path, arrays, self._identity, self.rows.digest)
        except OSError as error:
            self._failed = f"{path.name} could not be written into {self.folder}: {error.strerror or error}"
            left = "the checkpoint before it stays" if self._written else "there is none"
            say("checkpoint", f"{self._failed}; the run goes on, and {left}")
            return False
        self._failed = ""
        self._written.add(path.name)
        return True

    def state_in_words(self, comm: Any) -> str:
        """Return what a run that now ends leaves behind (collective)."""
        if comm.rank != 0:
            return ""
        if self._failed:
            return f"{self._failed}; " + ("the checkpoint before it can be resumed" if self._written else "there is nothing to resume")
        return f"checkpoint in {self.folder}; go on with --resume"

    @property
    def holds(self) -> bool:
        """Whether this run has written or read a checkpoint that now lies there; known on rank 0."""
        return bool(self._written)

    def clear(self) -> None:
        """Remove the checkpoints of a run that has come to its end, on rank 0."""
        if self._comm.rank == 0:
            for path in (*self._own(), *self.folder.glob("*.unfinished")):  # a kill may have left a file half written
                if not path.is_symlink():
                    path.unlink()
        self.leave()

    def _own(self) -> list[Path]:
        """Return the checkpoints in the folder: files that say what they are, and no links."""
        return [path for path in sorted(self.folder.glob("*.h5")) if _is_checkpoint(path)]

    def leave(self) -> None:
        """Remove the folder if it is empty, on rank 0."""
        if self._comm.rank == 0 and self.folder.is_dir() and not any(self.folder.iterdir()):
            self.folder.rmdir()

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.h5"


def _is_checkpoint(path: Path) -> bool:
    import h5py

    try:
        if path.is_symlink():
            return False
        with h5py.File(path, "r") as file:
            return bool(file.attrs.get("format") == FORMAT)
    except READ_ERRORS:
        return False


def _digest(arrays: dict[str, np.ndarray]) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape} ".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def write_file(path: Path, arrays: dict[str, np.ndarray], identity: str, rows: str) -> None:
    """Write one checkpoint so that `path` is at every moment the old file or the new one. Raises `OSError`."""
    import h5py

    arrays = {name: np.asarray(array) for name, array in arrays.items()}
    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        for name, array in arrays.items():
            file.create_dataset(name, data=array)
        file.attrs.update({"format": FORMAT, "run": identity, "rows": rows, "contents": _digest(arrays)})
    unfinished = path.with_suffix(".unfinished")
    try:
        unfinished.unlink(missing_ok=True)
        with unfinished.open("xb") as out:  # a new file, never one behind a link
            out.write(image.getbuffer())
            out.flush()
            os.fsync(out.fileno())
        unfinished.replace(path)
    except OSError:
        unfinished.unlink(missing_ok=True)
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # the new name itself
    finally:
        os.close(folder)


def read_file(path: Path, identity: str, rows: str) -> dict[str, np.ndarray]:
    """Return the arrays of one checkpoint. Raises `ModelError` if it is damaged, foreign or of another run."""
    import h5py

    try:
        see_sound(path)
        with h5py.File(path, "r") as file:
            facts = {key: str(value) for key, value in file.attrs.items()}
            if facts.get("format") != FORMAT:
                raise ModelError(KEY, f"{path} is not a checkpoint of this program")
            arrays = {name: numbers(file, name, "fiucbSU") for name in file}
    except READ_ERRORS as error:
        if isinstance(error, ModelError):
            raise
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise ModelError(KEY, f"{path} is truncated or no checkpoint at all ({reason:.80})") from None
    if facts.get("run") != identity:
        raise ModelError(KEY, f"{path} is a checkpoint of another scene or another method")
    if facts.get("rows") != rows:
        raise ModelError(KEY, f"{path} is a checkpoint of another mesh")
    if facts.get("contents") != _digest({name: np.asarray(array) for name, array in arrays.items()}):
        raise ModelError(KEY, f"{path} is damaged: its contents are not what was written")
    return arrays
