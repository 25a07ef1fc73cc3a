"""What a run leaves: displacements of the probes and elongations of the contacts in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class History:
    """Histories at archived instants, the same on every rank."""

    times: np.ndarray
    """(nt,) s."""
    probes: np.ndarray
    """(nt, n_probes) m, in the order of the model's probe functionals."""
    elongation: np.ndarray
    """(nt, n_c) m, of the bonded contacts, positive when open."""
    peak: int = 0
    """Index of the instant at which a probe is farthest from zero."""
    peak_field: np.ndarray | None = None
    """(n_local,) m: this rank's part of the solution at `peak`, where it was kept."""
