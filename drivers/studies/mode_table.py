"""The command `modes`: table, pictures and a ParaView file of the modes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.analysis.modes import ModeTable, Wanted, find_modes
from uplift.drivers.report.pictures import draw
from uplift.drivers.results.folder import all_or_nothing, versions, write_columns, write_summary
from uplift.meshes.gather import WholeMesh, gather_mesh, gather_nodal
from uplift.solvers.bases.modes import Modes, effective_masses

DRAWN = 6
"""Modes in the picture at most."""


def tabulate_modes(assembly: AssembledScene, wanted: Wanted, folder: Path, *, plots: bool) -> list[str]:
    """Find the modes, write their files into `folder` on rank 0, and return the lines to print (collective)."""
    with assembly.clock.phase("modes"):
        found = find_modes(assembly, wanted)
        rigid = assembly.plate.translations
        table = ModeTable(found, effective_masses(found, list(rigid.values())), tuple(rigid), assembly.plate.total_mass)
    with assembly.clock.phase("output"):
        mesh, shapes = _gathered_shapes(assembly, found)
        if mesh is not None and shapes is not None:
            with all_or_nothing(folder) as staging:
                write_columns(staging / "modes.csv", table.columns())
                write_summary(staging / "summary.json", _summary(assembly, table))
                _write_shapes(staging / "modes.vtu", mesh, table.labels(), shapes)
                if plots:
                    _draw(staging / "modes.png", assembly, mesh, table.labels(), shapes)
    title = f"{assembly.scene.title or 'Uplift'}: {assembly.operators.n} dofs, {table.total:,.1f} kg, every contact bonded"
    return [title, "", *table.lines(), "", table.count(), table.orthonormality()]


def _gathered_shapes(assembly: AssembledScene, found: Modes) -> tuple[WholeMesh | None, np.ndarray | None]:
    """Return on rank 0 the mesh and the shapes (n_modes, n_nodes, components), largest displacement 1 (collective)."""
    mesh = gather_mesh(assembly.tagged)
    nodal = [assembly.plate.displacement(vector) for vector in found.basis.vectors.T]
    together = gather_nodal(assembly.tagged, assembly.plate.space, np.hstack(nodal))
    if together is None:
        return None, None
    shapes = together.reshape(len(together), found.number, -1).transpose(1, 0, 2)
    largest = np.linalg.norm(shapes, axis=2).max(axis=1)
    return mesh, shapes / np.where(largest > 0, largest, 1.0)[:, None, None]


def _write_shapes(path: Path, mesh: WholeMesh, labels: list[str], shapes: np.ndarray) -> None:
    """Write each shape as a vector field, which ParaView warps."""
    import meshio

    meshio.Mesh(mesh.points, [(mesh.cell_type, mesh.cells)], point_data=dict(zip(labels, shapes, strict=True))).write(path)


def _draw(path: Path, assembly: AssembledScene, mesh: WholeMesh, labels: list[str], shapes: np.ndarray) -> None:
    from uplift.drivers.report.plate_plots import draw_modes

    model = assembly.plate.model
    held = {
        "support": np.array([p for support in model.supports for p in support.points]).reshape(-1, 3),
        "plain spring": np.array([p for spring in model.springs for p in spring.points]).reshape(-1, 3),
    }
    title = f"{assembly.scene.title or 'Uplift'}\nfirst {min(DRAWN, len(labels))} of {len(labels)} modes, every contact bonded"
    draw(draw_modes, path, mesh, labels[:DRAWN], shapes[:DRAWN], held, title)


def _summary(assembly: AssembledScene, table: ModeTable) -> dict[str, Any]:
    found = table.found
    return {
        "title": assembly.scene.title,
        "scene": assembly.scene.source,
        "dofs": assembly.operators.n,
        "mass_kg": table.total,
        "ranks": assembly.operators.comm.size,
        "modes": found.number,
        "rigid_body_modes": found.rigid,
        "first_mode": int(table.numbers[0]),
        "frequencies_Hz": found.frequencies.tolist(),
        "damping_ratios": found.damping.tolist(),
        "effective_masses_kg": {axis: table.masses[:, i].tolist() for i, axis in enumerate(table.axes)},
        "sum_of_effective_masses": {axis: float(table.masses[:, i].sum() / table.total) for i, axis in enumerate(table.axes)},
        "sturm_count": {
            "lower_rad2_s2": found.sturm.lower, "upper_rad2_s2": found.sturm.upper,
            "below_lower": found.sturm.below_lower, "below_upper": found.sturm.below_upper, "inside": found.sturm.inside,
        },
        "shift_rad2_s2": found.shift,
        "largest_residual": float(found.residuals.max()),
        "orthonormality": found.orthonormality,
        "seconds": assembly.clock.seconds,
        "versions": versions(),
    }
