"""Envelopes over time of the section forces all over a plate, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class EnvelopeData:
    """The envelopes of a run, on rank 0."""

    places: np.ndarray
    """(n_places, 3) m."""
    names: tuple[str, ...]
    units: tuple[str, ...]
    least: np.ndarray
    """(n_places, n_components)."""
    largest: np.ndarray
    t_least: np.ndarray
    """(n_places, n_components) s: the first instant at which it is reached."""
    t_largest: np.ndarray
