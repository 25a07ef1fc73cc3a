"""The band-limited periodic response of a window, from a sweep at its frequencies."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from forms.operators import Operators
from solvers import fourier
from solvers.history import History
from solvers.newmark import load_values
from solvers.parameters import Window
from solvers.sweep import Transfer, sweep


def harmonic_sweep(
    operators: Operators,
    omega: np.ndarray,
    solve: Callable[..., Transfer] = sweep,
    **how: Any,
) -> Transfer:
    """Solve (K + i omega C - omega^2 M) X = [loads, unit release forces] at each omega (n_f,) in rad/s (collective).

    `solve` makes the sweep, called as `solvers.sweep.sweep` is: the direct one, or one in a basis; `how` holds further arguments of it,
    such as `groups` and `watch`.
    """
    return solve(operators, 1j * omega, -(omega**2) + 0j, prefix="harmonic_", what="frequency sweep", **how)


class FourierResponse:
    """The response of a window to the loads and to given release forces; every contact is bonded but for these."""

    def __init__(self, operators: Operators, window: Window, transfer: Transfer) -> None:
        """Transform the loads; `transfer` holds the window's frequencies."""
        self.operators = operators
        self.window = window
        self.transfer = transfer
        self._loads = fourier.forward(load_values(operators, window.times))[: len(window.frequencies)]

    def spectrum(self, release: np.ndarray | None) -> np.ndarray:
        """Return the spectra (n_f, n_columns) of the loads and of release forces (samples, n_channels) N (None: zero)."""
        n_f, n_channels = len(self._loads), self.transfer.elongation.shape[1]
        forces = np.zeros((n_f, n_channels)) if release is None else fourier.forward(release)[:n_f]
        return np.concatenate([self._loads, forces], axis=1)

    def probe_spectrum(self, release: np.ndarray | None) -> np.ndarray:
        """Return the spectra of the probes (n_f, n_probes)."""
        return np.einsum("fpj,fj->fp", self.transfer.probes, self.spectrum(release))

    def history(self, release: np.ndarray | None) -> History:
        """Return the response at the samples of the window."""
        drive, transfer = self.spectrum(release), self.transfer
        probes, elongation, resultants = (
            fourier.inverse(np.einsum("foj,fj->fo", part, drive), self.window.samples)
            for part in (transfer.probes, transfer.elongation, transfer.resultants)
        )
        acted = np.zeros_like(elongation) if release is None else release
        reactions = self.operators.reactions
        forces = reactions.values(resultants, acted) if reactions is not None else resultants
        peak = int(np.argmax(np.max(np.abs(probes), axis=1))) if probes.size else 0
        omega = 2 * np.pi * self.window.frequencies
        felt = fourier.inverse(-(omega[:, None] ** 2) * np.einsum("fpj,fj->fp", transfer.probes, drive), self.window.samples)
        return History(self.window.times, probes, elongation, acted, forces, peak, self._field(drive, peak), accelerations=felt)

    def field(self, release: np.ndarray | None, sample: int) -> np.ndarray | None:
        """Return this rank's part (n_local,) m of the displacements at a sample, None where fields were not kept."""
        return self._field(self.spectrum(release), sample)

    def amplitudes(self, release: np.ndarray | None, frequency: int) -> np.ndarray | None:
        """Return this rank's part (n_local,) m of the one-sided complex amplitudes at a frequency's index, None where fields were not kept.

        The response holds Re(amplitude exp(i omega t)).
        """
        if self.transfer.fields is None:
            return None
        n, drive = self.window.samples, self.spectrum(release)[frequency]
        return (1.0 if frequency == 0 or 2 * frequency == n else 2.0) / n * (drive @ self.transfer.fields[frequency])

    def _field(self, drive: np.ndarray, sample: int) -> np.ndarray | None:
        n, k = self.window.samples, np.arange(len(drive))
        weight = np.where((k == 0) | (2 * k == n), 1.0, 2.0) / n * np.exp(2j * np.pi * (k * sample % n) / n)
        return self.transfer.field(weight[:, None] * drive)
