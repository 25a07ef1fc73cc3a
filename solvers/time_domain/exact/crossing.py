"""Roots of Taylor polynomials: when a margin that is positive falls through zero within the shortest step."""

from __future__ import annotations

import numpy as np

ITERATIONS = 100
"""Halving alone needs 53; Newton's method a handful."""


def value(coefficients: np.ndarray, s: float) -> tuple[float, float]:
    """Return a polynomial with coefficients (m,), constant first, and its derivative at s."""
    total = slope = 0.0
    for c in coefficients[::-1].tolist():
        slope = slope * s + total
        total = total * s + c
    return total, slope


def first_crossing(coefficients: np.ndarray, until: float, small: float) -> float | None:
    """Return the first s in [0, until] at which the polynomial falls below zero, None if it stays above -small.

    Over a step that short it has at most one minimum inside: from above zero it falls once, or dips.
    """
    begin, slope = value(coefficients, 0.0)
    end, last_slope = value(coefficients, until)
    if end >= -small:
        if not slope < 0 < last_slope:
            return None
        derivative = coefficients[1:] * np.arange(1, len(coefficients))
        until = bracketed(derivative, 0.0, until)
        if value(coefficients, until)[0] >= -small:
            return None
    if begin <= 0:
        return 0.0
    return bracketed(coefficients, 0.0, until)


def bracketed(coefficients: np.ndarray, low: float, high: float) -> float:
    """Return the root between two points where the polynomial has different signs, by Newton's method kept inside by halving."""
    sign = 1.0 if value(coefficients, high)[0] > 0 else -1.0
    s = 0.5 * (low + high)
    for _ in range(ITERATIONS):
        here, slope = value(coefficients, s)
        if here == 0:
            return s
        if sign * here > 0:
            high = s
        else:
            low = s
        new = s - here / slope if slope else low
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - s) <= 2e-16 * max(high, 1e-300) or new in (low, high):
            return new
        s = new
    return s
