"""Small dense systems."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from uplift.solvers.errors import SolverError


def solve_definite(matrix: np.ndarray, right: np.ndarray, what: str) -> np.ndarray:
    """Solve a small symmetric positive definite system, scaled to a unit diagonal. Raises `SolverError` if it is not one."""
    scale = np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    try:
        factor = linalg.cho_factor(matrix / np.outer(scale, scale), lower=True)
    except linalg.LinAlgError as error:
        raise SolverError(f"the matrix of the {what} is not positive definite: nothing holds the structure") from error
    return (linalg.cho_solve(factor, (right.T / scale).T).T / scale).T
