"""A gmsh session of this process, on rank 0 only."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from inspect import signature
from typing import Any


@contextmanager
def gmsh_session() -> Iterator[Any]:
    """Give an empty gmsh, silent, and close it on leaving (call on one rank only)."""
    import gmsh  # loaded on the meshing rank only: the library takes most of a second

    # Newer releases let Ctrl-C kill the process, past whoever wants to write a checkpoint, unless told not to.
    newer = {"interruptible": False} if "interruptible" in signature(gmsh.initialize).parameters else {}
    gmsh.initialize([], False, **newer)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        yield gmsh
    finally:
        gmsh.finalize()
