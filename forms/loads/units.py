"""Units in the headings of a record."""

from __future__ import annotations

import re
from collections.abc import Iterable

STANDARD_GRAVITY = 9.80665

_LENGTHS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "ft": 0.3048, "in": 0.0254}

ACCELERATIONS = {f"{name}/s2": size for name, size in _LENGTHS.items()} | {
    "gal": 0.01, "mgal": 1e-5, "g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY, "%g": 0.01 * STANDARD_GRAVITY,
}
"""Units of acceleration in m/s2, as `plain` writes them."""

TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0}
"""Units of time in s."""

OTHERS = (
    *_LENGTHS, *(f"{name}/s" for name in _LENGTHS), "kine", "count", "counts", "v", "mv", "uv", "n", "kn", "mn", "knm", "pa", "kpa",
    "mpa", "%", "deg", "rad", "rad/s", "rad/s2", "kg", "t",
)
"""Units of other things than accelerations, by which they are known."""

_WORDS = {
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sek": "s", "sekunden": "s", "secondes": "s", "msec": "ms",
    "milliseconds": "ms", "minutes": "min", "hours": "h", "g's": "g", "gs": "g", "gals": "gal", "grav": "g", "milli-g": "mg",
}


_SIGNS = str.maketrans("²⁻µμ·⋅\N{MINUS SIGN}", "2-uu  -")


def plain(text: str) -> str:
    """Return a unit in one way of writing: "m s^-2", "M/S**2", "m/sec/sec" and "m/s2" are "m/s2"."""
    unit = text.strip().lower().translate(_SIGNS)
    unit = _WORDS.get(unit, unit)
    unit = re.sub(r"secs?\b|sec(?=\d|\^|\*)", "s", unit)
    unit = re.sub(r"\*\*|\^|[{}()]", "", unit)
    unit = re.sub(r"/\s*s\s*/\s*s$", "/s2", unit)
    unit = re.sub(r"[\s.*]*\bs-2$|(?<=m)s-2$", "/s2", unit)
    unit = re.sub(r"[\s.*]*\bs-1$|(?<=m)s-1$", "/s", unit)
    return unit.replace(" ", "")


def bracketed(text: str) -> list[str]:
    """Return what stands in brackets, inner ones first."""
    return [part.strip() for part in [*re.findall(r"[(\[]([^()\[\]]*)[)\]]", text), *re.findall(r"\((.*)\)", text)] if part.strip()]


def unit_in_heading(cells: Iterable[str], known: dict[str, float]) -> str:
    """Return the unit that the headings of one column name, as they write it; empty where they name none.

    It stands in brackets, alone, or after the last blank, stroke or underscore if it is one of the `known`.
    """
    for cell in cells:
        inside = bracketed(cell)
        for part in [*inside, cell, *_units_after_words(cell)]:
            if plain(part) in known or (part in inside and plain(part) in OTHERS):
                return part.strip(" []()")
        for tail in re.findall(r"[\s/_,](?=(\S+)$)|[\s/_,](?=(\S+\s?/\s?\S+)$)", cell.strip()):
            for part in tail:
                if part and plain(part) in known:
                    return part
    return ""


def unit_in_remarks(lines: Iterable[str], known: dict[str, float]) -> str:
    """Return the one unit of the `known` in lines of words, in brackets or after "in" or "units"; empty where there is none or more."""
    found: dict[str, str] = {}
    for line in lines:
        for part in [*bracketed(line), *_units_after_words(line)]:
            if plain(part) in known:
                found.setdefault(plain(part), part.strip())
    return next(iter(found.values())) if len(found) == 1 else ""


def _units_after_words(line: str) -> list[str]:
    """Return what follows the words "in" and "units", as in "acceleration in units of g"."""
    return re.findall(r"\b(?:in\s+units?|in|units?|einheit|unité)\b(?:\s+of\b)?\s*[:=]?\s*([^\s,;:]+)", line, re.IGNORECASE)
