"""Files that are there whole or not at all, also where the disk is full."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

MARGIN = 2**14
"""Bytes of an HDF5 file beside its data."""


def reserve(path: Path, size: int) -> None:
    """Make a file of `size` bytes in which every byte has its place on the disk. Raises `OSError` where there is no room for it.

    HDF5 finds out that a disk is full when it closes a file, and may then end the process.
    """
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        os.posix_fallocate(handle, 0, max(size, 1))
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.EOPNOTSUPP):  # a file system that knows no reservations
            raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        os.close(handle)


@contextlib.contextmanager
def whole_file(path: Path, size: int) -> Iterator[Path]:
    """Give a name beside `path` with room for `size` bytes; the file takes its place when the block ends without an error.

    Raises `OSError`, as which errors of HDF5 in the block come too.
    """
    handle, name = tempfile.mkstemp(prefix=".writing-", dir=path.absolute().parent)
    os.close(handle)
    staging = Path(name)
    try:
        with hdf5_errors(path):
            reserve(staging, size)
            yield staging
        umask = os.umask(0)
        os.umask(umask)
        staging.chmod(0o666 & ~umask)  # as any file that is made; a temporary one is its owner's alone
        with staging.open("rb") as written:
            os.fsync(written.fileno())
        staging.replace(path)
    finally:
        with contextlib.suppress(OSError):
            staging.unlink(missing_ok=True)


@contextlib.contextmanager
def hdf5_errors(path: Path) -> Iterator[None]:
    """Turn the errors of HDF5 in the block, which are of many kinds, into an `OSError` on `path` with its reason in one line."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        number = getattr(error, "errno", None) or errno.EIO
        if isinstance(error, OSError) and error.strerror and error.filename:
            raise
        raise OSError(number, os.strerror(number), str(path)) from error
