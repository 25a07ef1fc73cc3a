"""Exponentials of one generator over an interval and all its halves, by doubling what they differ from one by."""

from __future__ import annotations

import math

import numpy as np

TERMS = 13
"""Of the Taylor series: its remainder at |A| h = 1/2 is 0.5^14 / 14! = 7e-16."""


def halvings(generator: np.ndarray, interval: float) -> int:
    """Return how often `interval` s must be halved for |A| h <= 1/2, |A| bounded by the root of its two norms' product."""
    size = math.sqrt(float(np.linalg.norm(generator, 1)) * float(np.linalg.norm(generator, np.inf))) * interval
    return max(0, math.ceil(math.log2(max(2 * size, 1.0))))


def doubled(generator: np.ndarray, interval: float, levels: int) -> list[np.ndarray]:
    """Return exp(A H / 2^l) - 1 for l = 0 ... `levels`, each (N, N), with H the `interval` in s.

    The smallest is a Taylor series; D(2 h) = 2 D + D D then loses nothing, where squaring 1 + D would lose the digits of D.
    Source of the idea: N. J. Higham, Functions of Matrices (2008), section 10.3, there for the exponential itself.
    """
    step = generator * (interval / 2**levels)
    square = step @ step
    cube = square @ step
    # Horner's rule in A^3 (Paterson and Stockmeyer): 13 terms for six products.
    unit = np.eye(len(step))
    factor = [1 / math.factorial(k) for k in range(TERMS + 1)]
    total = factor[12] * unit + factor[13] * step
    for k in (9, 6, 3):
        total = total @ cube + factor[k] * unit + factor[k + 1] * step + factor[k + 2] * square
    difference = total @ cube + step + factor[2] * square
    found = [difference]
    for _ in range(levels):
        difference = 2 * difference + difference @ difference
        found.append(difference)
    return found[::-1]


def advanced(generator: np.ndarray, state: np.ndarray, time: float) -> np.ndarray:
    """Return exp(A t) X for a time with |A| t <= 1/2, by the Taylor series."""
    total, term = state.copy(), state
    for k in range(1, TERMS + 1):
        term = generator @ term * (time / k)
        total += term
    return total
