"""Two runs beside each other: norms of what they differ by, and both over each other in pictures."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.report.charts import curve
from uplift.drivers.report.html_page import figures, page, section, table
from uplift.drivers.report.pictures import draw
from uplift.drivers.report.words import number, scale_for, written
from uplift.drivers.results.folder import all_or_nothing
from uplift.drivers.results.results import Results, Series, floor_acceleration
from uplift.meshes.checked import ModelError

PAGE = "compare.html"
"""What every folder of a comparison holds."""

SAME_INSTANT = 1e-9
"""Instants that differ by less than this part of the time between them are the same."""

DRAWN = 12
"""Overlays at most: of contacts those that differ most."""

WORDS = {
    "probes/rotation": "rotation {}", "probes/floor": "absolute acceleration {}", "ground/acceleration": "ground {}",
    "energy/ledger": "energy {}", "contacts/force": "force {}", "contacts/gap": "gap {}",
}
"""What a history is called; others bear their own names alone."""

PICTURED = 6
"""Panels of the picture at most."""

LISTED = 40
"""Lines of the printed table at most; the page and the CSV file have all."""


@dataclass(frozen=True)
class Pair:
    """One history of both runs at the same instants."""

    path: str
    name: str
    unit: str
    times: np.ndarray
    first: np.ndarray
    second: np.ndarray

    @property
    def difference(self) -> np.ndarray:
        """B - A at the instants where both are known."""
        return self.second - self.first

    @property
    def largest(self) -> float:
        """Largest |B - A|."""
        return float(np.max(np.abs(self.difference)))

    @property
    def when(self) -> float:
        """Its instant in s."""
        return float(self.times[np.argmax(np.abs(self.difference))])

    @property
    def rms(self) -> float:
        """Root of the mean square of B - A over time (trapezoidal rule): the L2 norm over the root of the duration."""
        return _rms(self.times, self.difference)

    @property
    def relative_largest(self) -> float:
        """Largest |B - A| over largest |A|."""
        return _ratio(self.largest, float(np.max(np.abs(self.first))))

    @property
    def relative_rms(self) -> float:
        """L2 norm of B - A over the L2 norm of A."""
        return _ratio(self.rms, _rms(self.times, self.first))


def _rms(times: np.ndarray, values: np.ndarray) -> float:
    if len(times) < 2:
        return float(np.abs(values[0]))
    squares = values**2
    return float(np.sqrt(np.sum(np.diff(times) * (squares[1:] + squares[:-1])) / 2 / (times[-1] - times[0])))


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole > 0 else (0.0 if part == 0 else float("inf"))


@dataclass(frozen=True)
class Comparison:
    """Everything that two runs have in common."""

    names: tuple[str, str]
    """What A and B are called: their files."""
    titles: tuple[str, str]
    pairs: list[Pair]
    warnings: list[str]
    changes: list[tuple[str, str, str]]
    """Entries of the scene that differ: key, value in A, value in B."""
    spectra: list[dict[str, Any]]
    """Charts of the spectra of both."""

    def worst(self) -> float:
        """Return the largest difference of a probe's displacement, relative to its largest value (of all histories without probes)."""
        probes = [pair for pair in self.pairs if pair.path == "probes/displacement"] or self.pairs
        return max(pair.relative_largest for pair in probes)

    def lines(self) -> list[str]:
        """Return the table as lines of text."""
        lines = [f"A  {self.names[0]}: {self.titles[0]}", f"B  {self.names[1]}: {self.titles[1]}"]
        lines += [f"warning: {text}" for text in self.warnings]
        if self.changes:
            lines += ["", "the scenes differ in"]
            lines += [f"  {key}: {a} -> {b}" for key, a, b in self.changes[:20]]
            lines += [f"  and {len(self.changes) - 20} more"] if len(self.changes) > 20 else []
        width = max(len(_title(pair)) for pair in self.pairs[:LISTED]) + 2
        lines += ["", f"{'':<{width}}{'max |A|':>15}{'max |B-A|':>17}{'at t [s]':>10}{'relative':>11}{'rms B-A':>17}{'relative':>11}"]
        for pair in self.pairs[:LISTED]:
            lines.append(
                f"{_title(pair):<{width}}{written(float(np.max(np.abs(pair.first))), pair.unit):>15}{written(pair.largest, pair.unit):>17}"
                f"{pair.when:>10.5g}{pair.relative_largest:>11.2e}{written(pair.rms, pair.unit):>17}{pair.relative_rms:>11.2e}"
            )
        if len(self.pairs) > LISTED:
            lines.append(f"and {len(self.pairs) - LISTED} more in the files")
        return lines


def _title(pair: Pair) -> str:
    return WORDS.get(pair.path, "{}").format(pair.name)


def compare(first: Results, second: Results, names: tuple[str, str]) -> Comparison:
    """Compare B with A. Raises `ModelError` if they have no instants or no histories in common."""
    a, b = _histories(first), _histories(second)
    common = [path for path in a if path in b and set(a[path].names) & set(b[path].names)]
    if not common:
        raise ModelError("", f"{names[0]} and {names[1]} have no histories of the same name in common: {_kinds(a)}; {_kinds(b)}")
    times, warnings = _common_times(first.times, second.times, names)
    pairs = []
    for path in common:
        if a[path].unit != b[path].unit:
            warnings.append(f"{path} is left out: {a[path].unit} in A, {b[path].unit} in B")
            continue
        for name in a[path].names:
            if name in b[path].names:
                one, other = (_at(times, r.times, s[path], name) for r, s in ((first, a), (second, b)))
                known = np.isfinite(one) & np.isfinite(other)
                if known.any() and not (path == "ground/acceleration" and not one.any() and not other.any()):
                    pairs.append(Pair(path, name, a[path].unit, times[known], one[known], other[known]))
    lost = [name for path in a for name in a[path].names if path not in b or name not in b[path].names]
    lost += [name for path in b for name in b[path].names if path not in a or name not in a[path].names]
    if lost:
        shown = ", ".join(dict.fromkeys(lost[:6]))
        warnings.append(f"only one of the runs has {shown}{' ...' if len(lost) > 6 else ''}")
    changes = _changes(first.facts.get("scene", {}), second.facts.get("scene", {}))
    return Comparison(names, (first.name, second.name), pairs, warnings, changes, _spectra(first, second))


def _histories(results: Results) -> dict[str, Series]:
    """Return what is compared: all but what follows from the rest or jumps, and absolute accelerations for relative ones."""
    kept = {key: part for key, part in results.series.items()
            if key not in ("probes/first pass", "probes/acceleration", "forces/angle")
            and not key.startswith(("contacts/line force/", "contacts/pressure/"))}
    if "probes/acceleration" in results.series:
        names, absolute = floor_acceleration(results.series)
        kept["probes/floor"] = Series(names, "m/s2", absolute, "Absolute accelerations of the probes")
    order = ("probes", "ground", "reactions", "forces", "cuts", "uplift", "energy", "contacts")
    return {key: kept[key] for key in sorted(kept, key=lambda key: order.index(key.split("/")[0]))}


def _kinds(histories: dict[str, Series]) -> str:
    names = [name for part in histories.values() for name in part.names]
    return f"{', '.join(names[:6])}{' ...' if len(names) > 6 else ''}" or "none"


def _common_times(a: np.ndarray, b: np.ndarray, names: tuple[str, str]) -> tuple[np.ndarray, list[str]]:
    """Return the instants at which the runs are compared, those of the coarser one that both reach, and warnings where they differ."""
    step = min(_step(a), _step(b))
    low, high = max(a[0], b[0]) - SAME_INSTANT * step, min(a[-1], b[-1]) + SAME_INSTANT * step
    coarse, fine = (b, a) if _step(b) > _step(a) * (1 + SAME_INSTANT) else (a, b)
    times = coarse[(coarse >= low) & (coarse <= high)]
    if not len(times):
        raise ModelError(
            "", f"{names[0]} and {names[1]} have no instants in common: {a[0]:g} to {a[-1]:g} s, {b[0]:g} to {b[-1]:g} s"
        )
    warnings = []
    if abs(a[0] - b[0]) > SAME_INSTANT * step or abs(a[-1] - b[-1]) > SAME_INSTANT * step:
        warnings.append(f"the runs last differently; compared from {times[0]:g} to {times[-1]:g} s")
    nearest = fine[np.clip(np.searchsorted(fine, times - 0.5 * step), 0, len(fine) - 1)]
    if np.max(np.abs(nearest - times)) > 1e-6 * step:
        warnings.append(
            f"the instants differ ({_step(a):g} s and {_step(b):g} s apart): the finer run is interpolated linearly at those of the coarser"
        )
    elif len(a) != len(b) and abs(_step(a) - _step(b)) > SAME_INSTANT * step:
        warnings.append(f"instants are {_step(a):g} s and {_step(b):g} s apart: compared at those that both have")
    return times, warnings


def _step(times: np.ndarray) -> float:
    return float(times[-1] - times[0]) / (len(times) - 1) if len(times) > 1 else 1.0


def _at(times: np.ndarray, own: np.ndarray, series: Series, name: str) -> np.ndarray:
    values = series.values[:, series.names.index(name)]
    rows = np.clip(np.searchsorted(own, times - 0.5 * _step(own)), 0, len(own) - 1)
    if np.max(np.abs(own[rows] - times)) <= 1e-6 * _step(own):
        return values[rows]
    return np.interp(times, own, values)


def _changes(a: Any, b: Any, key: str = "") -> list[tuple[str, str, str]]:
    """Return the entries of two scenes that differ."""
    if isinstance(a, dict) and isinstance(b, dict):
        found = []
        for name in dict.fromkeys([*a, *b]):
            found += _changes(a.get(name, "-"), b.get(name, "-"), f"{key}.{name}" if key else name)
        return found
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b) and any(isinstance(item, dict) for item in a):
        return [change for i, (one, other) in enumerate(zip(a, b, strict=True)) for change in _changes(one, other, f"{key}[{i + 1}]")]
    if a == b:
        return []
    return [(key, *(text if len(text) <= 60 else f"{text[:57]}..." for text in (str(a), str(b))))]  # type: ignore[list-item]  # two texts


def _spectra(first: Results, second: Results) -> list[dict[str, Any]]:
    if first.spectra is None or second.spectra is None:
        return []
    charts = []
    for name in first.spectra_names:
        if name not in second.spectra_names:
            continue
        curves = []
        for label, results in (("A", first), ("B", second)):
            spectra = results.spectra
            assert spectra is not None
            j = results.spectra_names.index(name)
            i = int(np.argmin(np.abs(spectra.damping - 0.05)))
            curves.append(curve(f"{label}, {100 * spectra.damping[i]:g} %", spectra.frequencies, spectra.acceleration[i, :, j], 1.0))
        charts.append({
            "kind": "lines", "key": f"spectrum-{name}", "title": f"Floor response spectrum {name}", "unit": "m/s²", "x": "f [Hz]",
            "log": True, "time": False, "note": "", "curves": curves,
        })
    return charts


def write_comparison(folder: Path, comparison: Comparison, *, plots: bool) -> None:
    """Write compare.html, compare.csv and, with plots, compare.png."""
    with all_or_nothing(folder) as staging:
        with (staging / "compare.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["history", "name", "unit", "max |A|", "max |B-A|", "at t [s]", "relative", "rms B-A", "relative rms"])
            for pair in comparison.pairs:
                size = float(np.max(np.abs(pair.first)))
                numbers = (size, pair.largest, pair.when, pair.relative_largest, pair.rms, pair.relative_rms)
                writer.writerow([pair.path, pair.name, pair.unit, *(repr(float(value)) for value in numbers)])
        (staging / PAGE).write_text(comparison_page(comparison), encoding="utf-8")
        if plots:
            _draw(staging / "compare.png", comparison)


def _shown(comparison: Comparison, most: int) -> list[Pair]:
    """Return the pairs that are drawn: all but those of the contacts, then the contacts that differ most."""
    others = [pair for pair in comparison.pairs if not pair.path.startswith(("contacts", "ground"))]
    contacts = [pair for pair in comparison.pairs if pair.path.startswith("contacts")]
    room = max(most - len(others), min(2, most // 3))
    contacts = sorted(contacts, key=lambda pair: -pair.relative_largest if np.isfinite(pair.relative_largest) else 0.0)[:room]
    return others[: most - len(contacts)] + contacts


def _draw(path: Path, comparison: Comparison) -> None:
    from uplift.drivers.report.history_plots import draw_overlays

    panels = []
    for pair in _shown(comparison, PICTURED):
        scale = scale_for(pair.unit, max(float(np.max(np.abs(pair.first))), float(np.max(np.abs(pair.second)))))
        panels.append((f"{_title(pair)}\n[{scale.label}]", pair.times, pair.first / scale.size, pair.second / scale.size))
    draw(draw_overlays, path, panels, ("A", "B"), f"A: {comparison.names[0]}\nB: {comparison.names[1]}")


def comparison_page(comparison: Comparison) -> str:
    """Return the page of a comparison as HTML."""
    charts = []
    for k, pair in enumerate(_shown(comparison, DRAWN)):
        scale = scale_for(pair.unit, max(float(np.max(np.abs(pair.first))), float(np.max(np.abs(pair.second)))))
        small = scale_for(pair.unit, pair.largest)
        common: dict[str, Any] = {"kind": "lines", "x": "t [s]", "time": True, "note": ""}
        curves = [curve("A", pair.times, pair.first, scale.size), curve("B", pair.times, pair.second, scale.size)]
        charts.append(common | {"key": f"both-{k}", "title": _title(pair), "unit": scale.label, "curves": curves})
        curves = [curve("B minus A", pair.times, pair.difference, small.size)]
        title = f"B minus A: {_title(pair)}"
        charts.append(common | {"key": f"difference-{k}", "title": title, "unit": small.label, "curves": curves, "height": 180})
    rows = [
        [escape(_title(pair)), escape(written(float(np.max(np.abs(pair.first))), pair.unit)), escape(written(pair.largest, pair.unit)),
         f"{pair.when:.6g}", number(pair.relative_largest, 3), escape(written(pair.rms, pair.unit)), number(pair.relative_rms, 3)]
        for pair in comparison.pairs[:400]
    ]
    heads = ["", "largest |A|", "largest |B − A|", "at t [s]", "relative", "rms of B − A", "relative"]
    warned = "".join(f"<li>{escape(text[:1].upper() + text[1:])}</li>" for text in comparison.warnings)
    words = "To be known before these numbers are used"
    warnings = f'<div class="warnings" id="warnings"><h2>{words}</h2><ul>{warned}</ul></div>' if warned else ""
    runs = table(["", "", ""], [["A", escape(comparison.titles[0]), escape(comparison.names[0])],
                                ["B", escape(comparison.titles[1]), escape(comparison.names[1])]])
    changes = table(["", "A", "B"], [[escape(text) for text in change] for change in comparison.changes])
    same = '<p class="calm">The scenes are the same.</p>'
    main = (
        section("runs", "The runs", runs)
        + section("scenes", "What the scenes differ in", changes if comparison.changes else same)
        + section("norms", "Differences", table(heads, rows))
        + section("overlays", "Both over each other", figures(charts))
        + section("spectra", "Spectra", figures(comparison.spectra))
    )
    body = f"<header>\n<h1>Comparison of two runs</h1>\n{warnings}\n</header>\n<main>\n{main}\n</main>\n<footer></footer>"
    return page("Comparison of two runs", body, {"charts": charts + comparison.spectra})
