"""The charts of a run's page, group by group, from its results."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from uplift.drivers.report.charts import spectra_charts, time_chart, time_map
from uplift.drivers.results.results import Results, Series, floor_acceleration

Chart = dict[str, Any]


def chart_groups(results: Results) -> dict[str, list[Chart]]:
    """Return the charts by group: signal, probes, maps, uplift, reactions, energy, spectra; a group without data is empty."""
    return {
        "signal": _signal(results),
        "probes": [*_motions(results), *_accelerations(results)],
        "maps": _maps(results),
        "uplift": _uplift(results),
        "reactions": _reactions(results),
        "energy": _energy(results),
        "spectra": spectra_charts(results),
    }


def _columns(series: Series, columns: list[int]) -> Series:
    """Return some columns of a series."""
    return replace(series, names=tuple(series.names[i] for i in columns), values=series.values[:, columns])


def _by_component(series: Series) -> dict[str, list[int]]:
    """Return the columns of each component, such as DX of all probes."""
    components: dict[str, list[int]] = {}
    for column, name in enumerate(series.names):
        components.setdefault(name.split(".")[-1], []).append(column)
    return components


def _signal(results: Results) -> list[Chart]:
    ground = results.series.get("ground/acceleration")
    if ground is None:
        return []
    moving = np.flatnonzero(np.abs(ground.values).max(axis=0) > 0).tolist()
    return [time_chart("ground", "Acceleration of the ground", results.times, _columns(ground, moving))] if moving else []


def _motions(results: Results) -> list[Chart]:
    drawn = []
    for path, what in (("probes/displacement", "Displacement"), ("probes/rotation", "Rotation")):
        if path not in results.series:
            continue
        first = results.series.get("probes/first pass") if path == "probes/displacement" else None
        for component, columns in _by_component(results.series[path]).items():
            shown = _columns(results.series[path], columns)
            if first is not None:
                bonded = tuple(f"{name}, every contact bonded" for name in shown.names)
                shown = replace(shown, names=shown.names + bonded, values=np.hstack([shown.values, first.values[:, columns]]))
            drawn.append(time_chart(f"{path.split('/')[1]}-{component}", f"{what} {component}", results.times, shown))
    return drawn


def _accelerations(results: Results) -> list[Chart]:
    if "probes/acceleration" not in results.series:
        return []
    names, values = floor_acceleration(results.series)
    absolute = Series(names, "m/s2", values, "")
    return [
        time_chart(f"acceleration-{component}", f"Absolute acceleration along {component[-1]}", results.times, _columns(absolute, columns))
        for component, columns in _by_component(absolute).items()
    ]


def _maps(results: Results) -> list[Chart]:
    wanted = (("contacts/force", "Contact force", "blue"), ("contacts/gap", "Gap, white where closed", "orange"))
    return [
        time_map(path.replace("/", "-"), title, results.times, results.series[path], hue)
        for path, title, hue in wanted if path in results.series
    ]


def _uplift(results: Results) -> list[Chart]:
    drawn, times = [], results.times
    for path, title in (("uplift/area", "Lifted area"), ("uplift/contacts", "Open contacts")):
        part = results.series.get(path)
        known = 0 if part is None else int(np.sum(np.isfinite(part.values)))
        if part is not None and known > 1:
            note = f"Known at {known} of {len(times)} instants." if known < len(times) else ""
            drawn.append(time_chart(path.replace("/", "-"), title, times, part, note=note))
    return drawn


def _reactions(results: Results) -> list[Chart]:
    parts = [results.series[path] for path in ("reactions/force", "reactions/moment") if path in results.series]
    return [
        time_chart(name.replace(" ", "-"), name[:1].upper() + name[1:], results.times, _columns(part, [i]))
        for part in parts for i, name in enumerate(part.names)
    ]


def _energy(results: Results) -> list[Chart]:
    ledger = results.series.get("energy/ledger")
    if ledger is None:
        return []
    at = {name: i for i, name in enumerate(ledger.names)}
    shown = _columns(ledger, [at[name] for name in ("kinetic", "strain", "springs", "damped", "work of loads")])
    changes = replace(shown, values=np.column_stack([column - column[0] for column in shown.values.T]))
    note = "Work of loads less all the others: what the time integration itself takes away (positive) or adds."
    return [
        time_chart("energy", "Energies, change since time 0", results.times, changes),
        time_chart("residual", "Residual of the ledger", results.times, _columns(ledger, [at["numerical"]]), note=note),
    ]
