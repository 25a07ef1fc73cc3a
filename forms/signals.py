"""Ground acceleration in time, m/s2: functions of arrays of times in s."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import ROUND_CEILING, Context
from pathlib import Path
from typing import Protocol

import numpy as np

from meshes.checked import Checked, ModelError, quantity


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

    amplitude: float = quantity("A, the depth of the trough at `center`", "m/s2")
    frequency: float = quantity("f, the frequency of the largest spectral amplitude", "Hz", above=0.0)
    center: float = quantity("t0, the time of the trough", "s")
    start: float = quantity("time before which the signal is zero", "s", default=0.0)

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the values (nt,) at `times` (nt,)."""
        x = (math.pi * self.frequency * (times - self.center)) ** 2
        return np.where(times < self.start, 0.0, self.amplitude * (2 * x - 1) * np.exp(-x))


@dataclass(frozen=True, kw_only=True)
class Sine(Checked):
    """Sine a(t) = A sin(2 pi f (t - t0) + phase) from `start` = t0 to `end`, zero outside."""

    amplitude: float = quantity("A", "m/s2 or 1", default=1.0)
    frequency: float = quantity("f", "Hz", above=0.0)
    phase: float = quantity("phase at the start", "rad", default=0.0)
    start: float = quantity("t0", "s", default=0.0)
    end: float = quantity("time after which the signal is zero", "s", default=1e300)

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the values (nt,) at `times` (nt,)."""
        wave = self.amplitude * np.sin(2 * math.pi * self.frequency * (times - self.start) + self.phase)
        return np.where((times < self.start) | (times > self.end), 0.0, wave)


@dataclass(frozen=True, kw_only=True)
class Step(Checked):
    """A value that is reached from zero at `start`, at once or linearly within `rise`, and kept."""

    amplitude: float = quantity("the value", "m/s2 or 1", default=1.0)
    start: float = quantity("when it begins", "s", default=0.0)
    rise: float = quantity("how long it takes", "s", default=0.0, at_least=0.0)

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the values (nt,) at `times` (nt,)."""
        if self.rise == 0:
            return np.where(times < self.start, 0.0, self.amplitude)
        ramp: np.ndarray = self.amplitude * np.clip((times - self.start) / self.rise, 0.0, 1.0)
        return ramp


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

    def __post_init__(self) -> None:
        """Check that the table is one of finite numbers at increasing times."""
        if self.times.ndim != 1 or self.times.shape != self.values.shape or self.times.size < 2:
            raise ModelError("", "expected at least two pairs of time and value")
        bad = ~(np.isfinite(self.times) & np.isfinite(self.values))
        if bad.any():
            raise ModelError("", f"expected finite numbers, found none in row {int(np.argmax(bad)) + 1}")
        late = np.diff(self.times) <= 0
        if late.any():
            raise ModelError("", f"expected increasing times, t does not increase in row {int(np.argmax(late)) + 2}")

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the values (nt,) at `times` (nt,)."""
        return np.interp(times, self.times, self.values, left=0.0, right=0.0)


def tabulate(signal: Signal, step: float, end: float, digits: int) -> Table:
    """Sample `signal` every `step` s from 0 past `end`, rounded up to `digits` significant digits.

    Up is a choice: the rounding of SDLS119's table is not known, and this is one of the rules with which all its published
    results come out to their last digit.
    """
    times = step * np.arange(math.ceil(end / step) + 2)
    context = Context(prec=digits, rounding=ROUND_CEILING)
    return Table(times, np.array([float(context.create_decimal(repr(float(value)))) for value in signal(times)]))


def read_accelerogram(path: Path, scale: float = 1.0) -> Table:
    """Read times in s and accelerations, times `scale` in m/s2, from a CSV file of two columns.

    The separator may be comma, semicolon or tab, the decimal sign is a point; one line of headings and lines beginning with #
    are passed over. Raises `ModelError` naming the file and the line.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError("", f"cannot read {path}: {getattr(error, 'strerror', None) or 'not a text file'}") from error
    rows: list[tuple[float, float]] = []
    headings_allowed = True
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        separator = next((mark for mark in ";\t" if mark in line), ",")
        try:
            time, value = (float(cell) for cell in line.rstrip(separator + "\r ").split(separator))
        except ValueError:
            if headings_allowed:
                headings_allowed = False
                continue
            expected = "expected a time and an acceleration"
            raise ModelError("", f"{path}, line {number}: {expected}, got {line!r:.60}") from None
        headings_allowed = False
        if not (math.isfinite(time) and math.isfinite(value)):
            raise ModelError("", f"{path}, line {number}: expected finite numbers, got {line!r:.60}")
        if rows and time <= rows[-1][0]:
            raise ModelError("", f"{path}, line {number}: expected increasing times, got {time:g} after {rows[-1][0]:g}")
        rows.append((time, value))
    if len(rows) < 2:
        raise ModelError("", f"{path}: expected at least two lines of time and acceleration")
    table = np.array(rows)
    return Table(table[:, 0], scale * table[:, 1])
