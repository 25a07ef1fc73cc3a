"""The law of uplift: a contact that pushes and cannot pull."""

from __future__ import annotations

import numpy as np


class CompressionOnly:
    """Contacts of stiffness k_c that carry compression and nothing else.

    The solvers work on the structure with every contact bonded. `release` gives the force that, applied to the plate,
    takes away from a bonded contact the tension that it cannot carry.
    """

    def __init__(self, stiffness: np.ndarray) -> None:
        """Take the contact stiffnesses (n_c,) in N/m."""
        self.stiffness = np.asarray(stiffness, dtype=float)

    def tension(self, elongation: np.ndarray) -> np.ndarray:
        """Return the force (nt, n_c) in N in the bonded contacts, tension positive, for elongations (nt, n_c) in m."""
        return self.stiffness * elongation

    def release(self, elongation: np.ndarray) -> np.ndarray:
        """Return the forces (nt, n_c) in N, >= 0, away from the ground, that cancel the tensions."""
        return np.maximum(0.0, self.tension(elongation))
