"""The files that a run leaves: histories, summary, pictures and the deformed plate."""

from __future__ import annotations

import csv
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.analysis.answer_findings import say_findings
from uplift.drivers.analysis.assembled_scene import Analysis, AssembledScene, ContactEvents
from uplift.drivers.analysis.snapshots import Snapshots
from uplift.drivers.process import heard_findings
from uplift.drivers.report.page import NAME as REPORT
from uplift.drivers.report.page import write_report
from uplift.drivers.report.pictures import draw
from uplift.drivers.results.collect import collect
from uplift.drivers.results.folder import all_or_nothing, processor, versions, write_history, write_summary
from uplift.drivers.results.hdf5 import NAME as RESULTS
from uplift.drivers.results.hdf5 import read_results, write_results
from uplift.drivers.results.internal_forces import columns_of
from uplift.drivers.results.viewers import write_fields, write_film
from uplift.forms.assembly.reactions import BY_GROUP
from uplift.forms.operators import OutputGroup
from uplift.meshes.gather import WholeMesh

OPEN = "open contacts [%]"

FEW_INSTANTS = 5
"""So few values of the lifted share are printed, not drawn."""


def write_run(
    assembly: AssembledScene, analysis: Analysis, folder: Path, *, plots: bool, snapshots: Snapshots | None = None, scene_text: str = ""
) -> None:
    """Write the files of a run into `folder`, on rank 0 (collective); `scene_text` is the scene file, for the record."""
    history = analysis.final
    with assembly.clock.phase("output"):
        snapshot_data = (snapshots or Snapshots(assembly)).develop(history.peak_field)
    mesh = snapshot_data
    displacement = snapshot_data.peak[0] if snapshot_data is not None and len(snapshot_data.peak) else None
    if assembly.operators.comm.rank != 0:
        return
    say_findings(assembly, analysis)
    with all_or_nothing(folder) as staging:
        with assembly.clock.phase("output"):
            for name, columns in tables(assembly, analysis).items():
                write_history(staging / f"{name}.csv", history.times, tuple(columns), np.column_stack(list(columns.values())))
            if analysis.events is not None:
                _write_events(staging / "events.csv", analysis.events)
            if plots:
                _draw(assembly, analysis, staging, mesh, displacement)
            results = collect(assembly, analysis, snapshot_data, _summary(assembly, analysis), scene_text)
            write_results(staging / RESULTS, results)
            write_report(staging / REPORT, read_results(staging / RESULTS, own=True))
            if results.plate is not None:
                write_fields(staging, results.plate)
                if len(results.plate.rows):
                    write_film(staging / "film.xdmf", results.plate, results.times)
        write_summary(staging / "summary.json", _summary(assembly, analysis))


def tables(assembly: AssembledScene, analysis: Analysis) -> dict[str, dict[str, np.ndarray]]:
    """Return what is recorded in time: table -> column -> values (nt,) of the last pass."""
    history, contacts = analysis.final, assembly.operators.contacts
    columns = {name: history.probes[:, i] for i, name in enumerate(assembly.operators.probes.names)}
    if analysis.lifted is not None:
        columns["uplift [%]"] = analysis.lifted
    result = {"history": columns}
    if contacts.names:
        force = contacts.law.compression(contacts.law.tension(history.elongation), history.release)
        gap = history.openings(contacts.law)
        result["contacts"] = {f"{name} force [N]": force[:, i] for i, name in enumerate(contacts.names)} | {
            f"{name} gap [m]": gap[:, i] for i, name in enumerate(contacts.names)
        }
    if history.reactions.shape[1]:
        result["reactions"] = _named(assembly.operators.reactions, history.reactions)
        if contacts.names:
            lifted = history.openings(contacts.law) > 0
            result["reactions"][OPEN] = 100.0 * lifted.mean(axis=1)
        result["reactions"] |= _named(assembly.operators.outputs[BY_GROUP], history.group(BY_GROUP))
    for table, listed in columns_of(assembly.plate.forces, history).items():
        result[table] = {f"{column.name} [{column.unit}]": column.values for column in listed}
    if history.ledger is not None:
        ledger = history.ledger
        stored = {"kinetic [J]": ledger.kinetic, "strain [J]": ledger.strain, "springs [J]": ledger.springs}
        moved = {"damped [J]": ledger.damped, "work of loads [J]": ledger.work, "numerical [J]": ledger.numerical}
        result["energy"] = stored | moved
    return result


def _write_events(path: Path, events: ContactEvents) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t", "contact", "event", "speed [m/s]"])
        for time, contact, kind, speed in zip(events.times, events.contacts, events.kinds, events.speeds, strict=True):
            writer.writerow([repr(float(time)), contact, kind, repr(float(speed))])


def _named(group: OutputGroup, values: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of a group of outputs (nt, n), each with its unit."""
    return {f"{name} [{unit}]": values[:, i] for i, (name, unit) in enumerate(zip(group.names, group.units, strict=True))}


def printed_values(assembly: AssembledScene, analysis: Analysis) -> list[str]:
    """Return the lines of the table of probes at the instants that the scene asks for, pass by pass; of a static run at its only one."""
    names, passes = assembly.operators.probes.names, analysis.passes
    instants = assembly.scene.output.instants if len(analysis.final.times) > 1 else tuple(analysis.final.times)
    if not instants:
        return []
    lines = [f"{'pass':>6}{'t [s]':>10}" + "".join(f"{name + (' [rad]' if '.DR' in name else ' [m]'):>24}" for name in names)]
    if analysis.lifted is not None:
        lines[0] += f"{'lifted area [%]':>17}"
    for index, history in enumerate(passes.histories):
        last = index == len(passes.histories) - 1
        number = passes.number if last else index + 1
        if index > 0 and not last and len(passes.histories) < passes.number:
            number = passes.number - 1
        for instant in instants:
            row = int(np.argmin(np.abs(history.times - instant)))
            if abs(history.times[row] - instant) > 1e-6 * max(float(np.ptp(history.times[:2])), 1e-12):
                continue
            line = f"{'exact' if analysis.exact else number:>6}{instant:>10.4g}" + "".join(f"{v:>24.15e}" for v in history.probes[row])
            if analysis.lifted is not None and last:
                line += f"{analysis.lifted[row]:>17.4f}"
            lines.append(line)
    return lines


def _draw(assembly: AssembledScene, analysis: Analysis, folder: Path, mesh: WholeMesh | None, displacement: np.ndarray | None) -> None:
    from uplift.drivers.report import history_plots, plate_plots

    history, recorded, passes = analysis.final, tables(assembly, analysis), analysis.passes
    in_time = len(history.times) > 1
    how = "uplift exact at every step" if analysis.exact else f"{passes.number} published passes"
    title = f"{assembly.scene.title or 'Uplift'}\n{analysis.method}, {how}"
    first = passes.histories[0].probes if passes.number > 1 else None
    if in_time:
        names = assembly.operators.probes.names
        draw(history_plots.draw_history, folder / "history.png", history.times, names, history.probes, first, title)
    contacts = assembly.operators.contacts
    if "contacts" in recorded:
        n = len(contacts.names)
        columns = list(recorded["contacts"].values())
        force, gap = np.stack(columns[:n]), np.stack(columns[n:])
        if in_time:
            draw(history_plots.draw_contacts, folder / "contacts.png", history.times, contacts.names, force, gap, title)
        if np.sum(np.ptp(contacts.points, axis=0) > 0) == 2:
            row = int(np.argmax(gap.max(axis=0)))
            draw(plate_plots.draw_bed, folder / "bed.png", contacts.points, force, gap, row, f"{title}, t = {history.times[row]:g} s")
    for name, drawn in (("reactions", history_plots.draw_reactions), ("energy", history_plots.draw_energy)):
        if name in recorded and in_time:
            shown = {column: values for column, values in recorded[name].items() if "." not in column}  # not each group by itself
            draw(drawn, folder / f"{name}.png", history.times, shown, title)
    if analysis.lifted is not None and np.sum(np.isfinite(analysis.lifted)) > FEW_INSTANTS:
        draw(history_plots.draw_uplift, folder / "uplift.png", history.times, analysis.lifted, title)
    if mesh is not None and displacement is not None:
        lifted = history.openings(contacts.law)[history.peak] > 0
        if not analysis.exact:
            lifted = contacts.law.tension(history.elongation[history.peak])[: len(contacts.names)] > 0
        when = f"{title}, t = {history.times[history.peak]:g} s"
        draw(plate_plots.draw_deformed, folder / "deformed.png", mesh, displacement, contacts.points, lifted, when)


def _summary(assembly: AssembledScene, analysis: Analysis) -> dict[str, Any]:
    scene, history, passes = assembly.scene, analysis.final, analysis.passes
    extremes = {
        table: {name: _extremes(history.times, values) for name, values in columns.items()}
        for table, columns in tables(assembly, analysis).items()
    }
    return {
        "title": scene.title,
        "method": analysis.method,
        "uplift": "exact" if analysis.exact else "published passes",
        "iterations": 0 if analysis.exact else passes.number,
        "iteration_ended": passes.ended,
        "iteration_norms": {"displacement_change": passes.change, "tension_left": [] if analysis.exact else passes.pull},
        "contact_problems_per_step": analysis.tries,
        "inverse_transform_check_m": analysis.transform_check,
        "scene": scene.source,
        "dofs": assembly.operators.n,
        "mass_kg": assembly.plate.total_mass,
        "moments_about_m": assembly.plate.moments_about.tolist(),
        "contacts": len(assembly.operators.contacts.names),
        "ranks": assembly.operators.comm.size,
        **analysis.notes,
        "findings": [asdict(finding) for finding in heard_findings()],
        "extremes": extremes,
        "peak_time_s": _instant(history.times[history.peak]),
        "seconds": assembly.clock.seconds,
        "versions": versions(),
        "processor": processor(),
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def _instant(time: float) -> float:
    return round(float(time), 12)


def _extremes(times: np.ndarray, values: np.ndarray) -> dict[str, float]:
    """Return the smallest and the largest of the values and their instants in s."""
    known = np.flatnonzero(np.isfinite(values))
    if not known.size:
        return {}
    low, high = known[np.argmin(values[known])], known[np.argmax(values[known])]
    return {
        "min": float(values[low]), "t_min": _instant(times[low]), "max": float(values[high]), "t_max": _instant(times[high]),
    }
