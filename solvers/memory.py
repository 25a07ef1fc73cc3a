"""How much memory a run will need, how much there is, and how much it took.

The estimates are fitted to measurements of plates of 4,300 to 264,000 dofs, four-node and nine-node cells, real and complex
(PETSc 3.18, MUMPS with its own choice of ordering); on those they are right to some 15 %. What a block of three or six dofs a node adds
follows from the block structure of a factor, not from a measurement.
"""

from __future__ import annotations

import resource
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

BASE = 2.0e8
"""Bytes of one process with all its libraries."""

ASSEMBLY = {False: 165.0, True: 235.0}
"""Bytes per entry of a matrix at the height of an assembly: three matrices, their forms and their copies; by complex scalars."""

KEPT = 0.7
"""Share of these that the solution cannot use again."""

FACTOR = {False: 13.5, True: 25.0}
"""Bytes per entry of a factor, the workspace of MUMPS included; by complex scalars."""

FIELD_BYTES = 2**30
"""Whole fields of a sweep are kept at every point only up to this much memory a rank."""


@dataclass(frozen=True)
class Size:
    """The size of a system and of its numbers."""

    n: int
    """Dofs."""
    entries: int
    """Entries of each matrix."""
    is_complex: bool

    @property
    def matrix(self) -> float:
        """Bytes of one matrix."""
        return self.entries * (20.0 if self.is_complex else 12.0)

    @property
    def vector(self) -> float:
        """Bytes of one vector."""
        return self.n * (16.0 if self.is_complex else 8.0)

    @property
    def factor(self) -> float:
        """Bytes of a factor: 13 n^1.156 entries at two dofs a node, of which a four-node cell couples 18 in a row."""
        block = max(2.0, self.entries / (9.0 * self.n))
        return FACTOR[self.is_complex] * 13.0 * (block / 2) ** 0.844 * self.n**1.156

    @property
    def assembly(self) -> float:
        """Bytes at the height of the assembly."""
        return ASSEMBLY[self.is_complex] * self.entries


def size_of(matrix: Any) -> Size:
    """Return the size of a matrix (collective)."""
    entries = int(matrix.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"])
    return Size(int(matrix.getSize()[0]), entries, issubclass(PETSc.ScalarType, complex))


def march_bytes(size: Size, channels: int, numbers: int) -> float:
    """Return the bytes of a march beyond the assembled model: matrix, factor, answers of the contacts, `numbers` archived."""
    return size.matrix + size.factor + (channels + 15) * size.vector + 24.0 * numbers


def group_bytes(size: Size, columns: int) -> float:
    """Return the bytes of a group of ranks that sweeps for `columns` right-hand sides: its own matrices, factor and dense blocks."""
    return 4 * size.matrix + size.factor + 5 * columns * size.vector


def sweep_bytes(size: Size, columns: int, points: int, ranks: int, groups: int) -> float:
    """Return the bytes of a sweep on all ranks beyond the assembled model, whole fields included where they are kept."""
    fields = points * columns * size.vector
    return groups * group_bytes(size, columns) + (fields if fields <= ranks * FIELD_BYTES else 0.0)


def run_bytes(size: Size, solution: float, ranks: int) -> float:
    """Return the bytes of a run on all ranks, `solution` being what its method needs beyond the assembled model."""
    return ranks * BASE + max(size.assembly, KEPT * size.assembly + solution)


def available_bytes(system: Path = Path("/")) -> float:
    """Return the bytes that are left to this process: those of the machine, or of its control groups where they allow less.

    `system` is where /proc and /sys are. Infinite where neither says anything.
    """
    left = [np.inf, *_left_in_groups(system)]
    try:
        lines = (system / "proc/meminfo").read_text(encoding="ascii").splitlines()
        left += [1024.0 * float(line.split()[1]) for line in lines if line.startswith("MemAvailable:")]
    except OSError:
        pass
    return float(min(left))


def _left_in_groups(system: Path) -> Iterator[float]:
    """Give what is left in each control group (version 2 or 1) that this process is in, and in those around it."""
    try:
        lines = (system / "proc/self/cgroup").read_text(encoding="ascii").splitlines()
    except OSError:
        return
    root = system / "sys/fs/cgroup"
    for line in lines:
        _, controllers, name = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        base = root / "memory" if controllers else root
        files = ("memory.limit_in_bytes", "memory.usage_in_bytes") if controllers else ("memory.max", "memory.current")
        folder = base / name.lstrip("/")
        for level in (folder, *folder.parents):
            try:
                limit, used = ((level / file).read_text(encoding="ascii").strip() for file in files)
                if limit != "max":
                    yield max(0.0, float(limit) - float(used) + _reclaimable(level))
            except (OSError, ValueError):
                pass  # the outermost group has no such files
            if level == base:
                break


def _reclaimable(group: Path) -> float:
    """Return the bytes of cached files that the kernel gives back when they are asked for."""
    stat = dict(line.split() for line in (group / "memory.stat").read_text(encoding="ascii").splitlines())
    return float(stat.get("total_inactive_file", stat.get("inactive_file", 0.0)))


def ranks_here(comm: Any) -> int:
    """Return the number of ranks of `comm` on this machine (collective)."""
    here = comm.Split_type(MPI.COMM_TYPE_SHARED)
    number = here.size
    here.Free()
    return int(number)


def peak_bytes(comm: Any) -> tuple[float, float]:
    """Return the largest memory that a rank has had so far, and the sum of all ranks' largest, in bytes (collective)."""
    mine = 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return comm.allreduce(mine, op=MPI.MAX), comm.allreduce(mine)
