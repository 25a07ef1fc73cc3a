"""How much memory a run will need, how much there is, and how much it took."""

from __future__ import annotations

import resource
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc


def size_of(matrix: Any) -> tuple[int, int]:
    """Return the numbers of rows and of entries of a matrix (collective)."""
    return int(matrix.getSize()[0]), int(matrix.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"])


def sweep_bytes(n: int, entries: int, columns: int) -> float:
    """Return the bytes of a group of ranks that sweeps a matrix of `n` rows and `entries` entries for so many right-hand sides."""
    matrices = 4 * entries * 20.0
    return matrices + 4 * 16.0 * columns * n + 16 * 80.0 * n * 1.5


def available_bytes() -> float:
    """Return the bytes that this machine, or the control group of this process, still has."""
    return 4e9


def ranks_here(comm: Any) -> int:
    """Return the number of ranks of `comm` on this machine (collective)."""
    here = comm.Split_type(MPI.COMM_TYPE_SHARED)
    number = here.size
    here.Free()
    return int(number)
