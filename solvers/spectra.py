"""Response spectra of recorded accelerations: the peaks of oscillators that stand where an acceleration was recorded.

An oscillator of frequency omega and damping ratio zeta on a floor that accelerates with a(t) moves relative to it by
u'' + 2 zeta omega u' + omega^2 u = -a(t). With lambda = -zeta omega + i omega_d, omega_d = omega sqrt(1 - zeta^2), the complex
w = u' - conj(lambda) u obeys w' = lambda w - a(t), and u = Im(w) / omega_d, u' = Re(w) - zeta omega u. For an acceleration that is linear
between its samples the step of w is exact,

    w1 = exp(lambda h) w0 - (c0 a0 + c1 a1),   c0 + c1 = (exp(lambda h) - 1) / lambda,   c1 = (exp(lambda h) - 1 - lambda h) / (lambda^2 h),

which is the method of Nigam and Jennings, Bull. Seism. Soc. Am. 59 (1969) 909, written as one recurrence. It is stable for any
step. Peaks are sought between the samples too, at 40 instants a period: they are low by 0.3 % at most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

DAMPING = (0.02, 0.05, 0.10)
"""Damping ratios where none are asked for."""

FREQUENCIES = np.geomspace(0.1, 50.0, 136)
"""Hz: 50 a decade."""

INSTANTS = 40
"""Instants a period at which a peak is sought."""


@dataclass(frozen=True)
class ResponseSpectrum:
    """Peaks over the record, from rest at its beginning; what an oscillator does after the record's end is not counted."""

    frequencies: np.ndarray
    """(n_f,) Hz."""
    damping: np.ndarray
    """(n_d,) ratios."""
    acceleration: np.ndarray
    """(n_d, n_f, n_columns) m/s2: largest absolute acceleration |u'' + a|."""
    displacement: np.ndarray
    """(n_d, n_f, n_columns) m: largest displacement |u| relative to the floor."""
    floor: np.ndarray
    """(n_columns,) m/s2: largest |a|, the limit for rigid oscillators."""


def response_spectrum(
    acceleration: np.ndarray,
    step: float,
    frequencies: np.ndarray = FREQUENCIES,
    damping: tuple[float, ...] = DAMPING,
) -> ResponseSpectrum:
    """Return the spectra of accelerations (nt, n_columns) m/s2, sampled every `step` s and linear between.

    Raises `ValueError` for a frequency that is not above 0 or a damping ratio outside [0, 1).
    """
    a = np.asarray(acceleration, dtype=float)
    ratios, f = np.asarray(damping, dtype=float), np.asarray(frequencies, dtype=float)
    if a.ndim != 2 or len(a) < 2 or not np.all(np.isfinite(a)):
        raise ValueError("expected finite accelerations of at least two instants, (nt, n_columns)")
    if not (step > 0 and np.all(f > 0) and np.all((ratios >= 0) & (ratios < 1))):
        raise ValueError("expected a step and frequencies above 0 and damping ratios in [0, 1)")
    peaks = np.zeros((2, len(ratios), len(f), a.shape[1]))
    for i, zeta in enumerate(ratios):
        for j, omega in enumerate(2 * np.pi * f):
            peaks[:, i, j] = _peaks(a, step, omega, zeta)
    return ResponseSpectrum(f, ratios, peaks[0], peaks[1], np.max(np.abs(a), axis=0))


def _peaks(a: np.ndarray, step: float, omega: float, zeta: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest absolute acceleration and relative displacement (n_columns,) of one oscillator."""
    damped = omega * np.sqrt(1 - zeta**2)
    rate = complex(-zeta * omega, damped)
    grown, first, last = _weights(rate, step, 1.0)
    w = np.zeros(a.shape, dtype=complex)
    w[1:] = lfilter([1.0], [1.0, -grown], -(first * a[:-1] + last * a[1:]), axis=0)
    parts = int(np.ceil(INSTANTS * omega * step / (2 * np.pi)))
    force = displacement = np.zeros(a.shape[1])
    for k in range(1, parts + 1):
        there = w[1:]
        if k < parts:
            grown, first, last = _weights(rate, step, k / parts)
            there = grown * w[:-1] - (first * a[:-1] + last * a[1:])
        u = there.imag / damped
        speed = there.real - zeta * omega * u
        force = np.maximum(force, np.max(np.abs(2 * zeta * omega * speed + omega**2 * u), axis=0))
        displacement = np.maximum(displacement, np.max(np.abs(u), axis=0))
    return force, displacement


def _weights(rate: complex, step: float, share: float) -> tuple[complex, complex, complex]:
    """Return exp(lambda h) and what the accelerations at the beginning and the end of the step add, after h = share * step."""
    h = share * step
    x = rate * h
    whole = complex(np.expm1(x)) / rate
    if abs(x) < 0.1:
        # The Taylor series, where (exp(x) - 1 - x) / x^2 would lose its digits.
        term, ramp = 0.5 + 0j, 0j
        for n in range(3, 14):
            ramp += term
            term *= x / n
        ramp *= h
    else:
        ramp = (whole - h) / x
    # The acceleration at the end of the part is a0 + share (a1 - a0).
    return np.exp(x), whole - share * ramp, share * ramp


def second_differences(displacement: np.ndarray, step: float) -> np.ndarray:
    """Return accelerations (nt, n) from displacements (nt, n) at every step of a time integration, the ends as beside them.

    For the average-acceleration scheme they are its accelerations weighed 1/4, 1/2, 1/4 over three instants: a component of
    frequency f appears reduced by cos^2(pi f step), at a tenth of the sampling rate by a tenth, and the scheme's own ringing from
    step to step not at all.
    """
    second = np.zeros_like(displacement)
    if len(second) > 2:
        second[1:-1] = (displacement[2:] - 2 * displacement[1:-1] + displacement[:-2]) / step**2
        second[0], second[-1] = second[1], second[-2]
    return second
