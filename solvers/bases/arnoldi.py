"""The Krylov space of a model of second order, in coordinates of a basis of its displacements: the two-level orthogonal Arnoldi process.

With s = scale * mu the answers of A + s D + s^2 M are those of a model of first order of twice the size, for pairs (x, mu x), whose
Krylov space grows by

    (x, y) -> (-A^-1 (scale D x + scale^2 M y), x).

Both halves of all pairs lie in one space of displacements, which gains no more vectors by a step than there are pairs in a block.
So a pair is held as its coordinates (p, q) in an orthonormal basis of that space, and what is done here costs nothing on a large mesh.

Sources: Bai and Su, SIAM J. Matrix Anal. Appl. 26 (2005) 640 (second-order Krylov spaces); Lu, Su and Bai, ibid. 37 (2016) 195 (two
levels of orthogonal vectors).
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

NEW = 1e-8
"""A pair of which less than this part is new has nothing to add."""


class PairSpace:
    """Blocks of orthonormal pairs of displacements, in coordinates of a basis that grows."""

    def __init__(self) -> None:
        """Begin with no pair."""
        self._blocks: list[tuple[np.ndarray, np.ndarray]] = []

    def last(self, size: int) -> tuple[np.ndarray, np.ndarray]:
        """Return both halves (size, b) of the pairs of the last block in a basis of `size` vectors."""
        upper, lower = self._blocks[-1]
        return _padded(upper, size), _padded(lower, size)

    def add(self, upper: np.ndarray) -> int:
        """Append what is new in the pairs with the upper halves (m, b) of the next step, or the first; return how many that are.

        The lower halves are the upper ones of the block before, or zero.
        """
        size = len(upper)
        lower = self.last(size)[0] if self._blocks else np.zeros_like(upper)
        pairs = np.vstack([upper, lower])
        length = np.linalg.norm(pairs, axis=0)
        pairs = pairs[:, length > 0] / length[length > 0]
        for _ in range(2):
            for known in self._blocks:
                block = np.vstack([_padded(half, size) for half in known])
                pairs -= block @ (block.T @ pairs)
        turned, triangle, _ = linalg.qr(pairs, mode="economic", pivoting=True)
        new = turned[:, np.abs(np.diag(triangle)) > NEW]
        self._blocks.append((new[:size], new[size:]))
        return new.shape[1]


def _padded(coordinates: np.ndarray, size: int) -> np.ndarray:
    """Return coordinates (m, b) in a basis that has grown to `size` vectors."""
    return np.vstack([coordinates, np.zeros((size - len(coordinates), coordinates.shape[1]))])
