"""Values of a scene's TOML table by their dotted paths, as supports.RESS.gap or load.amplitude."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

from uplift.meshes.checked import ModelError


def places(table: dict[str, Any], path: str) -> list[dict[str, Any]]:
    """Return the tables that hold the value at a path: one, or several where an array of tables is passed without choosing.

    Tables of an array go by their name, or by their number from 1. Raises `ModelError`, its key the path, if there is no such table.
    """
    *groups, _ = path.split(".")
    here: list[Any] = [table]
    chosen: list[dict[str, Any]] = here
    for depth, part in enumerate(groups):
        found = []
        for entry in here:
            if isinstance(entry, list):
                named = [one for number, one in enumerate(entry, start=1) if part in (one.get("name"), str(number))]
                found += named[:1] or [one[part] for one in entry if part in one]
            elif part in entry:
                found.append(entry[part])
        here = [one for one in found if isinstance(one, (dict, list))]
        if not here:
            raise ModelError(path, f"the scene has no {'.'.join(groups[: depth + 1])}")
        chosen = [one for entry in here for one in (entry if isinstance(entry, list) else [entry])]
    return chosen


def varied(table: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a scene's TOML table with the values at some paths changed, in all tables that hold them.

    A function is given the old value, which has to be there; None takes the value away. Raises `ModelError` for a path that leads nowhere.
    """
    table = copy.deepcopy(table)
    for path, value in changes.items():
        key = path.rpartition(".")[2]
        for place in places(table, path):
            if value is None:
                place.pop(key, None)
            elif not callable(value):
                place[key] = value
            elif key in place:
                place[key] = value(place[key])
            else:
                raise ModelError(path, "the scene has no such value to begin from")
    return table
