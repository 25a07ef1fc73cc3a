"""Groups of ranks that share the points of a sweep: each group holds all matrices, its ranks share their rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from uplift.forms.operators import Operators
from uplift.meshes.checked import ModelError


@dataclass(frozen=True)
class Layout:
    """Groups of consecutive ranks, as equal as can be; `with` frees the communicator of this rank's group.

    Every group holds the whole system: the rows of all ranks are dealt to its members in the order of the ranks, so that
    rows that lie together in space stay together.
    """

    world: Any
    groups: int
    comm: Any
    """The communicator of this rank's group."""

    @property
    def group(self) -> int:
        """The group of this rank."""
        return int(self.world.rank * self.groups // self.world.size)

    def ranks(self, group: int) -> range:
        """Return the ranks of a group."""
        first, end = (-(-g * self.world.size // self.groups) for g in (group, group + 1))
        return range(first, end)

    def holder(self, group: int, rank: int) -> int:
        """Return the rank that holds in a group the rows of `rank`."""
        members = self.ranks(group)
        return members[rank * len(members) // self.world.size]

    def held(self) -> list[int]:
        """Return the ranks whose rows this rank holds in its group."""
        return [r for r in range(self.world.size) if self.holder(self.group, r) == self.world.rank]

    def holders(self) -> list[int]:
        """Return the rank in each group that holds the rows of this rank."""
        return [self.holder(group, self.world.rank) for group in range(self.groups)]

    def __enter__(self) -> Layout:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Free the group's communicator."""
        if self.comm is not self.world:
            self.comm.Free()


def split(world: Any, groups: int) -> Layout:
    """Split a communicator into `groups` groups (collective). Raises `ModelError` if it has not so many ranks."""
    if not 1 <= groups <= world.size:
        raise ModelError("--groups", f"expected 1 to {world.size}, the number of ranks, got {groups}")
    comm = world if groups == 1 else world.Split(world.rank * groups // world.size, world.rank)
    return Layout(world, groups, comm)


def choose_groups(world: Any, points: int, whole: float, budget: float) -> int:
    """Return as many groups as there are points for and as memory allows, a divisor of the number of ranks.

    A group that holds everything alone needs `whole` bytes, shared among its members; `budget` are the bytes of a rank. Factors of
    one matrix are better made by one rank after another than by all together: groups of one rank are the quickest.
    """
    sizes = [m for m in range(1, world.size + 1) if world.size % m == 0]
    fit = [m for m in sizes if whole / m <= budget and world.size // m <= max(points, 1)]
    return int(world.size // (fit or sizes[-1:])[0])


@dataclass
class System:
    """The matrices, right-hand sides and functionals of a sweep on one communicator; `with` destroys matrices that are copies."""

    stiffness: Any
    mass: Any
    damping: Any | None
    columns: np.ndarray
    """(n_local, n_columns): right-hand sides, this rank's rows."""
    outputs: sparse.csr_matrix
    """(n_rows, n_local): all that is observed, this rank's columns."""
    owns: bool
    """Whether the matrices are its own."""

    def __enter__(self) -> System:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Destroy the matrices."""
        for matrix in (self.stiffness, self.mass, self.damping):
            if self.owns and matrix is not None:
                matrix.destroy()


def group_system(operators: Operators, columns: np.ndarray, outputs: sparse.csr_matrix, layout: Layout) -> System:
    """Give each group the whole system (collective); `columns` and `outputs` are those of the ranks of the world."""
    if layout.groups == 1:
        return System(operators.stiffness, operators.mass, operators.damping, columns, outputs, owns=False)
    matrices = [None if m is None else _matrix(m, layout) for m in (operators.stiffness, operators.mass, operators.damping)]
    n_columns, rows = columns.shape[1], sparse.csr_matrix(outputs.T)
    width = _from_ranks(np.array([len(columns)]), layout)
    own = _from_ranks(np.ascontiguousarray(columns, dtype=PETSc.ScalarType), layout).reshape(int(width.sum()), n_columns)
    lengths, indices, data = (_from_ranks(a, layout) for a in (np.diff(rows.indptr), rows.indices, rows.data))
    there = sparse.csr_matrix((data, indices, np.concatenate([[0], np.cumsum(lengths)])), shape=(len(own), outputs.shape[0]))
    return System(matrices[0], matrices[1], matrices[2], own, sparse.csr_matrix(there.T), owns=True)


def _matrix(matrix: Any, layout: Layout) -> Any:
    """Return the matrix on this rank's group, its rows numbered as before."""
    indptr, columns, values = matrix.getValuesCSR()
    lengths, columns, values = (_from_ranks(a, layout) for a in (np.diff(indptr), columns, values))
    n_local, n = len(lengths), matrix.getSize()[0]
    csr = np.concatenate([[0], np.cumsum(lengths)]).astype(PETSc.IntType), columns, values
    copy = PETSc.Mat().createAIJ(size=((n_local, n), (n_local, n)), csr=csr, comm=layout.comm)
    copy.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    copy.setOption(PETSc.Mat.Option.SYMMETRY_ETERNAL, True)
    copy.setOption(PETSc.Mat.Option.USE_INODES, False)
    return copy


def _from_ranks(array: np.ndarray, layout: Layout) -> np.ndarray:
    """Send this rank's array to all its holders; return those of the ranks that this one holds, flat and one after another."""
    world = layout.world
    array = np.ascontiguousarray(array).reshape(-1)
    sizes = world.allgather(array.size)
    held = layout.held()
    found = np.empty(sum(sizes[r] for r in held), dtype=array.dtype)
    ends = np.cumsum([sizes[r] for r in held])
    requests = [
        world.Irecv(found[end - sizes[rank] : end], source=rank) for rank, end in zip(held, ends, strict=True)
    ]
    requests += [world.Isend(array, dest=rank) for rank in layout.holders()]
    MPI.Request.Waitall(requests)
    return found


def to_ranks(values: list[np.ndarray], layout: Layout, rows: list[int], width: int) -> dict[int, np.ndarray]:
    """Return the answers of all groups in the distribution of the world (collective).

    `values` are this rank's parts (n_held, width) of its group's answers; `rows` is the number of rows of each rank. The
    result holds for each group its answers (number of them, n_local, width).
    """
    world = layout.world
    held = layout.held()
    counts = world.allgather(len(values))
    requests, parts = [], {}
    for group in range(layout.groups):
        source = layout.holder(group, world.rank)
        parts[group] = np.empty((counts[source], rows[world.rank], width), dtype=complex)
        requests.append(world.Irecv(parts[group], source=source))
    starts = np.concatenate([[0], np.cumsum([rows[r] for r in held])])
    stacked = np.stack(values) if values else np.zeros((0, int(starts[-1]), width), dtype=complex)
    pieces = [np.ascontiguousarray(stacked[:, a:b]) for a, b in zip(starts[:-1], starts[1:], strict=True)]
    requests += [world.Isend(piece, dest=rank) for rank, piece in zip(held, pieces, strict=True)]
    MPI.Request.Waitall(requests)
    return parts
