"""What a page draws, as plain data: thinned histories, maps over time, the film."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from uplift.drivers.analysis.snapshots import SnapshotData
from uplift.drivers.report.words import scale_for
from uplift.drivers.results.results import Results, Series

DRAWN = 1200
"""Points of a history that are drawn at most; its extremes stay exact."""

MAP_COLUMNS, MAP_VALUES = 600, 200_000
"""Columns and values of a map over time at most."""

FILM_VALUES = 750_000
"""Numbers of a page's film at most, 2 bytes each."""

MANY_CELLS = 3000
"""Of a mesh with more cells than this the page draws the outline."""

CURVES = 12
"""Curves in one chart at most: those that reach farthest."""


def thinned(times: np.ndarray, values: np.ndarray, most: int = DRAWN) -> np.ndarray:
    """Return the rows of a history (nt,) that are drawn: of each of `most` / 2 equal stretches its least and its largest value."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) <= most:
        return known
    kept = {int(known[0]), int(known[-1])}
    for stretch in np.array_split(known, most // 2):
        kept |= {int(stretch[np.argmin(values[stretch])]), int(stretch[np.argmax(values[stretch])])}
    return np.array(sorted(kept))


def curve(name: str, x: np.ndarray, y: np.ndarray, size: float, most: int = DRAWN) -> dict[str, Any]:
    """Return one curve of a chart, y in units of `size`."""
    rows = thinned(x, y, most)
    return {"name": name, "x": [_short(v, 9) for v in x[rows]], "y": [_short(v / size, 7) for v in y[rows]]}


def _short(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")


def time_chart(key: str, title: str, times: np.ndarray, series: Series, *, note: str = "") -> dict[str, Any]:
    """Return a chart of histories over times (nt,) s."""
    names, values = series.names, series.values
    finite = np.where(np.isfinite(values), values, 0.0)
    reach = np.max(np.abs(finite), axis=0, initial=0.0)
    shown = np.sort(np.argsort(-reach, kind="stable")[:CURVES])
    if len(names) > CURVES:
        note = f"{note} The {CURVES} of {len(names)} that reach farthest are drawn.".strip()
    scale = scale_for(series.unit, float(reach.max(initial=0.0)))
    return {
        "kind": "lines", "key": key, "title": title, "unit": scale.label, "x": "t [s]", "time": True, "note": note,
        "curves": [curve(names[i], times, values[:, i], scale.size) for i in shown],
    }


def spectra_charts(results: Results) -> list[dict[str, Any]]:
    """Return one chart of floor response spectra for each probe and direction, a curve for each damping ratio."""
    spectra = results.spectra
    if spectra is None:
        return []
    return [
        {
            "kind": "lines", "key": f"spectrum-{name}", "title": f"{name}", "unit": "m/s²", "x": "f [Hz]", "log": True, "time": False,
            "note": "",
            "curves": [
                curve(f"{100 * zeta:g} % damping", spectra.frequencies, spectra.acceleration[i, :, j], 1.0)
                for i, zeta in enumerate(spectra.damping)
            ],
        }
        for j, name in enumerate(results.spectra_names)
    ]


def time_map(key: str, title: str, times: np.ndarray, series: Series, hue: str) -> dict[str, Any]:
    """Return a map, contacts over times (nt,) s, of values >= 0; a column shows the largest of the instants it stands for."""
    names, values = series.names, series.values
    columns = max(2, min(MAP_COLUMNS, MAP_VALUES // max(len(names), 1), len(times)))
    starts = np.unique(np.floor(np.linspace(0, len(times), columns, endpoint=False)).astype(int))
    largest = np.maximum(np.maximum.reduceat(values, starts, axis=0), 0.0)
    top = float(largest.max(initial=0.0))
    scale = scale_for(series.unit, top)
    codes = np.round(largest.T / (top or 1.0) * 65535).astype("<u2")
    return {
        "kind": "map", "key": key, "title": title, "unit": scale.label, "hue": hue, "names": list(names), "columns": len(starts),
        "top": top / scale.size, "from": float(times[0]), "to": float(times[-1]), "values": packed(codes),
    }


def packed(values: np.ndarray) -> str:
    """Return an array as base64."""
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


def outline(corners: np.ndarray) -> np.ndarray:
    """Return the edges (n, 2) that belong to one cell only."""
    edges = np.concatenate([np.column_stack([corners[:, i], corners[:, (i + 1) % corners.shape[1]]]) for i in range(corners.shape[1])])
    edges = np.sort(edges, axis=1)
    different, count = np.unique(edges, axis=0, return_counts=True)
    return different[count == 1]


def loops(edges: np.ndarray) -> list[list[int]]:
    """Return the closed curves that the edges (n, 2) of an outline make, as lists of nodes."""
    neighbours: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    found = []
    while neighbours:
        loop = [next(iter(neighbours))]
        while loop[-1] in neighbours:
            here = loop[-1]
            there = neighbours[here].pop()
            neighbours[there].remove(here)
            for node in (here, there):
                if not neighbours[node]:
                    del neighbours[node]
            loop.append(there)
        found.append(loop[:-1])
    return found


def is_flat(plate: SnapshotData) -> bool:
    """Return whether the plate lies in the plane XY and stays there."""
    frames = plate.snapshots if len(plate.snapshots) else plate.peak
    moved = np.abs(frames).max(axis=(0, 1), initial=0.0)
    extent = float(np.ptp(plate.points, axis=0).max())
    return bool(np.ptp(plate.points[:, 2]) <= 1e-9 * extent and moved[2] <= 1e-6 * moved.max(initial=0.0))


def up_axis(results: Results) -> int:
    """Return the axis (0, 1, 2) that is drawn upwards: the one along which most contacts push, else Y."""
    directions = results.points.get("directions", np.zeros((0, 3)))
    return int(np.argmax(np.abs(directions).sum(axis=0))) if len(directions) else 1


def film_data(results: Results) -> dict[str, Any] | None:
    """Return the film for the page: mesh or outline, quantised displacements, contact forces and gaps at its frames."""
    plate = results.plate
    if plate is None or len(plate.rows) < 2:
        return None
    from scipy.spatial import cKDTree

    contacts = results.points.get("contacts", np.zeros((0, 3)))
    feet = cKDTree(plate.points).query(contacts)[1] if len(contacts) else np.zeros(0, dtype=int)
    corners = plate.corners
    edges = outline(corners)
    cells = corners if len(corners) <= MANY_CELLS else corners[:0]
    used, numbers = np.unique(np.concatenate([cells.ravel(), edges.ravel(), feet]), return_inverse=True)
    numbers = numbers.ravel()
    flat = is_flat(plate)
    components = 2 if flat else 3
    frames = max(2, min(len(plate.rows), FILM_VALUES // max(len(used) * components, 1)))
    chosen = np.unique(np.round(np.linspace(0, len(plate.rows) - 1, frames)).astype(int))
    rows = plate.rows[chosen]
    displacement = plate.snapshots[chosen][:, used][:, :, :components].astype(float)
    largest = float(np.abs(displacement).max(initial=0.0))
    codes = np.round(displacement / (largest or 1.0) * 32767).astype("<i2")
    n_cells, n_edges = cells.size, edges.size
    data = {
        "times": [_short(t, 9) for t in results.times[rows]],
        "points": [[_short(v, 7) for v in point] for point in plate.points[used]],
        "cells": numbers[:n_cells].reshape(cells.shape).tolist(),
        "edges": numbers[n_cells : n_cells + n_edges].reshape(-1, 2).tolist(),
        "loops": [] if len(cells) else loops(numbers[n_cells : n_cells + n_edges].reshape(-1, 2)),
        "feet": numbers[n_cells + n_edges :].tolist(),
        "flat": flat, "up": up_axis(results), "components": components, "largest": largest, "frames": packed(codes),
        "start": int(np.argmin(np.abs(results.times[rows] - float(results.facts.get("peak_time_s", 0.0))))),
        "extent": float(np.ptp(plate.points, axis=0).max()),
        "directions": results.points["directions"].tolist() if len(contacts) else [],
        "springs": results.points.get("springs", np.zeros((0, 3))).tolist(),
    }
    if len(contacts) and "contacts/force" in results.series:
        force, gap = results.series["contacts/force"].values[rows], results.series["contacts/gap"].values[rows]
        strongest = float(np.max(force, initial=0.0))
        data |= {
            "force": packed(np.round(np.clip(force, 0, None) / (strongest or 1.0) * 65535).astype("<u2")),
            "strongest": strongest,
            "open": packed((gap > 0).astype(np.uint8)),
            "names": list(results.series["contacts/force"].names),
        }
    ground = results.series.get("ground/acceleration")
    if ground is not None:
        data["ground"] = [[_short(v, 5) for v in row] for row in ground.values[rows]]
    return data


def line_data(results: Results) -> list[dict[str, Any]]:
    """Return the lines of contacts: positions, extremes and mean of the pressure, and what turns contact forces in N into it."""
    lines = []
    for path, series in results.series.items():
        if not path.startswith("contacts/line force/"):
            continue
        points = results.points["contacts"]
        order = [results.series["contacts/force"].names.index(name) for name in series.names]
        position = np.linalg.norm(points[order] - points[order[0]], axis=1)
        scale = scale_for(series.unit, float(np.max(np.abs(series.values), initial=0.0)))
        gaps = np.diff(position)
        share = 0.5 * (np.append(gaps, 0.0) + np.insert(gaps, 0, 0.0))
        lines.append({
            "name": path.split("/")[-1], "unit": scale.label, "position": [_short(v, 7) for v in position],
            "largest": [_short(v, 6) for v in series.values.max(axis=0) / scale.size],
            "least": [_short(v, 6) for v in series.values.min(axis=0) / scale.size],
            "mean": [_short(v, 6) for v in series.values.mean(axis=0) / scale.size],
            "contacts": order, "per": [_short(v, 7) for v in 1 / share / scale.size],
        })
    return lines
