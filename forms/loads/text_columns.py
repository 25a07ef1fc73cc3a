"""Columns of numbers in a CSV file that a user brings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from uplift.meshes.checked import ModelError

LARGEST = 200_000_000
"""Bytes of a file; a larger one is a slip."""


@dataclass(frozen=True)
class Row:
    """One line of numbers."""

    number: int
    """Of the line in the file, from 1."""
    text: str
    values: tuple[float, ...]


def read_columns(path: Path, expected: str) -> tuple[tuple[str, ...], list[Row]]:
    """Return the headings (empty where there are none) and the rows of numbers, all finite.

    The separator may be comma, semicolon or tab, the decimal sign is a point; one line of headings and lines beginning with #
    are passed over. Raises `ModelError` naming the file, the line and what was `expected` there.
    """
    try:
        if not path.is_file():
            raise ModelError("", f"cannot read {path}: there is no such file")
        if path.stat().st_size > LARGEST:
            raise ModelError("", f"cannot read {path}: expected at most {LARGEST / 1e6:g} MB, it has {path.stat().st_size / 1e6:.0f}")
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError("", f"cannot read {path}: {getattr(error, 'strerror', None) or 'not a text file'}") from error
    headings: tuple[str, ...] = ()
    rows: list[Row] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        separator = next((mark for mark in ";\t" if mark in line), ",")
        cells = line.rstrip(separator + "\r ").split(separator)
        try:
            values = tuple(float(cell) for cell in cells)
        except ValueError:
            if not rows and not headings:
                headings = tuple(cell.strip().strip('"').lower() for cell in cells)
                continue
            raise ModelError("", f"{path}, line {number}: {expected}, got {line!r:.60}") from None
        if not all(map(math.isfinite, values)):
            raise ModelError("", f"{path}, line {number}: expected finite numbers, got {line!r:.60}")
        rows.append(Row(number, line, values))
    return headings, rows
