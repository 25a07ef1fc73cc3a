"""Records of ground motion and of forces in columns of text."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uplift.forms.loads.signals import Table
from uplift.forms.loads.text_columns import TextColumns, read_columns
from uplift.forms.loads.units import ACCELERATIONS, TIMES, plain, unit_in_heading, unit_in_remarks
from uplift.meshes.checked import ModelError
from uplift.meshes.findings import Finding, finding

TIME_NAMES = re.compile(r"(t|time|times|zeit|temps|tiempo|tempo|tijd|tid|elapsed)\b|(s|sec|seconds)$", re.IGNORECASE)
"""Headings of the column of times."""


@dataclass(frozen=True)
class RecordChoice:
    """What a scene says of the columns of a record."""

    column: int | str | None = None
    """Of the values, from 1 or by its heading; None: there are two."""
    unit: str = ""
    """One of `ACCELERATIONS`; empty: what the heading says."""
    scale: float = 1.0
    acceleration: bool = True
    """Whether the values are accelerations; else they are factors of a force."""


def read_record(path: Path, choice: RecordChoice) -> Table:
    """Read times in s and values, accelerations in m/s2 or factors, from the columns of a text file (`read_columns`).

    The times stand in the column whose heading says so, else in the first. Their unit and that of the values is read from the headings;
    what was understood there stands in the table's `remarks`. Raises `ModelError` naming file and line; its key is "column" or "unit" where
    that key of the scene is wrong or missing.
    """
    expected = "expected a time and an acceleration" if choice.acceleration else "expected a time and a value"
    columns = read_columns(path, expected)
    if len(columns.lines) < 2:
        raise ModelError("", f"{path}: expected at least two lines of time and acceleration")
    names = [_name(cell) for cell in columns.headings[0]] if columns.headings else []
    time = next((i for i, name in enumerate(names) if TIME_NAMES.match(name)), 0)
    value = _value_column(columns, names, time, choice.column)
    remarks: list[Finding] = []
    times_unit = _time_unit(columns, time, remarks)
    size = _size(columns, value, choice, remarks)
    rows = list(columns.rows((time, value)))
    table = np.array([row.values for row in rows])
    late = np.flatnonzero(np.diff(table[:, 0]) <= 0)
    if late.size:
        before, row = rows[late[0]], rows[late[0] + 1]
        times = f"{row.values[0]:g} after {before.values[0]:g}"
        raise ModelError("", f"{path}, line {row.number}: expected increasing times, got {times}")
    with np.errstate(over="ignore"):
        return Table(times_unit * table[:, 0], choice.scale * size * table[:, 1], tuple(remarks))


def _name(heading: str) -> str:
    """Return a heading without its unit."""
    return re.sub(r"[(\[].*", "", heading).strip().lower() or heading.strip("()[] ").lower()


def _value_column(columns: TextColumns, names: list[str], time: int, wanted: int | str | None) -> int:
    others = [i for i in range(columns.width) if i != time]
    listed = ", ".join(f"{i + 1} ({names[i]})" if names else str(i + 1) for i in others)
    if wanted is None:
        if len(others) != 1:
            raise ModelError("column", f"missing; {columns.path} has {columns.width} columns: expected one of {listed:.200}")
        return others[0]
    if isinstance(wanted, str):
        found = [i for i in others if wanted.strip().lower() in {names[i] if names else "", *(row[i].lower() for row in columns.headings)}]
        if len(found) != 1:
            raise ModelError("column", f"{columns.path} has {len(found) or 'no'} columns {wanted!r:.60}: expected one of {listed:.200}")
        return found[0]
    if wanted - 1 not in others:
        raise ModelError("column", f"{columns.path}: expected one of {listed:.200}, got {wanted!r:.60}")
    return wanted - 1


def _time_unit(columns: TextColumns, time: int, remarks: list[Finding]) -> float:
    unit = unit_in_heading([row[time] for row in columns.headings], TIMES)
    if not unit or plain(unit) == "s":
        return 1.0
    if plain(unit) in TIMES:
        remarks.append(finding("record", f"the times of {columns.path.name} are taken in {unit}, as its heading says", severity="note"))
        return TIMES[plain(unit)]
    remarks.append(finding("record", f"the heading of the times of {columns.path.name} says {unit!r:.40}; they are taken in s"))
    return 1.0


def _size(columns: TextColumns, value: int, choice: RecordChoice, remarks: list[Finding]) -> float:
    """Return what 1 in the file is, by the scene and by the heading of the column, and say where these differ."""
    name = columns.path.name
    said = unit_in_heading([row[value] for row in columns.headings], ACCELERATIONS) or unit_in_remarks(columns.remarks, ACCELERATIONS)
    if not choice.acceleration:
        if said:
            words = f"the heading of {name} says {said!r:.40}; its values are factors of the load, without a unit"
            remarks.append(finding("record", words))
        return ACCELERATIONS[choice.unit or "m/s2"]
    stated = ACCELERATIONS.get(plain(said))
    if choice.unit:
        if said and stated != ACCELERATIONS[choice.unit]:
            remarks.append(finding("record", f"the heading of {name} says {said!r:.40}, the scene says {choice.unit}, which is taken"))
        return ACCELERATIONS[choice.unit]
    if not said or stated == 1.0:
        return 1.0
    if stated is None:
        raise ModelError("unit", f"missing; the heading of {name} says {said!r:.40}, which is no unit of acceleration")
    if choice.scale == 1.0:
        words = f"the values of {name} are taken in {said}, {stated:g} m/s2, as its heading says"
        remarks.append(finding("record", words, severity="note"))
        return stated
    if abs(choice.scale / stated - 1) > 0.01:
        words = f"missing; the heading of {name} says {said!r:.40}, and scale = {choice.scale:g} may or may not turn that into m/s2"
        raise ModelError("unit", words)
    return 1.0
