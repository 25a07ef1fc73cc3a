"""MPI before all that links to it, for the wheels dolfinx-solver-real and dolfinx-solver-complex.

Their libraries find MPI only where `dolfinx_solver` has loaded it. It cannot be loaded at once: who takes another interpreter
(`uplift.drivers.process.choose_scalars`) must do so before MPI is initialised. So it comes with the first module that needs it.
"""

from __future__ import annotations

import importlib
import sys
from typing import Any

LINKED = ("dolfinx", "petsc4py", "slepc4py")
"""Modules of the wheels that link to MPI."""


class MpiFirst:
    """A finder of modules that finds none: it loads `dolfinx_solver` when the first of `LINKED` is looked for, and leaves."""

    @staticmethod
    def find_spec(name: str, path: Any = None, target: Any = None) -> None:
        """See that MPI is there; return None, so that the module is found as usual."""
        if name in LINKED:
            sys.meta_path.remove(MpiFirst)
            importlib.import_module("dolfinx_solver")


sys.meta_path.insert(0, MpiFirst)
