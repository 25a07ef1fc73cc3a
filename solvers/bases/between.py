"""The model between the vectors of a growing basis: small matrices that follow it."""

from __future__ import annotations

import numpy as np

from uplift.solvers.bases.basis import Projected
from uplift.solvers.dense import solve_definite


class Between:
    """Stiffness, damping, mass (m, m), generalised forces (m, n_columns) and outputs (n_rows, m) of m vectors, M-orthonormal."""

    def __init__(self, n_columns: int, n_rows: int) -> None:
        """Begin with no vector."""
        self.stiffness, self.damping, self.mass = (np.zeros((0, 0)) for _ in range(3))
        self.generalised = np.zeros((0, n_columns))
        self.observed = np.zeros((n_rows, 0))
        self.shift, self.sigma = 0.0, 0.0
        """The matrix A that the basis comes from is K + sigma M + shift C."""

    @property
    def size(self) -> int:
        """Number m of vectors."""
        return len(self.stiffness)

    @property
    def projected(self) -> Projected:
        """The matrices."""
        return Projected(self.stiffness, self.mass, self.damping)

    def append(self, stiffness: np.ndarray, damping: np.ndarray, generalised: np.ndarray, observed: np.ndarray) -> None:
        """Take in b more vectors: the last columns (m + b, b) of stiffness and damping, forces (b, n_columns), outputs (n_rows, b)."""
        self.stiffness, self.damping = _bordered(self.stiffness, stiffness), _bordered(self.damping, damping)
        self.mass = np.eye(len(self.stiffness))
        self.generalised = np.vstack([self.generalised, generalised])
        self.observed = np.hstack([self.observed, observed])

    def untangle(self, first: int) -> np.ndarray:
        """Turn the vectors from `first` on so that K does not couple them; return the turn (m - first, m - first).

        They are stiff, 1e13 to 1e16 per unit of mass, and mixed with one another the softer ones would lose their digits.
        """
        _, turned = np.linalg.eigh(self.stiffness[first:, first:])
        for matrix in (self.stiffness, self.damping):
            matrix[:, first:] = matrix[:, first:] @ turned
            matrix[first:] = turned.T @ matrix[first:]
        self.generalised[first:] = turned.T @ self.generalised[first:]
        self.observed[:, first:] = self.observed[:, first:] @ turned
        return turned

    def shrink(self, size: int) -> None:
        """Keep the first `size` vectors."""
        self.stiffness, self.damping, self.mass = (a[:size, :size].copy() for a in (self.stiffness, self.damping, self.mass))
        self.generalised, self.observed = self.generalised[:size], self.observed[:, :size]

    def dynamic(self, omega: float) -> np.ndarray:
        """Return K + i omega C - omega^2 M (m, m)."""
        return self.stiffness + 1j * omega * self.damping - omega**2 * self.mass

    def shifted_sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return A (m, m) and the size (b^T A^-1 b)^(1/2) of each column b of the forces, (n_columns,)."""
        matrix = self.stiffness + self.sigma * self.mass + self.shift * self.damping
        return matrix, np.sqrt(np.einsum("ij,ij->j", self.generalised, solve_definite(matrix, self.generalised, "Krylov basis")))


def _bordered(matrix: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return a symmetric (m, m) from its leading part and its last columns (m, b)."""
    m, b = columns.shape
    whole = np.empty((m, m))
    whole[: m - b, : m - b] = matrix
    whole[:, m - b :] = columns
    whole[m - b :, : m - b] = columns[: m - b].T
    corner = whole[m - b :, m - b :]
    whole[m - b :, m - b :] = (corner + corner.T) / 2
    return whole
