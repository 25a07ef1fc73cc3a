"""Values at a point from values at points around it: the weights of a least-squares polynomial."""

from __future__ import annotations

import numpy as np

DEPENDENT = 1e-6
"""Part of a term's size that must be left beside the terms before it: values at points in two rows know no curvature across them."""


def weights_at(points: np.ndarray, degree: int, *, in_each: bool) -> np.ndarray:
    """Return the weights (n,) of values at `points` (n, 2) m that give the value at the origin of the polynomial fitted to them.

    The polynomial is of `degree` in each of the two coordinates, or in both together, less the terms that the points cannot tell from
    lower ones. Values of a polynomial that is left are given back exactly. Source: Zienkiewicz and Zhu, IJNME 33 (1992) 1331.
    """
    x, y = points.T / max(float(np.max(np.abs(points), initial=0.0)), np.finfo(float).tiny)
    powers = [(n - k, k) for n in range(2 * degree + 1) for k in range(n + 1)]
    terms = [x**i * y**j for i, j in powers if (max(i, j) if in_each else i + j) <= degree]
    basis: list[np.ndarray] = []
    kept = []
    for term in terms:
        rest = term.copy()
        for _ in range(2):
            for direction in basis:
                rest -= (direction @ rest) * direction
        size = float(np.linalg.norm(rest))
        if size > DEPENDENT * float(np.linalg.norm(term)) and size > 0:
            basis.append(rest / size)
            kept.append(term)
    # At the point itself every term but the constant is zero.
    weights: np.ndarray = np.linalg.pinv(np.stack(kept, axis=1))[0]
    return weights
