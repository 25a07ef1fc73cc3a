"""What a run leaves: displacements, contact forces and resultants in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.forms.contact.law import UpliftLaw


@dataclass(frozen=True)
class Ledger:
    """Energies in J from time 0, at the archived instants, each (nt,): input = kinetic + strain + springs + damped + numerical."""

    kinetic: np.ndarray
    strain: np.ndarray
    """Of the plate, with its change since time 0 counted like the others."""
    springs: np.ndarray
    """Of plain springs and joints, open contacts holding none."""
    damped: np.ndarray
    """Dissipated by viscous damping."""
    work: np.ndarray
    """Done by the loads: gravity and inertia of the ground motion."""

    @property
    def numerical(self) -> np.ndarray:
        """What the time integration itself took away (positive) or added, the residual of the ledger."""
        stored = self.kinetic + self.strain + self.springs
        return self.work - (stored - stored[0]) - self.damped


@dataclass(frozen=True)
class History:
    """Histories at archived instants, the same on every rank."""

    times: np.ndarray
    """(nt,) s."""
    probes: np.ndarray
    """(nt, n_probes) m, in the order of the model's probe functionals."""
    elongation: np.ndarray
    """(nt, n_channels) m, of the bonded contacts, positive when open."""
    release: np.ndarray
    """(nt, n_channels) N, the release forces that acted."""
    reactions: np.ndarray
    """(nt, 3): base shear N, vertical reaction N, overturning moment N m; no columns where the model knows no ground."""
    peak: int = 0
    """Index of the instant at which a probe is farthest from zero."""
    peak_field: np.ndarray | None = None
    """(n_local,) m: this rank's part of the solution at `peak`, where it was kept."""
    ledger: Ledger | None = None
    """Energies, where they were kept."""
    accelerations: np.ndarray | None = None
    """(nt, n_probes) m/s2 of the probes, relative to the base: those of the time scheme, of the spectrum, or (from the Laplace points)
    second differences of the displacements at every step."""
    gap: np.ndarray | None = None
    """(nt, n_c) m, openings of the contacts where auxiliary nodes have masses that count; else they follow from the release forces."""

    def openings(self, law: UpliftLaw) -> np.ndarray:
        """Return the openings (nt, n_c) m of the contacts, zero where closed."""
        return law.gap(self.release) if self.gap is None else self.gap
