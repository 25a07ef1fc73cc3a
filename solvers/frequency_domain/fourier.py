"""The Fourier convention of the project, in one place.

Forward, from N samples x_n at n dt:  X_k = sum_n x_n exp(-2 pi i k n / N), k = 0 ... N/2 (one-sided, unscaled), at k / (N dt).
Inverse:  x_n = (1 / N) (X_0 + 2 Re sum_{0<k<N/2} X_k exp(2 pi i k n / N) + (-1)^n X_{N/2});
the mean (k = 0) and the Nyquist term are not doubled.
A response therefore varies as exp(+i omega t) and its dynamic stiffness is K + i omega C - omega^2 M.
"""

from __future__ import annotations

import numpy as np
import scipy.fft


def forward(samples: np.ndarray) -> np.ndarray:
    """Return the spectrum (N/2 + 1, ...) of real samples (N, ...) along the first axis."""
    return scipy.fft.rfft(samples, axis=0)


def inverse(spectrum: np.ndarray, samples: int) -> np.ndarray:
    """Return real samples (samples, ...) of a spectrum (n, ...), zero beyond its last frequency."""
    return scipy.fft.irfft(spectrum, n=samples, axis=0)


def inverse_by_sum(spectrum: np.ndarray, samples: int) -> np.ndarray:
    """Return the same as `inverse` by the sum of its definition, without any FFT: the check of the transform."""
    k = np.arange(len(spectrum))
    weight = np.where((k == 0) | (2 * k == samples), 1.0, 2.0) / samples
    # k n is reduced modulo N in integers first, so that no digit of the phase is lost.
    phase = (2 * np.pi / samples) * (np.outer(np.arange(samples), k) % samples)
    flat = (weight[:, None] * spectrum.reshape(len(spectrum), -1)).astype(complex)
    values = np.cos(phase) @ flat.real - np.sin(phase) @ flat.imag
    return values.reshape(samples, *spectrum.shape[1:])
