"""Scenes with values varied, by the path of each value."""

from __future__ import annotations

import copy
import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from uplift.drivers.scene.paths import places
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import Scene, build_scene
from uplift.meshes.checked import ModelError

MAX_CASES = 100_000
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
            values = tuple(np.linspace(float(first), float(last), min(int(number), MAX_CASES + 1)).tolist())
        else:
            values = tuple(float(part) for part in spec.split(","))
    except ValueError:
        values = ()
    if not key.strip() or not values or not np.all(np.isfinite(values)):
        raise ModelError("--vary", f"expected KEY=FIRST:LAST:NUMBER or KEY=A,B,..., as load.amplitude=0.5:8:16, got {text!r:.60}")
    return Variation(key.strip(), values)


def changed(table: dict[str, Any], key: str, value: float) -> None:
    """Set the number at a dotted path of a scene's table (`uplift.drivers.scene.paths`).

    Raises `ModelError` if there is no such table, or several, or if the value is there and no number.
    """
    try:
        found = places(table, key)
    except ModelError as error:
        raise ModelError("--vary", f"{key}: {error.message}") from None
    path, _, last = key.rpartition(".")
    if len(found) > 1:
        names = ", ".join(str(entry.get("name", number)) for number, entry in enumerate(found, start=1))
        raise ModelError("--vary", f"{key}: {path} has several entries; name one of them: {names}")
    (here,) = found
    old = here.get(last, 0.0)
    if isinstance(old, bool) or not isinstance(old, (int, float)):
        raise ModelError("--vary", f"{key}: expected the path of a number, found {old!r:.40}")
    here[last] = int(value) if isinstance(old, int) and float(value).is_integer() else value


def cases_of(scene: Scene, variations: list[Variation]) -> list[tuple[tuple[float, ...], Scene]]:
    """Return the values and the scene of every combination, all of them checked. Raises `ModelError` for one that cannot be."""
    if np.prod([float(len(v.values)) for v in variations]) > MAX_CASES:
        raise ModelError("--vary", f"expected at most {MAX_CASES} cases")
    cases = []
    for values in itertools.product(*(v.values for v in variations)):
        table = copy.deepcopy(scene.source)
        for v, value in zip(variations, values, strict=True):
            changed(table, v.key, value)
        made = build_scene(table, scene.folder)
        Request("transient", basis=0.5).check(made)
        cases.append((values, made))
    return cases
