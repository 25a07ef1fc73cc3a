"""Records of ground motion and of forces, read from files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uplift.forms.loads.signals import Table
from uplift.forms.loads.text_columns import read_columns
from uplift.meshes.checked import ModelError


def read_accelerogram(path: Path, scale: float = 1.0) -> Table:
    """Read times in s and accelerations, times `scale` in m/s2, from a CSV file of two columns.

    The separator may be comma, semicolon or tab, the decimal sign is a point; one line of headings and lines beginning with #
    are passed over. Raises `ModelError` naming the file and the line.
    """
    expected = "expected a time and an acceleration"
    rows = read_columns(path, expected)[1]
    for before, row in zip([None, *rows], rows, strict=False):
        if len(row.values) != 2:
            raise ModelError("", f"{path}, line {row.number}: {expected}, got {row.text!r:.60}")
        if before is not None and row.values[0] <= before.values[0]:
            times = f"{row.values[0]:g} after {before.values[0]:g}"
            raise ModelError("", f"{path}, line {row.number}: expected increasing times, got {times}")
    if len(rows) < 2:
        raise ModelError("", f"{path}: expected at least two lines of time and acceleration")
    table = np.array([row.values for row in rows])
    with np.errstate(over="ignore"):
        return Table(table[:, 0], scale * table[:, 1])
