"""Gram-Schmidt in the product of the mass."""

from __future__ import annotations

import numpy as np

from uplift.forms.operators import Operators
from uplift.solvers.bases.basis import apply, inner

DEPENDENT = 1e-8
"""A vector of which less than this part is new, in the norm of the mass, adds no direction to a basis."""

DEPENDENT_GRAM = 1e-12
"""Directions of a block below this eigenvalue of its scaled Gram matrix are round-off."""

NEARLY = 1e-3
"""A block this close to orthonormal is so to round-off after one more turn."""


def orthonormalise(columns: np.ndarray, known: np.ndarray, operators: Operators, recent: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return the new directions of `columns` (n_local, b), M-orthonormal to `known` and to one another, and M times them (collective).

    Block Gram-Schmidt, twice, more often only if that does not do. `recent` is the first of the `known` vectors (n_local, m) that the
    columns are not orthogonal to but for round-off: A^-1 M is symmetric in the product of the mass, so A^-1 M times the last block of a
    Krylov space has parts in the last two blocks only. The first turn looks at these, the second removes what round-off has left in all.
    """
    mass, comm, room = operators.mass, operators.comm, operators.n - known.shape[1]
    moved = apply(mass, columns)
    square = comm.allreduce(np.einsum("ij,ij->j", columns, moved))
    keep = square > 0
    X, moved = (np.asfortranarray(a[:, keep] / np.sqrt(square[keep])) for a in (columns, moved))
    for turn in range(5):
        before = known if turn else known[:, recent:]
        X -= before @ inner(before, moved, comm)
        moved = apply(mass, X)
        gram = inner(X, moved, comm)
        away = np.max(np.abs(gram - np.eye(len(gram))), initial=0.0)
        size = np.sqrt(np.maximum(np.diag(gram), 0.0))
        keep = size > DEPENDENT
        gram, size = gram[np.ix_(keep, keep)], size[keep]
        values, directions = np.linalg.eigh(gram / np.outer(size, size))
        wanted = values > DEPENDENT_GRAM
        wanted[: max(0, len(wanted) - room)] = False  # a small model is used up: the rest is round-off
        turned = directions[:, wanted] / np.sqrt(values[wanted]) / size[:, None]
        X, moved = (np.asfortranarray(a[:, keep] @ turned) for a in (X, moved))
        if turn and away < NEARLY:
            break
    return X, moved
