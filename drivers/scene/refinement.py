"""Finer meshes: by a factor, or to a number of dofs."""

from __future__ import annotations

from dataclasses import replace
from math import ceil

from uplift.forms.assembly.level import shifted
from uplift.forms.parameters import PlateModel
from uplift.forms.shells.kinematics import AXES_OF, Kinematics, choose, degree_of
from uplift.meshes.checked import ModelError
from uplift.meshes.imported import MeshFile
from uplift.meshes.panels import Panels
from uplift.meshes.plate import Plate
from uplift.meshes.sources import MeshSource

BYTES_A_CELL = 40.0
"""Of a mesh file in text, cells and nodes together; a binary one holds more cells, so its mesh is taken for smaller than it is."""


def finer(mesh: MeshSource, factor: int) -> MeshSource:
    """Return the mesh with cells shorter by `factor`. Raises `ModelError` for a mesh from a file."""
    if isinstance(mesh, MeshFile):
        raise ModelError("mesh.file", "expected a mesh that the program makes: one from a file cannot be refined")
    if isinstance(mesh, Panels):
        return replace(mesh, size=mesh.size / factor)
    return replace(mesh, nx=mesh.nx * factor, ny=mesh.ny * factor)


def kinematics_of(mesh: MeshSource, stated: Kinematics, model: PlateModel) -> tuple[str, str, int]:
    """Return the kind of kinematics, the shape of the cells and the degree that the mesh will have.

    A file, which is not read here, is of the kind that is stated, else taken for a folded shell.
    """
    if isinstance(mesh, MeshFile):
        return stated.kind or "shell", "quadrilateral", degree_of(stated.kind or "shell", mesh.degree, "quadrilateral")
    cell, level = mesh.cell, mesh.level if isinstance(mesh, Panels) else 0.0
    kind = choose(stated, shifted(model, -level), isinstance(mesh, Plate) or mesh.flat)
    return kind, cell, degree_of(kind, mesh.degree, cell)


def expected_dofs(mesh: MeshSource, stated: Kinematics, model: PlateModel) -> int:
    """Return the dofs of the nodes: exact for a rectangle, near enough for joined plates, a guess by its size for a file."""
    kind, _, degree = kinematics_of(mesh, stated, model)
    if isinstance(mesh, Plate):
        nodes = float((mesh.nx * degree + 1) * (mesh.ny * degree + 1))
    else:
        cells = mesh.path.stat().st_size / BYTES_A_CELL if isinstance(mesh, MeshFile) else mesh.cells
        nodes = cells * degree**2 + 2 * cells**0.5 * degree + 1
    return int(len(AXES_OF[kind]) * nodes)


def finer_to(mesh: MeshSource, stated: Kinematics, model: PlateModel, dofs: int) -> MeshSource:
    """Return the mesh refined by the least whole factor that gives at least so many dofs."""
    factor = max(1, ceil((dofs / expected_dofs(finer(mesh, 1), stated, model)) ** 0.5))
    while expected_dofs(finer(mesh, factor), stated, model) < dofs:  # the nodes of the last edges do not grow with the square
        factor += 1
    while factor > 1 and expected_dofs(finer(mesh, factor - 1), stated, model) >= dofs:
        factor -= 1
    return finer(mesh, factor)
