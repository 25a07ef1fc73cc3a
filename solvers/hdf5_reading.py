"""Data sets of HDF5 files that may be damaged, or made by anybody."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np

PACKED = 1100
"""Bytes that one byte of a file can become: gzip's limit is 1032 (RFC 1951)."""

READ_ERRORS = (
    OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, IndexError, OverflowError, MemoryError, RecursionError,
)
"""What h5py, and code that takes apart what it gives, raise on a file whose contents are not what they should be."""


PATIENCE, BYTES_A_SECOND = 20.0, 5e6
"""How long a sound file may take to be read, in s and by its size; a slow disk reads ten times as fast."""

MEMORY = 2**30
"""Bytes that reading a file may take beside ten times its size."""

CHILD = """
import resource, sys, h5py
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[2]), int(sys.argv[2])))
def see(key, item):
    list(item.attrs.items())
    if isinstance(item, h5py.Dataset) and item.shape and len(item.shape) and item.id.get_storage_size():
        for first in range(0, item.shape[0], max(1, item.shape[0] // 64)):
            item[first : first + max(1, item.shape[0] // 64)]
with h5py.File(sys.argv[1], "r") as file:
    see("", file)
    file.visititems(see)
"""


def see_sound(path: Path) -> None:
    """Read all of a file in a process of its own: on a damaged one HDF5 may end the process, or never come to an end.

    Raises `ValueError` where it does, or takes too much time or memory.
    """
    size = path.stat().st_size
    clean = {key: value for key, value in os.environ.items() if not key.startswith(("OMPI_", "PMIX_", "PRTE_", "PMI_"))}
    command = [sys.executable, "-P", "-c", CHILD, str(path), str(MEMORY + 10 * size)]
    try:
        done = subprocess.run(command, env=clean, capture_output=True, text=True, timeout=PATIENCE + size / BYTES_A_SECOND)
    except subprocess.TimeoutExpired:
        raise ValueError("HDF5 does not come to its end") from None
    if done.returncode:
        lines = done.stderr.strip().splitlines()
        raise ValueError(lines[-1] if lines else "HDF5 fails in it")


def dataset(file: Any, key: str, kinds: str = "fiu", *, ndim: int | None = None, columns: int | None = None) -> Any:
    """Return a data set of an open file that holds what it says.

    Its numbers are of the `kinds` of numpy's letters, along `ndim` axes, `columns` along the last; they lie in the file itself, and the
    file is large enough for them. Raises `ValueError` else, and `KeyError` where there is none.
    """
    path = ""
    for part in key.strip("/").split("/"):
        path += f"/{part}"
        if not isinstance(file.get(path, getlink=True), h5py.HardLink):
            raise ValueError(f"{key} is a link" if path in file else f"there is no {key}")
    item = file[key]
    if not isinstance(item, h5py.Dataset) or item.dtype.kind not in kinds or item.external or item.is_virtual or item.shape is None:
        raise ValueError(f"{key} is not what it should be")
    if (ndim is not None and item.ndim != ndim) or (columns is not None and item.shape[-1] != columns):
        raise ValueError(f"{key} has the shape {item.shape}")
    if size_of(item) > PACKED * item.id.get_storage_size() + 1024:
        raise ValueError(f"{key} has the shape {item.shape} and no values")
    return item


def numbers(file: Any, key: str, kinds: str = "fiu", **shape: Any) -> np.ndarray:
    """Return the values of such a data set."""
    values: np.ndarray = dataset(file, key, kinds, **shape)[()]
    return values


def size_of(item: Any) -> int:
    """Return the bytes that a data set takes in memory."""
    size = int(item.dtype.itemsize)
    for length in item.shape or ():
        size *= int(length)
    return size
