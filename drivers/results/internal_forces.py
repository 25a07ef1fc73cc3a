"""Internal forces of a run as named columns with units: section forces and stresses at probes, resultants of cuts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from uplift.drivers.results.results import Series
from uplift.forms.operators import OutputGroup, Outputs

if TYPE_CHECKING:
    from uplift.forms.assembly.assemble import InternalForces
    from uplift.solvers.history import History

ABOUT = {
    "forces": "At the probes, in the axes of their part: membrane forces (tension positive), moments (positive ones stretch the side that "
              "the normal points to), shear forces, stresses at the faces (top: where the normal points to)",
    "cuts": "What the rest exerts on the side of each cut; moments about its point; N along the normal out of the side, V what is left",
}
"""By table."""


@dataclass(frozen=True)
class Column:
    """One history."""

    name: str
    unit: str
    values: np.ndarray
    """(nt,)."""


def columns_of(forces: InternalForces, history: History) -> dict[str, list[Column]]:
    """Return the internal forces of a run by table, "forces" and "cuts"; a run that asked for none has no table."""
    outputs, found = history.layout, {}
    groups = {group.name: _columns(group, history.group(group.name)) for group in _groups(outputs)}
    if "forces" in groups:
        found["forces"] = [column for name, t in forces.thickness.items() for column in _at_probe(name, t, groups["forces"])]
    if "cuts" in groups:
        damping = {column.name.removesuffix(" damping"): column for column in groups.get("cuts damping", [])}
        found["cuts"] = []
        for name, normal in forces.normals.items():
            own = [column for column in groups["cuts"] if column.name.rpartition(".")[0] == name]
            found["cuts"] += [*own, *_along(name, normal, own), *(damping[column.name] for column in own if column.name in damping)]
    return found


def series_of(columns: dict[str, list[Column]]) -> dict[str, Series]:
    """Return the histories of a results file: one for each table and kind of quantity, such as forces/moment."""
    series = {}
    for table, listed in columns.items():
        for kind in dict.fromkeys(_kind(table, column) for column in listed):
            chosen = [column for column in listed if _kind(table, column) == kind]
            values = np.column_stack([column.values for column in chosen])
            series[f"{table}/{kind}"] = Series(tuple(column.name for column in chosen), chosen[0].unit, values, ABOUT[table])
    return series


def _groups(outputs: Outputs) -> list[OutputGroup]:
    return [group for group in outputs.groups if group.name in ("forces", "cuts", "cuts damping")]


def _columns(group: OutputGroup, values: np.ndarray) -> list[Column]:
    return [Column(name, unit, column) for name, unit, column in zip(group.names, group.units, values.T, strict=True)]


def _at_probe(probe: str, thickness: float, columns: list[Column]) -> list[Column]:
    """Return the section forces at one probe and what follows from them."""
    from uplift.forms.recovery.stresses import derived

    own = [column for column in columns if column.name.rpartition(".")[0] == probe]
    values = {column.name.rpartition(".")[2]: column.values for column in own}
    return own + [Column(f"{probe}.{name}", unit, found) for name, (unit, found) in derived(values, thickness).items()]


def _along(cut: str, normal: np.ndarray | None, columns: list[Column]) -> list[Column]:
    """Return the parts of a cut's force along its normal and across."""
    if normal is None:
        return []
    force = np.column_stack([column.values for column in columns[:3]])
    along = force @ normal
    across = np.linalg.norm(force - np.outer(along, normal), axis=1)
    return [Column(f"{cut}.N", "N", along), Column(f"{cut}.V", "N", across)]


def _kind(table: str, column: Column) -> str:
    """Return the kind of quantity that a column is, by its unit and name."""
    if table == "cuts":
        return f"{'damping ' if column.name.endswith(' damping') else ''}{'moment' if column.unit == 'N m' else 'force'}"
    quantity = column.name.partition(".")[2]
    return {"N m/m": "moment", "Pa": "stress", "rad": "angle"}.get(column.unit, "shear" if quantity.startswith("V") else "membrane")
