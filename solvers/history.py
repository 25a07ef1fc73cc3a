"""What a run leaves: displacements, contact forces and resultants in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.forms.contact.law import UpliftLaw
from uplift.forms.operators import Outputs


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
    outputs: np.ndarray
    """(nt, n_rows): the outputs of the model, in the units of `layout`."""
    layout: Outputs
    """The rows of `outputs`, in groups."""
    release: np.ndarray
    """(nt, n_channels) N, the release forces that acted."""
    peak: int = 0
    """Index of the instant at which a probe is farthest from zero."""
    peak_field: np.ndarray | None = None
    """(n_local,) m: this rank's part of the displacements at `peak`, where they were kept."""
    ledger: Ledger | None = None
    """Energies, where they were kept."""
    accelerations: np.ndarray | None = None
    """(nt, n_probes) m/s2 of the probes, relative to the base: those of the time scheme, of the spectrum, or (from the Laplace points)
    second differences of the displacements at every step."""
    gap: np.ndarray | None = None
    """(nt, n_c) m, openings of the contacts where auxiliary nodes have masses that count; else they follow from the release forces."""

    def group(self, name: str) -> np.ndarray:
        """Return the outputs (nt, n) of one group."""
        return self.outputs[:, self.layout.layout[name]]

    @property
    def probes(self) -> np.ndarray:
        """Displacements in m and rotations in rad of the probes (nt, n_probes)."""
        return self.group("probes")

    @property
    def elongation(self) -> np.ndarray:
        """Elongations (nt, n_channels) m of the bonded contacts, positive when open."""
        return self.group("elongation")

    @property
    def reactions(self) -> np.ndarray:
        """Resultants (nt, n) of the ground's forces on the plate in N and N m; no columns where the model knows no ground."""
        return self.group("reactions")

    def openings(self, law: UpliftLaw) -> np.ndarray:
        """Return the openings (nt, n_c) m of the contacts, zero where closed."""
        return law.gap(self.release) if self.gap is None else self.gap


def farthest(probes: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Return how far the farthest probe is from zero at each instant (nt,), of histories (nt, n_probes).

    Displacements count, the columns `moving`; rotations only where there is no displacement.
    """
    counted = probes[:, moving] if moving.any() else probes
    return np.max(np.abs(counted), axis=1, initial=0.0)
