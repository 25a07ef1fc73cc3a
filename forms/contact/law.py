"""The law of uplift: contacts that push and cannot pull.

The solvers work on the structure with every contact bonded, and add to the plate the release forces that take away what a
contact cannot carry. A contact has one channel, its normal force, and a second one, its tangential force, if that
is released while the contact is open. Channels 0 ... n_c - 1 are the normal ones, in the order of the contacts.
"""

from __future__ import annotations

import numpy as np


class UpliftLaw:
    """Unilateral contacts: compression is carried, tension is not; sideways bonded or released while open.

    A sideways force that is released is zero while the contact is open; where the contact closes again it sticks to
    the place at which it landed: its release force then stays as it was. It follows the contact one time step behind.
    """

    def __init__(
        self, stiffness: np.ndarray, flexibility: np.ndarray, owner: np.ndarray | None = None, mass: np.ndarray | None = None
    ) -> None:
        """Take four arrays: `stiffness` (n_channels,), `flexibility`, `owner` and `mass`, each (n_channels,).

        Stiffness in N/m turns the elongations of bonded contacts into their forces; flexibility in m/N is that of the
        support as a whole, spring and contact in series; owner is the contact that each channel is part of (none given:
        every channel is a contact); mass in kg is that of the node between spring and contact (none given: zero).
        """
        self.stiffness = np.asarray(stiffness, dtype=float)
        self.flexibility = np.asarray(flexibility, dtype=float)
        n = len(self.stiffness)
        self.owner = np.arange(n) if owner is None else np.asarray(owner, dtype=int)
        self.mass = np.zeros(n) if mass is None else np.asarray(mass, dtype=float)
        self.n_contacts = int(self.owner.max(initial=-1)) + 1

    @property
    def n_channels(self) -> int:
        """Number of channels, normal ones first."""
        return len(self.stiffness)

    def tension(self, elongation: np.ndarray) -> np.ndarray:
        """Return the force (..., n_channels) in N in the bonded contacts, tension positive, for elongations in m."""
        return self.stiffness * elongation

    def release(self, elongation: np.ndarray) -> np.ndarray:
        """Return the forces (..., n_channels) in N that cancel the tensions of the normal channels, never negative.

        This is the law of the published pass, which leaves the sideways forces alone.
        """
        release = np.maximum(0.0, self.tension(elongation))
        release[..., self.n_contacts :] = 0.0
        return release

    def compression(self, tension: np.ndarray, release: np.ndarray) -> np.ndarray:
        """Return the contact forces (..., n_c) in N, compression positive, under bonded tensions and release forces."""
        normal = slice(0, self.n_contacts)
        return release[..., normal] - tension[..., normal]

    def gap(self, release: np.ndarray) -> np.ndarray:
        """Return the openings (..., n_c) in m of the contacts, 0 where closed: the release force over the support's stiffness."""
        return release[..., : self.n_contacts] * self.flexibility[: self.n_contacts]
