"""Ground acceleration in time, m/s2: functions of arrays of times in s."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from uplift.meshes.checked import Checked, ModelError, quantity
from uplift.meshes.findings import Finding

LARGEST = 1e12
"""No value of a signal and no frequency is larger, so that no square of one overflows; nor is a time in s, where it counts."""


class Signal(Protocol):
    """Anything that gives values (nt,) at times (nt,) s."""

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the values at `times`."""
        ...


@dataclass(frozen=True)
class Ricker(Checked):
    """Ricker wavelet a(t) = A (2 x - 1) exp(-x), x = (pi f (t - t0))^2, zero before `start`.

    Its trough at t0 is -A; the two side lobes reach 2 A exp(-3/2). Source: code_aster manual, case SDLS119.
    """

    amplitude: float = quantity("A, the depth of the trough at `center`", "m/s2", at_least=-LARGEST, at_most=LARGEST)
    frequency: float = quantity("f, the frequency of the largest spectral amplitude", "Hz", above=0.0, at_most=LARGEST)
    center: float = quantity("t0, the time of the trough", "s", at_least=-LARGEST, at_most=LARGEST)
    start: float = quantity("time before which the signal is zero", "s", default=0.0, at_least=-LARGEST, at_most=LARGEST)

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the values (nt,) at `times` (nt,)."""
        x = (math.pi * self.frequency * (times - self.center)) ** 2
        return np.where(times < self.start, 0.0, self.amplitude * (2 * x - 1) * np.exp(-x))


@dataclass(frozen=True, kw_only=True)
class Sine(Checked):
    """Sine a(t) = A sin(2 pi f (t - t0) + phase) from `start` = t0 to `end`, zero outside."""

    amplitude: float = quantity("A", "m/s2 or 1", default=1.0, at_least=-LARGEST, at_most=LARGEST)
    frequency: float = quantity("f", "Hz", above=0.0, at_most=LARGEST)
    phase: float = quantity("phase at the start", "rad", default=0.0, at_least=-LARGEST, at_most=LARGEST)
    start: float = quantity("t0", "s", default=0.0, at_least=-LARGEST, at_most=LARGEST)
    end: float = quantity("time after which the signal is zero", "s", default=1e300)

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the values (nt,) at `times` (nt,)."""
        wave = self.amplitude * np.sin(2 * math.pi * self.frequency * (times - self.start) + self.phase)
        return np.where((times < self.start) | (times > self.end), 0.0, wave)


@dataclass(frozen=True, kw_only=True)
class Step(Checked):
    """A value that is reached from zero at `start`, at once or linearly within `rise`, and kept."""

    amplitude: float = quantity("the value", "m/s2 or 1", default=1.0, at_least=-LARGEST, at_most=LARGEST)
    start: float = quantity("when it begins", "s", default=0.0, at_least=-LARGEST, at_most=LARGEST)
    rise: float = quantity("how long it takes", "s", default=0.0, at_least=0.0, at_most=LARGEST)

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the values (nt,) at `times` (nt,)."""
        if self.rise == 0:
            return np.where(times < self.start, 0.0, self.amplitude)
        ramp: np.ndarray = self.amplitude * np.clip((times - self.start) / self.rise, 0.0, 1.0)
        return ramp


@dataclass(frozen=True, kw_only=True)
class Sweep(Checked):
    """Sine whose frequency goes from `first` to `last` between `start` = t0 and `end` = t0 + T, zero outside.

    a(t) = A w(t) sin(phi(s)), s = t - t0, with phi = 2 pi (f1 s + (f2 - f1) s^2 / (2 T)) for a linear and
    phi = 2 pi f1 T ((f2 / f1)^(s / T) - 1) / ln(f2 / f1) for a logarithmic one; w rises and falls by half a cosine over `taper`.
    """

    amplitude: float = quantity("A", "m/s2 or 1", default=1.0, at_least=-LARGEST, at_most=LARGEST)
    first: float = quantity("f1, the frequency at the start", "Hz", above=0.0, at_most=LARGEST)
    last: float = quantity("f2, the frequency at the end", "Hz", above=0.0, at_most=LARGEST)
    start: float = quantity("t0", "s", default=0.0, at_least=-LARGEST, at_most=LARGEST)
    end: float = quantity("time after which the signal is zero", "s", at_least=-LARGEST, at_most=LARGEST)
    spacing: str = quantity("how the frequency goes", default="linear", one_of=("linear", "logarithmic"))
    taper: float = quantity("how long it rises at the start and falls at the end", "s", default=0.0, at_least=0.0, at_most=LARGEST)

    def check(self) -> None:
        """Refuse an end before the start and tapers that do not fit in."""
        _check_length(self.start, self.end, self.taper, self.taper)

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the values (nt,) at `times` (nt,)."""
        whole = self.end - self.start
        s = np.clip(times - self.start, 0.0, whole)
        ratio = math.log(self.last / self.first)
        if self.spacing == "logarithmic" and ratio != 0:
            cycles = self.first * whole * np.expm1(ratio * s / whole) / ratio
        else:
            cycles = self.first * s + (self.last - self.first) * s**2 / (2 * whole)
        wave: np.ndarray = self.amplitude * tapered(times, self.start, self.end, self.taper, self.taper) * np.sin(2 * math.pi * cycles)
        return wave


@dataclass(frozen=True, kw_only=True)
class Noise(Checked):
    """Noise of a flat spectrum between two frequencies, from a seed, under an envelope that rises and falls by half a cosine.

    a(t) = rms w(t) sqrt(2 / n) sum_k cos(2 pi k s / T + phi_k), s = t - `start`, T = `end` - `start`, over the n frequencies k / T from
    `low` to `high`. The phases are phi_k = 2 pi (r_k >> 11) / 2^53 with r_k the k-th 64-bit number of numpy's generator PCG64(seed),
    whose stream does not change between releases, so that a seed means the same noise everywhere. Without its envelope w the
    root of the mean square over T is `rms`; peaks are some three times as high.
    """

    seed: int = quantity("what the phases follow from", at_least=0, at_most=2**63 - 1)
    rms: float = quantity("root of the mean square, envelope apart", "m/s2 or 1", default=1.0, at_least=-LARGEST, at_most=LARGEST)
    low: float = quantity("lower end of the band", "Hz", default=0.1, above=0.0, at_most=LARGEST)
    high: float = quantity("upper end of the band", "Hz", above=0.0, at_most=LARGEST)
    start: float = quantity("time before which the signal is zero", "s", default=0.0, at_least=-LARGEST, at_most=LARGEST)
    end: float = quantity("time after which the signal is zero", "s", at_least=-LARGEST, at_most=LARGEST)
    rise: float = quantity("how long the envelope rises", "s", default=0.0, at_least=0.0, at_most=LARGEST)
    decay: float = quantity("how long the envelope falls before the end", "s", default=0.0, at_least=0.0, at_most=LARGEST)

    def check(self) -> None:
        """Refuse an envelope that does not fit in and a band without frequencies or with more than can be summed."""
        _check_length(self.start, self.end, self.rise, self.decay)
        if not self.low <= self.high:
            raise ModelError("high", f"expected >= low = {self.low:g} Hz, got {self.high:g} Hz")
        if self.high * (self.end - self.start) > 20_000:
            raise ModelError("high", f"expected at most 20000 / (end - start), got {self.high:g} Hz")
        if not len(self.frequencies):
            words = f"holds no multiple of 1 / (end - start) = {1 / (self.end - self.start):g} Hz"
            raise ModelError("high", f"the band from {self.low:g} to {self.high:g} Hz {words}")

    @property
    def frequencies(self) -> np.ndarray:
        """(n,) Hz."""
        whole = self.end - self.start
        first, last = math.ceil(self.low * whole * (1 - 1e-12)), math.floor(self.high * whole * (1 + 1e-12))
        return np.arange(max(first, 1), last + 1) / whole

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the values (nt,) at `times` (nt,)."""
        f = self.frequencies
        phases = 2 * math.pi * (np.random.PCG64(self.seed).random_raw(len(f)) >> np.uint64(11)) / 2.0**53
        envelope = tapered(times, self.start, self.end, self.rise, self.decay)
        values, inside = np.zeros(np.shape(times)), np.flatnonzero(envelope)
        for part in np.array_split(inside, 1 + len(inside) * len(f) // 1_000_000):  # some MB at a time
            values[part] = np.cos(2 * math.pi * np.outer(times[part] - self.start, f) + phases).sum(axis=1)
        return self.rms * math.sqrt(2 / len(f)) * envelope * values


def tapered(times: np.ndarray, start: float, end: float, rise: float, decay: float) -> np.ndarray:
    """Return the envelope (nt,): 0 outside `start` to `end`, 1 between, half a cosine over `rise` and `decay` s."""
    up = np.clip((times - start) / rise, 0.0, 1.0) if rise else np.ones(np.shape(times))
    down = np.clip((end - times) / decay, 0.0, 1.0) if decay else np.ones(np.shape(times))
    envelope = 0.25 * (1 - np.cos(math.pi * up)) * (1 - np.cos(math.pi * down))
    return np.where((times < start) | (times > end), 0.0, envelope)


def _check_length(start: float, end: float, rise: float, decay: float) -> None:
    if not end > start:
        raise ModelError("end", f"expected > start = {start:g} s, got {end:g} s")
    if rise + decay > (end - start) * (1 + 1e-12):
        raise ModelError("end", f"expected room for a rise of {rise:g} s and a fall of {decay:g} s after {start:g} s, got {end:g} s")


@dataclass(frozen=True)
class Constant(Checked):
    """The same value at all times, as gravity has."""

    value: float = quantity("value at all times")

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the values (nt,) at `times` (nt,)."""
        return np.full(np.shape(times), self.value)


@dataclass(frozen=True)
class Table:
    """Values at increasing times, linear between them and zero outside."""

    times: np.ndarray
    values: np.ndarray
    remarks: tuple[Finding, ...] = ()
    """What a user has to know of how it was read."""

    def __post_init__(self) -> None:
        """Check that the table is one of finite numbers at increasing times."""
        if self.times.ndim != 1 or self.times.shape != self.values.shape or self.times.size < 2:
            raise ModelError("", "expected at least two pairs of time and value")
        bad = ~((np.abs(self.times) <= LARGEST) & (np.abs(self.values) <= LARGEST))
        if bad.any():
            raise ModelError("", f"expected finite numbers of at most {LARGEST:g}, found none in row {int(np.argmax(bad)) + 1}")
        late = np.diff(self.times) <= 0
        if late.any():
            raise ModelError("", f"expected increasing times, t does not increase in row {int(np.argmax(late)) + 2}")

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the values (nt,) at `times` (nt,)."""
        return np.interp(times, self.times, self.values, left=0.0, right=0.0)


def tabulate(signal: Signal, step: float, end: float, digits: int) -> Table:
    """Sample `signal` every `step` s from 0 past `end`, rounded to nearest at `digits` significant digits."""
    times = step * np.arange(math.ceil(end / step) + 2)
    return Table(times, np.array([float(f"{value:.{digits - 1}e}") for value in signal(times)]))
