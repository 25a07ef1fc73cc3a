"""A gmsh session of this process, on rank 0 only."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from inspect import signature
from typing import Any

from uplift.meshes.checked import ModelError

NEEDED = "libglu1-mesa libgl1 libxrender1 libxcursor1 libxfixes3 libxext6 libxft2 libfontconfig1 libxinerama1 libx11-6 libgomp1"
"""Debian's packages of the system libraries that gmsh's wheel links to without bringing them."""


@contextmanager
def gmsh_session() -> Iterator[Any]:
    """Give an empty gmsh, silent, and close it on leaving (call on one rank only).

    Raises `ModelError` where gmsh or a system library that it links to is not installed.
    """
    gmsh = load_gmsh()
    # Newer releases let Ctrl-C kill the process, past whoever wants to write a checkpoint, unless told not to.
    newer = {"interruptible": False} if "interruptible" in signature(gmsh.initialize).parameters else {}
    gmsh.initialize([], False, **newer)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        yield gmsh
    finally:
        gmsh.finalize()


def load_gmsh() -> Any:
    """Return the module gmsh, loaded by the meshing rank only: it takes most of a second. Raises `ModelError` if it cannot be loaded."""
    try:
        import gmsh
    except OSError as error:
        raise ModelError("gmsh", f"{error}; its wheel needs libraries of the system: apt install {NEEDED}") from None
    except ModuleNotFoundError:
        raise ModelError("gmsh", "is not installed: apt install python3-gmsh, or pip install gmsh in a virtual environment") from None
    return gmsh
