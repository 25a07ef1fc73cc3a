"""The files that a run leaves: histories, summary, pictures and the deformed plate."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from drivers.analysis import Analysis, Plant
from drivers.output import all_or_nothing, versions, write_history, write_summary
from meshes.gather import WholeMesh, gather_mesh, gather_nodal


def write_run(plant: Plant, analysis: Analysis, folder: Path, *, plots: bool) -> None:
    """Write the files of a run into `folder`, on rank 0 (collective)."""
    history = analysis.final
    mesh, displacement = None, None
    with plant.clock.phase("output"):
        if history.peak_field is not None:
            mesh = gather_mesh(plant.tagged)
            nodal = plant.assembled.displacement(history.peak_field)
            displacement = gather_nodal(plant.tagged, plant.assembled.space, nodal)
    if plant.operators.comm.rank != 0:
        return
    names = plant.operators.probes.names
    title = f"{plant.scene.title or 'Uplift'}\n{analysis.method}, {len(analysis.passes.histories)} passes"
    with all_or_nothing(folder) as staging:
        with plant.clock.phase("output"):
            write_history(staging / "history.csv", history.times, names, history.probes)
            if mesh is not None and displacement is not None:
                _write_deformed(staging / "deformed.vtu", mesh, displacement)
            if plots:
                _draw(plant, analysis, staging, mesh, displacement, title)
        write_summary(staging / "summary.json", _summary(plant, analysis))


def _draw(
    plant: Plant, analysis: Analysis, folder: Path, mesh: WholeMesh | None, displacement: np.ndarray | None, title: str
) -> None:
    from drivers import plots

    history = analysis.final
    names = plant.operators.probes.names
    plots.draw_history(folder / "history.png", history.times, names, [h.probes for h in analysis.passes.histories], title)
    if mesh is not None and displacement is not None:
        contacts = plant.operators.contacts
        lifted = contacts.law.tension(history.elongation[history.peak]) > 0
        when = f"{title}, t = {history.times[history.peak]:g} s"
        plots.draw_deformed(folder / "deformed.png", mesh, displacement, contacts.points, lifted, when)


def _write_deformed(path: Path, mesh: WholeMesh, displacement: np.ndarray) -> None:
    """Write the plate with its displacement (n, 2) m as a vector field, which ParaView warps."""
    import meshio

    vector = np.column_stack([displacement, np.zeros(len(displacement))])
    meshio.Mesh(mesh.points, [(mesh.cell_type, mesh.cells)], point_data={"displacement [m]": vector}).write(path)


def _summary(plant: Plant, analysis: Analysis) -> dict[str, Any]:
    scene, history, names = plant.scene, analysis.final, plant.operators.probes.names
    extremes = {}
    for column, name in enumerate(names):
        values = history.probes[:, column]
        low, high = int(np.argmin(values)), int(np.argmax(values))
        extremes[name] = {
            "min": float(values[low]), "t_min": float(history.times[low]),
            "max": float(values[high]), "t_max": float(history.times[high]), "unit": "m",
        }
    return {
        "title": scene.title,
        "method": analysis.method,
        "iterations": len(analysis.passes.histories),
        "scene": scene.source,
        "dofs": plant.operators.n,
        "mass_kg": plant.assembled.total_mass,
        "contacts": len(plant.operators.contacts.names),
        "ranks": plant.operators.comm.size,
        "iteration_norms": {"displacement_change": analysis.passes.change, "tension_left": analysis.passes.pull},
        "inverse_transform_check_m": analysis.transform_check,
        "extremes": extremes,
        "peak_time_s": float(history.times[history.peak]),
        "seconds": plant.clock.seconds,
        "versions": versions(),
    }
