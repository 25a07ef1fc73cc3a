"""The folder of compiled forms: one run at a time compiles into it, and what cannot be loaded from it is removed and made again."""

from __future__ import annotations

import fcntl
import logging
import math
import os
import struct
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from uplift.meshes.checked import ModelError

log = logging.getLogger(__name__)

LOCK = "uplift.lock"
"""Locked by the run that compiles, and empty unless that run has not come to its end."""

OLD = 60.0
"""s after which nobody is at work any more on a form of another program that is not ready."""


@contextmanager
def form_cache(comm: Any) -> Iterator[None]:
    """Let no other run compile until the block ends, and first mend the cache; on rank 0 alone, which compiles before the others load.

    FFCx by itself waits 10 s for a form that another process has begun and then gives up, for ever where that process was killed; and
    a library that was cut short, by a full disk say, ends the process that loads it with a bus error. Where the folder cannot be
    written, or its file system knows no locks, it is used as it is. Raises `ModelError` if others can write it.
    """
    from uplift.meshes.compat import form_cache_folder

    folder = form_cache_folder()
    see_trusted(folder)
    handle = _locked(folder) if comm.rank == 0 else None
    if handle is None:
        yield
        return
    try:
        last = os.fstat(handle)
        mend(folder, last.st_mtime if last.st_size else math.inf)
        os.pwrite(handle, b"compiling\n", 0)
        yield
        os.ftruncate(handle, 0)
    finally:
        os.close(handle)


def see_trusted(folder: Path) -> None:
    """Raise `ModelError` unless the folder and its libraries, which are run, belong to this user or root and no other can write them."""
    for path in (folder, *folder.glob("libffcx_*")):
        try:
            facts = path.stat()
        except OSError:
            continue
        if facts.st_uid not in (os.geteuid(), 0):
            who = f"belongs to the user {facts.st_uid}"
        elif facts.st_mode & 0o002 or (facts.st_mode & 0o020 and facts.st_gid != os.getegid()):
            who = "can be written by others"
        else:
            continue
        raise ModelError("form cache", f"{path} {who}, and what lies there is run; remove it, or name another folder in XDG_CACHE_HOME")


def _locked(folder: Path) -> int | None:
    """Wait for the lock and return its file, None where there can be none."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError:
        return None
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            log.info("waiting for another run, which compiles forms in %s", folder)
            fcntl.flock(handle, fcntl.LOCK_EX)
    except OSError:
        os.close(handle)
        return None
    except BaseException:
        os.close(handle)
        raise
    return handle


def mend(folder: Path, died: float) -> None:
    """Remove the forms that cannot be loaded: of those that are not ready the ones begun since `died`, s since 1970, and old ones."""
    forms = defaultdict(list)
    for path in folder.glob("libffcx_*"):
        if path.suffix != ".failed":
            forms[path.name.partition(".")[0]].append(path)
    for name, files in forms.items():
        with suppress(OSError):
            if not _usable(name, files, died):
                log.info("%s in the form cache is broken or was never finished; it is made again", name)
                for path in files:
                    path.unlink(missing_ok=True)


def _usable(name: str, files: list[Path], died: float) -> bool:
    """Tell whether a form can be loaded, or is being compiled by another program."""
    kinds = {path.name.removeprefix(name) for path in files}
    if ".c.cached" in kinds:
        libraries = [path for path in files if path.suffix == ".so"]
        return ".c" in kinds and bool(libraries) and all(_whole(path) for path in libraries)
    newest = max(path.stat().st_mtime for path in files)
    return newest < died and newest > time.time() - OLD


def _whole(library: Path) -> bool:
    """Tell whether a shared library is as long as its header says: the table of its sections stands at its end (System V ABI, ELF)."""
    with library.open("rb") as file:
        head = file.read(64)
    if len(head) < 64 or head[:4] != b"\x7fELF":
        return False
    if head[4] != 2:
        return True  # 32 bits, where the fields stand elsewhere
    order = "<" if head[5] == 1 else ">"
    (table,), (size, number) = struct.unpack_from(f"{order}Q", head, 0x28), struct.unpack_from(f"{order}HH", head, 0x3A)
    return int(table + size * number) <= library.stat().st_size
