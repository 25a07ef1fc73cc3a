"""Values at a point from values at points around it: the weights of a least-squares polynomial."""

from __future__ import annotations

import numpy as np

DEPENDENT = 1e-6
"""Part of a term's size that must be left beside the terms before it: values at points in two rows know no curvature across them."""


def weights_at(point: np.ndarray, points: np.ndarray, degree: int) -> np.ndarray:
    """Return the weights (n,) of values at `points` (n, 2) m that give the value at `point` (2,) m of the polynomial fitted to them.

    The polynomial is of `degree` in the plane, less the terms that the points cannot tell from lower ones. Values of a polynomial that
    is left are given back exactly. Source: Zienkiewicz and Zhu, IJNME 33 (1992) 1331.
    """
    away = points - point
    _, _, turned = np.linalg.svd(points - points.mean(axis=0), full_matrices=True)
    local = away @ turned.T
    local /= max(float(np.max(np.abs(local), initial=0.0)), np.finfo(float).tiny)
    terms = [local[:, 0] ** (n - k) * local[:, 1] ** k for n in range(degree + 1) for k in range(n + 1)]
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
