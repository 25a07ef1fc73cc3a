"""Numbers and findings of a run in words."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uplift.drivers.results.results import Results, Series, floor_acceleration

PREFIXED = {
    "m": (("m", 1.0), ("mm", 1e-3), ("µm", 1e-6), ("nm", 1e-9)),
    "rad": (("rad", 1.0), ("mrad", 1e-3), ("µrad", 1e-6)),
    "N": (("GN", 1e9), ("MN", 1e6), ("kN", 1e3), ("N", 1.0)),
    "N m": (("GN m", 1e9), ("MN m", 1e6), ("kN m", 1e3), ("N m", 1.0)),
    "N/m": (("GN/m", 1e9), ("MN/m", 1e6), ("kN/m", 1e3), ("N/m", 1.0)),
    "J": (("GJ", 1e9), ("MJ", 1e6), ("kJ", 1e3), ("J", 1.0), ("mJ", 1e-3)),
}

PLAIN = {"m/s2": "m/s²"}


@dataclass(frozen=True)
class Scale:
    """A unit in which the numbers at hand read well."""

    label: str
    size: float
    """What one of it is in the SI unit."""


def scale_for(unit: str, largest: float) -> Scale:
    """Return the unit whose numbers are 1 to 1000 where the largest value is `largest` (in the SI unit)."""
    options = PREFIXED.get(unit, ((PLAIN.get(unit, unit), 1.0),))
    for label, size in options:
        if abs(largest) >= 0.9995 * size:
            return Scale(label, size)
    return Scale(*options[-1]) if largest else Scale(*next(o for o in options if o[1] == 1.0))


def written(value: float, unit: str, digits: int = 4) -> str:
    """Return a value with its unit, such as "-64.05 mm"."""
    scale = scale_for(unit, value)
    return f"{number(value / scale.size, digits)} {scale.label}"


def number(value: float, digits: int = 4) -> str:
    """Return a number with so many significant digits, a true minus sign and no exponent where it can do without."""
    if not math.isfinite(value):
        return "unknown"
    if value == 0:
        return "0"
    value = float(f"{value:.{digits - 1}e}")
    if 1e-4 <= abs(value) < 1e6:
        decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
        text = f"{value:.{decimals}f}"
        text = text.rstrip("0").rstrip(".") if decimals > digits + 1 else text
    else:
        text = f"{value:.{digits - 1}e}"
    return text.replace("-", "\N{MINUS SIGN}", 1) if text.startswith("-") else text


@dataclass(frozen=True)
class Extremes:
    """The smallest and the largest value of a history and their instants in s."""

    low: float
    t_low: float
    high: float
    t_high: float

    @property
    def farthest(self) -> tuple[float, float]:
        """Value farthest from zero and its instant."""
        return (self.low, self.t_low) if -self.low > self.high else (self.high, self.t_high)


def extremes(times: np.ndarray, values: np.ndarray) -> Extremes | None:
    """Return the extremes of a history (nt,), None where nothing of it is known."""
    known = np.flatnonzero(np.isfinite(values))
    if not known.size:
        return None
    low, high = known[np.argmin(values[known])], known[np.argmax(values[known])]
    return Extremes(float(values[low]), float(times[low]), float(values[high]), float(times[high]))


@dataclass(frozen=True)
class KeyValue:
    """One of the results that are shown first."""

    what: str
    value: str
    where: str


def key_values(results: Results) -> list[KeyValue]:
    """Return the results that are shown first."""
    shown: list[KeyValue] = []
    times = results.times

    def farthest(what: str, series: Series, *, positive: bool = False, rounding: float = 0.0) -> None:
        values = np.where(np.isfinite(series.values), series.values, 0.0)
        row, column = np.unravel_index(np.argmax(values if positive else np.abs(values)), values.shape)
        value = float(values[row, column])
        if abs(value) < rounding:
            value = 0.0
        name = f"{series.names[column]}, " if len(series.names) > 1 else ""
        shown.append(KeyValue(what, written(value, series.unit, 3 if series.unit == "%" else 4), f"{name}t = {times[row]:.6g} s"))

    displacement = results.series.get("probes/displacement")
    if displacement is not None:
        for i, name in enumerate(displacement.names[:6]):
            one = Series((name,), displacement.unit, displacement.values[:, [i]], "")
            farthest(f"Largest displacement {name}", one)
    if "probes/acceleration" in results.series:
        names, absolute = floor_acceleration(results.series)
        farthest("Largest absolute acceleration", Series(names, "m/s2", absolute, ""))
    for what, path in (
        ("Largest lifted area", "uplift/area"), ("Most contacts open", "uplift/contacts"), ("Largest contact force", "contacts/force"),
        ("Widest gap", "contacts/gap"),
    ):
        if path in results.series:
            farthest(what, results.series[path], positive=True)
    forces = results.series.get("reactions/force")
    # Of forces that balance round-off is left, where the scene moves nothing along an axis.
    rounding = 1e-12 * float(np.max(np.abs(forces.values), initial=0.0)) if forces is not None else 0.0
    for path in ("reactions/force", "reactions/moment"):
        if path in results.series:
            part = results.series[path]
            for i, name in enumerate(part.names):
                if "vertical" not in name:
                    one = Series((name,), part.unit, part.values[:, [i]], "")
                    farthest(f"Largest {name}", one, rounding=rounding)
    return shown


def findings(results: Results) -> list[tuple[str, str]]:
    """Return severity and text, as a sentence, of what a reader of the results must know."""
    return [(str(found["severity"]), _sentence(str(found["text"]))) for found in results.facts.get("findings", [])]


def _sentence(text: str) -> str:
    text = text.strip()
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")
