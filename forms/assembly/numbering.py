"""Row numbers of the assembled system: the free displacement dofs of each rank, then the dofs added by its joints."""

from __future__ import annotations

from typing import Any

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from uplift.forms.contact.supports import AXES
from uplift.meshes.compat import Mat, Space, Vec


class NodeDofs:
    """Dofs of a space whose nodes all have the same components."""

    def __init__(self, components: tuple[str, ...]) -> None:
        """Take the components of a node in their order, such as DX and DRZ."""
        self.column = {axis: components.index(f"D{name}") for axis, name in enumerate(AXES) if f"D{name}" in components}
        """Column of each axis that the space has a component along or about."""
        self._block = len(components)

    def dof(self, node: int, axis: int) -> int:
        """Return the dof of the space that is the component along or about `axis` of a node."""
        return self._block * node + self.column[axis]


class Numbering:
    """The rows of a system made of the dofs of a function space, less the restrained ones, plus extra dofs.

    Each rank's rows are contiguous: its own free dofs in the order of dolfinx, then its extra dofs. Restrained dofs
    (zero displacement relative to the base) have no row, so they bring neither penalties nor spurious modes.
    """

    def __init__(self, space: Space, restrained: np.ndarray, extra: int) -> None:
        """Count the rows (collective); `restrained` are owned local scalar dofs of `space`, `extra` this rank's extra rows."""
        index_map, block = space.dofmap.index_map, space.dofmap.index_map_bs
        self.comm = space.mesh.comm
        self.n_field = index_map.size_local * block
        free = np.ones(self.n_field, dtype=bool)
        free[restrained] = False
        self.n_free = int(free.sum())
        self.n_local = self.n_free + extra
        ends = np.cumsum(self.comm.allgather(self.n_local))
        self.n = int(ends[-1])
        self.start = int(ends[self.comm.rank]) - self.n_local
        self.local_row = np.where(free, np.cumsum(free) - 1, -1)
        """Row within this rank of each owned dof of the space, -1 where restrained."""
        self._free = free

    def extra_row(self, number: np.ndarray | int) -> Any:
        """Return the row within this rank of its extra dofs `number` = 0, 1, ..."""
        return self.n_free + number

    def matrices(self, fields: list[Mat], extras: list[sparse.coo_matrix]) -> list[Mat]:
        """Join assembled matrices of the space with extra entries, all on one sparsity pattern (collective).

        `fields` are PETSc matrices over all dofs of the space; `extras` hold each rank's own entries, (n_local, n_local)
        in rows of this rank. The pattern is the union of all, so that linear combinations need no new entries.
        """
        rows, columns, values = self._own_entries(fields)
        for k, matrix in enumerate(extras):
            rows = np.concatenate([rows, matrix.row])
            columns = np.concatenate([columns, matrix.col + self.start])
            values = [np.concatenate([v, matrix.data if j == k else np.zeros(matrix.nnz)]) for j, v in enumerate(values)]
        joined = []
        for v in values:
            local = sparse.coo_matrix((v, (rows, columns)), shape=(self.n_local, self.n)).tocsr()
            local.sort_indices()
            matrix = PETSc.Mat().createAIJ(
                size=((self.n_local, self.n), (self.n_local, self.n)),
                csr=(local.indptr.astype(PETSc.IntType), local.indices.astype(PETSc.IntType), local.data),
                comm=self.comm,
            )
            matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
            matrix.setOption(PETSc.Mat.Option.SYMMETRY_ETERNAL, True)
            # Products of matrix and vector that look for rows of equal pattern take up to five times as long.
            matrix.setOption(PETSc.Mat.Option.USE_INODES, False)
            joined.append(matrix)
        return joined

    def _own_entries(self, fields: list[Mat]) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
        """Return row, column and the values of each matrix for the free entries in this rank's rows."""
        csr = [matrix.getValuesCSR() for matrix in fields]
        indptr, columns, _ = csr[0]
        for other_ptr, other_columns, _ in csr[1:]:
            if not (np.array_equal(other_ptr, indptr) and np.array_equal(other_columns, columns)):
                raise RuntimeError("matrices of one space differ in their sparsity pattern")
        rows = np.repeat(self.local_row, np.diff(indptr))
        wanted, place = np.unique(columns, return_inverse=True)
        columns = self._global_rows(fields[0], wanted)[place]
        keep = (rows >= 0) & (columns >= 0)
        return rows[keep], columns[keep], [values[keep] for _, _, values in csr]

    def _global_rows(self, field: Mat, dofs: np.ndarray) -> np.ndarray:
        """Return the global row of each global dof of the space in `dofs`, wherever it lives (collective)."""
        if self.comm.size == 1:
            return self.local_row[dofs]
        owned = field.createVecRight()
        owned.setArray(np.where(self._free, self.local_row + self.start, -1))
        here = PETSc.IS().createGeneral(dofs, comm=PETSc.COMM_SELF)
        found = PETSc.Vec().createSeq(len(dofs))
        scatter = PETSc.Scatter().create(owned, here, found, None)
        scatter.scatter(owned, found)
        rows = np.rint(found.array.real).astype(np.int64)
        for thing in (owned, here, found, scatter):
            thing.destroy()
        return rows

    def vector(self, field: np.ndarray | None = None, extra: np.ndarray | None = None) -> Vec:
        """Return a PETSc vector of the system from owned field values (n_field,) and extra values."""
        vector = PETSc.Vec().createMPI((self.n_local, self.n), comm=self.comm)
        vector.array[:] = 0.0
        if field is not None:
            vector.array[: self.n_free] = field[self._free]
        if extra is not None:
            vector.array[self.n_free :] = extra
        return vector

    def field(self, values: np.ndarray) -> np.ndarray:
        """Return the owned dofs of the space (n_field,) from this rank's part (n_local,) of a solution."""
        full = np.zeros(self.n_field, dtype=values.dtype)
        full[self._free] = values[: self.n_free]
        return full
