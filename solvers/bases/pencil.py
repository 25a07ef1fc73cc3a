"""The pencil K - lambda M of a model: sizes, shifted matrices, and the error of a structure that nothing holds."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from uplift.forms.operators import Operators
from uplift.solvers.errors import SolverError
from uplift.solvers.linear import SAME_PATTERN


def dofs_with_mass(operators: Operators) -> int:
    """Return the number of dofs that have mass, which is the number of modes (collective)."""
    return int(operators.comm.allreduce(int(np.sum(diagonal_of(operators.mass) > 0))))


def diagonal_of(matrix: Any) -> np.ndarray:
    """Return this rank's part (n_local,) of the diagonal of a matrix, its real part."""
    diagonal = matrix.getDiagonal()
    own = np.real(diagonal.array_r).copy()
    diagonal.destroy()
    return own


def shifted(operators: Operators, shift: float) -> Any:
    """Return K - shift M, which the caller destroys; `shift` in rad2/s2 (collective)."""
    matrix = operators.stiffness.copy()
    matrix.axpy(-shift, operators.mass, structure=SAME_PATTERN)
    return matrix


def gathered(matrix: Any) -> sparse.csr_matrix:
    """Return the whole of a distributed matrix on every rank (collective)."""
    indptr, indices, data = matrix.getValuesCSR()
    own = sparse.csr_matrix((data, indices, indptr), shape=(len(indptr) - 1, matrix.getSize()[1]))
    parts = matrix.comm.tompi4py().allgather(own)
    whole = sparse.vstack(parts, format="csr")
    whole.sort_indices()
    return whole


def unheld(count: int) -> SolverError:
    """Return the error of a structure with at least `count` motions without strain."""
    return SolverError(
        f"the structure can move without strain: it has at least {count} rigid-body modes or mechanisms, so its stiffness "
        "is singular. Hold it by springs or supports, or give a negative shift of the size of the lowest eigenvalues (rad2/s2) "
        "to obtain these modes at 0 Hz"
    )
