"""Scenes with values varied, by the path of each value."""

from __future__ import annotations

import copy
import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import Scene, build_scene
from uplift.meshes.checked import ModelError


def varied(table: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Return a copy of a scene's TOML table with `changes`, see `Case`; in arrays of tables every table is changed.

    Raises `ModelError` if the scene lacks a table, or an old value, that is to be changed.
    """
    table = copy.deepcopy(table)
    for path, value in changes.items():
        *groups, key = path.split(".")
        places = [table]
        for group in groups:
            _require(places, group, path)
            places = [inner for place in places for inner in _tables(place[group])]
        if callable(value):
            _require(places, key, path)
        for place in places:
            if value is None:
                place.pop(key, None)
            else:
                place[key] = value(place[key]) if callable(value) else value
    return table


def _require(places: list[dict[str, Any]], key: str, path: str) -> None:
    if not all(key in place for place in places):
        raise ModelError(path, "missing; the survey varies it")


def _tables(entry: Any) -> list[dict[str, Any]]:
    return entry if isinstance(entry, list) else [entry]


MANY = 100_000
"""More cases than this are a slip of the pen."""


@dataclass(frozen=True)
class Variation:
    """A value of the scene, by its path in the file, and what it is set to."""

    key: str
    values: tuple[float, ...]


def variation(text: str) -> Variation:
    """Read `key=first:last:number` (equidistant) or `key=a,b,c`. Raises `ModelError` for anything else."""
    key, _, spec = text.partition("=")
    try:
        if ":" in spec:
            first, last, number = spec.split(":")
            values = tuple(np.linspace(float(first), float(last), int(number)).tolist())
        else:
            values = tuple(float(part) for part in spec.split(","))
    except ValueError:
        values = ()
    if not key.strip() or not values or not np.all(np.isfinite(values)):
        raise ModelError("--vary", f"expected KEY=FIRST:LAST:NUMBER or KEY=A,B,..., as load.amplitude=0.5:8:16, got {text!r}")
    return Variation(key.strip(), values)


def changed(table: dict[str, Any], key: str, value: float) -> None:
    """Set the entry of a scene's table at a dotted path; tables of an array go by their name, or by their number from 1.

    Raises `ModelError` if there is no such table, or if the entry is there and no number.
    """
    *path, last = key.split(".")
    here: Any = table
    for depth, part in enumerate(path):
        if isinstance(here, list):
            named = [entry for number, entry in enumerate(here, start=1) if part in (entry.get("name"), str(number))]
            here = named[0] if named else None
        else:
            here = here.get(part)
        if not isinstance(here, (dict, list)):
            raise ModelError("--vary", f"{key}: the scene has no {'.'.join(path[: depth + 1])}")
    if isinstance(here, list):
        raise ModelError("--vary", f"{key}: {'.'.join(path)} has several entries; name one of them: {', '.join(_names(here))}")
    old = here.get(last, 0.0)
    if isinstance(old, bool) or not isinstance(old, (int, float)):
        raise ModelError("--vary", f"{key}: expected the path of a number, found {old!r:.40}")
    here[last] = int(value) if isinstance(old, int) and float(value).is_integer() else value


def _names(entries: list[dict[str, Any]]) -> list[str]:
    return [str(entry.get("name", number)) for number, entry in enumerate(entries, start=1)]


def cases_of(scene: Scene, folder: Path, variations: list[Variation]) -> list[tuple[tuple[float, ...], Scene]]:
    """Return the values and the scene of every combination, all of them checked. Raises `ModelError` for one that cannot be."""
    if np.prod([float(len(v.values)) for v in variations]) > MANY:
        raise ModelError("--vary", f"expected at most {MANY} cases")
    cases = []
    for values in itertools.product(*(v.values for v in variations)):
        table = copy.deepcopy(scene.source)
        for v, value in zip(variations, values, strict=True):
            changed(table, v.key, value)
        made = build_scene(table, folder)
        Request("transient", basis=0.5).check(made)
        cases.append((values, made))
    return cases
