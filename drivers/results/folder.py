"""The folder of a run: files that are all there or not there at all."""

from __future__ import annotations

import csv
import fcntl
import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.process import launch_rank
from uplift.meshes.checked import ModelError


def writable_folder(path: Path) -> None:
    """Make the folder and see that it can be written. Raises `ModelError` if not."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise ModelError("--out", f"cannot write into {path}: {error.strerror}; name another folder or mend its permissions") from None


SUMMARY = "summary.json"
"""What every folder of results holds."""


WRITTEN = (".csv", ".h5", ".html", ".json", ".med", ".png", ".vtu", ".xdmf")
"""Suffixes of the files that commands write."""


@contextmanager
def claimed_folder(path: Path, *, overwrite: bool, mark: str = SUMMARY, held: str = "the results of a run") -> Iterator[None]:
    """Make the folder and keep other runs out of it until the block ends; on rank 0 alone, the others pass.

    The lock is on the folder itself and leaves nothing behind; a file system that knows no locks goes without. Raises `ModelError` if
    the folder cannot be written, if a run is writing into it, if a folder in it bears the name of a file, or if it holds the file
    `mark`, which says that `held` is there, and that is not to be overwritten.
    """
    if launch_rank() != 0:
        yield
        return
    writable_folder(path)
    handle = os.open(path, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ModelError("--out", f"another run is writing into {path}; wait for it or name another folder") from None
        except OSError:
            pass
        if (path / mark).exists() and not overwrite:
            raise ModelError("--out", f"{path} holds {held}; name another folder, or add --overwrite")
        refuse_folders(path, [entry.name for entry in path.iterdir() if entry.suffix in WRITTEN])
        yield
    finally:
        os.close(handle)


@contextmanager
def all_or_nothing(folder: Path) -> Iterator[Path]:
    """Give a hidden folder to write into; its files move into `folder` together when the block ends without an error.

    Where one of them cannot, as where a folder bears its name, those that did go back and the older ones stay. Raises `ModelError` then.
    """
    staging = Path(tempfile.mkdtemp(prefix=".writing-", dir=folder))
    try:
        yield staging
        _move_together(sorted(staging.iterdir()), folder, Path(tempfile.mkdtemp(prefix="before-", dir=staging)))
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _move_together(files: list[Path], folder: Path, before: Path) -> None:
    """Move files into a folder, what they replace into the folder `before`; undo all of it where one of them cannot be moved."""
    refuse_folders(folder, [path.name for path in files])
    moves: list[tuple[Path, Path]] = []
    try:
        for path in files:
            target = folder / path.name
            for here, there in ((target, before / path.name), (path, target)):
                if os.path.lexists(here):
                    here.replace(there)
                    moves.append((here, there))
    except OSError as error:
        for here, there in reversed(moves):
            there.replace(here)
        raise ModelError("--out", f"cannot write into {folder}: {error.strerror}; the files that were there are as before") from None


def refuse_folders(folder: Path, names: Iterable[str]) -> None:
    """Raise `ModelError` where a folder bears the name of a file that is to be written."""
    for name in names:
        if (folder / name).is_dir():
            raise ModelError("--out", f"{folder / name} is a folder, where a file of the results is to be; move it away")


def replaceable_file(path: Path, *, overwrite: bool) -> None:
    """See that a file can be written there. Raises `ModelError` for a folder, and for a file that is not to be overwritten."""
    if path.is_dir():
        raise ModelError("--out", f"{path} is a folder; expected the name of a file")
    if path.exists() and not overwrite:
        raise ModelError("--out", f"{path} is there already; name another file, or add --overwrite")
    writable_folder(path.absolute().parent)


def write_history(path: Path, times: np.ndarray, names: tuple[str, ...], values: np.ndarray) -> None:
    """Write t in s and one column for each name; numbers with all digits of a double."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["t", *names])
        for t, row in zip(times, values, strict=True):
            writer.writerow([repr(round(float(t), 12)), *(repr(float(v)) for v in row)])


def write_summary(path: Path, summary: dict[str, Any]) -> None:
    """Write the summary as JSON."""
    path.write_text(json.dumps(summary, indent=2, ensure_ascii=False, default=str) + "\n", encoding="utf-8")


def versions() -> dict[str, str]:
    """Return the versions of what computed the run."""
    import platform

    import dolfinx
    import numpy
    import scipy
    from petsc4py import PETSc

    return {
        "python": platform.python_version(),
        "dolfinx": str(dolfinx.__version__),  # type: ignore[attr-defined]  # not in its __all__
        "petsc": ".".join(str(n) for n in PETSc.Sys.getVersion()),
        "petsc scalars": "complex" if issubclass(PETSc.ScalarType, complex) else "real",
        "numpy": numpy.__version__,
        "scipy": scipy.__version__,
    }


def processor() -> str:
    """Return the name of the processor."""
    import platform

    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())


def write_columns(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write named columns (n,); numbers with all digits of a double, nothing for nan."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for row in zip(*(column.tolist() for column in columns.values()), strict=True):
            writer.writerow(["" if value != value else repr(value) if isinstance(value, float) else value for value in row])
