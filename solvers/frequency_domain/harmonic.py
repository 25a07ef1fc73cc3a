"""The band-limited periodic response of a window, from a sweep at its frequencies."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from uplift.forms.operators import Operators
from uplift.solvers.frequency_domain import fourier
from uplift.solvers.frequency_domain.sweep import sweep
from uplift.solvers.frequency_domain.transfer import Transfer
from uplift.solvers.frequency_domain.window import Window
from uplift.solvers.history import History, farthest
from uplift.solvers.time_domain.state import load_values


def harmonic_sweep(operators: Operators, omega: np.ndarray, **how: Any) -> Transfer:
    """Solve (K + i omega C - omega^2 M) X = [loads, unit release forces] at each omega (n_f,) in rad/s (collective).

    `how` holds further arguments of the sweep, such as `groups` and `watch`.
    """
    return sweep(operators, 1j * omega, -(omega**2) + 0j, prefix="harmonic_", what="frequency sweep", **how)


FINER = 8
"""Loads are sampled so many times finer than the window to see what lies above its Nyquist frequency."""

LAST = 0.05
"""The last part of the window, where a response that has died out is at rest."""


def shares_beyond(operators: Operators, window: Window) -> tuple[float, float]:
    """Return the shares of the energy of the loads above the cutoff, and above the Nyquist frequency of the samples.

    The first part of a load is lost to the response, the second comes back at wrong frequencies (aliasing). The energy is the
    integral of the square of a load's history over the window; the worst of the loads that are not static counts.
    """
    n = FINER * window.samples
    times = window.length / n * np.arange(n)
    worst = np.zeros(2)
    for load in operators.loads:
        if load.static:
            continue
        energy = np.abs(fourier.forward(load.history(times))) ** 2
        energy[0] *= 0.5
        whole = float(energy.sum())
        if whole > 0:
            ends = len(window.frequencies), window.samples // 2 + 1
            worst = np.maximum(worst, [float(energy[end:].sum()) / whole for end in ends])
    return float(worst[0]), float(worst[1])


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
        n_f, n_channels = len(self._loads), self.operators.contacts.law.n_channels
        forces = np.zeros((n_f, n_channels)) if release is None else fourier.forward(release)[:n_f]
        return np.concatenate([self._loads, forces], axis=1)

    def probe_spectrum(self, release: np.ndarray | None) -> np.ndarray:
        """Return the spectra of the probes (n_f, n_probes)."""
        return np.einsum("fpj,fj->fp", self.transfer.probes, self.spectrum(release))

    def history(self, release: np.ndarray | None) -> History:
        """Return the response at the samples of the window."""
        drive, samples, layout = self.spectrum(release), self.window.samples, self.operators.outputs
        spectra = np.einsum("foj,fj->fo", self.transfer.outputs, drive)
        acted = np.zeros((samples, drive.shape[1] - self._loads.shape[1])) if release is None else release
        omega = 2 * np.pi * self.window.frequencies
        second = fourier.inverse(-(omega[:, None] ** 2) * spectra[:, layout.accelerated], samples)
        outputs = layout.values(fourier.inverse(spectra, samples), acted, fourier.inverse(self._loads, samples), second)
        peak = int(np.argmax(farthest(outputs[:, layout.layout["probes"]], self.operators.probes.moving)))
        accelerations = second[:, : len(self.operators.probes.names)]
        return History(
            self.window.times, outputs, layout, acted, peak, self.field(release)(peak), accelerations=accelerations
        )

    def left_over(self, history: History) -> float:
        """Return how far the probes are from rest in the last part of the window, relative to their farthest.

        What has not died out there goes on at the beginning, because the response is periodic (wrap-around).
        """
        loads = self.operators.loads
        static = np.array([float(load.history(np.zeros(1))[0]) if load.static else 0.0 for load in loads])
        away = np.abs(history.probes - np.real(self.transfer.probes[0, :, : len(loads)] @ static))
        farthest = float(np.max(away, initial=0.0))
        last = away[int((1 - LAST) * len(away)) :]
        moves = farthest > 1e-12 * float(np.max(np.abs(history.probes), initial=0.0))  # less is round-off of a state of rest
        return float(np.max(last, initial=0.0)) / farthest if moves else 0.0

    def field(self, release: np.ndarray | None) -> Callable[[int], np.ndarray | None]:
        """Return what gives this rank's part (n_local,) m of the displacements at a sample, None where fields were not kept."""
        response, n, k = self.transfer.response(self.spectrum(release)), self.window.samples, np.arange(len(self._loads))
        weight = np.where((k == 0) | (2 * k == n), 1.0, 2.0) / n

        def at(sample: int) -> np.ndarray | None:
            return None if response is None else self.operators.reconstruct(response.at(weight * np.exp(2j * np.pi * (k * sample % n) / n)))

        return at

    def amplitudes(self, release: np.ndarray | None, frequency: int) -> np.ndarray | None:
        """Return this rank's part (n_local,) m of the one-sided complex amplitudes at a frequency's index, None where fields were not kept.

        The response holds Re(amplitude exp(i omega t)).
        """
        if self.transfer.fields is None:
            return None
        n, drive = self.window.samples, self.spectrum(release)[frequency]
        weight = (1.0 if frequency == 0 or 2 * frequency == n else 2.0) / n
        return weight * self.operators.reconstruct(drive @ self.transfer.fields[frequency])
