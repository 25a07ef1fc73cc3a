"""Results of a run: named histories with units, the mesh and its snapshots, facts."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from uplift.drivers.analysis.envelope_data import EnvelopeData
from uplift.drivers.analysis.snapshots import SnapshotData
from uplift.solvers.spectra import DAMPING, FREQUENCIES, ResponseSpectrum, response_spectrum


@dataclass(frozen=True)
class Series:
    """Histories of one unit, a column each."""

    names: tuple[str, ...]
    unit: str
    values: np.ndarray
    """(nt, n), nan where nothing is known."""
    about: str
    """What they are, with their sign."""


def floor_acceleration(series: dict[str, Series]) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the names and the absolute accelerations (nt, n) m/s2 of the probes' translations: relative ones plus the ground's."""
    relative, base = series["probes/acceleration"], series["probes/base"]
    return relative.names, relative.values + base.values


def floor_spectra(times: np.ndarray, series: dict[str, Series], damping: tuple[float, ...] = DAMPING) -> ResponseSpectrum | None:
    """Return the response spectra at the probes, None where no accelerations are known."""
    if "probes/acceleration" not in series or len(times) < 2:
        return None
    _, absolute = floor_acceleration(series)
    return response_spectrum(absolute, float(times[-1] - times[0]) / (len(times) - 1), FREQUENCIES, damping)


@dataclass(frozen=True)
class Results:
    """All that is kept of a run."""

    facts: dict[str, Any]
    """The summary: method, dofs, versions, seconds by phase, extremes, findings."""
    scene_text: str
    """The scene file."""
    times: np.ndarray
    """(nt,) s, archived."""
    series: dict[str, Series]
    """By path, such as "contacts/force"."""
    points: dict[str, np.ndarray] = field(default_factory=dict)
    """Positions (n, 3) m: "probes" (a row for each probe), "contacts", "springs", and "directions", in which the contacts push."""
    probe_names: tuple[str, ...] = ()
    plate: SnapshotData | None = None
    spectra: ResponseSpectrum | None = None
    spectra_names: tuple[str, ...] = ()
    envelopes: EnvelopeData | None = None
    """Written, and not read again: the page does not show them."""

    @property
    def step(self) -> float:
        """Time between archived instants in s."""
        return float(self.times[-1] - self.times[0]) / max(len(self.times) - 1, 1)

    @property
    def name(self) -> str:
        """Title, method and treatment of uplift in one line."""
        passes = self.facts.get("iterations")
        how = "uplift exact" if self.facts.get("uplift") == "exact" else f"{passes} published pass{'' if passes == 1 else 'es'}"
        return f"{self.facts.get('title') or 'Uplift'} ({self.facts.get('method')}, {how})"

    def with_spectra(self, damping: tuple[float, ...]) -> Results:
        """Return the same results with floor response spectra for other damping ratios."""
        spectra = floor_spectra(self.times, self.series, damping)
        names = self.series["probes/acceleration"].names if spectra is not None else ()
        return replace(self, spectra=spectra, spectra_names=names)
