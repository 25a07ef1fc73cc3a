"""Section forces all over a plate, at the best points of its cells, as sparse rows on the displacements that a rank knows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import dolfinx.fem
import numpy as np
from scipy import sparse

from uplift.forms.assembly.full_space import FullSpace
from uplift.forms.assembly.numbering import Numbering
from uplift.forms.recovery.axes_of_parts import AxesOfParts
from uplift.forms.recovery.section_forces import UNITS, SectionForces
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import dof_cells

CELLS_AT_ONCE = 256
"""Rows of so many cells are made at once, which takes some ten megabytes."""


@dataclass(frozen=True)
class ForceField:
    """The section forces at all places of the cells that a rank owns."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    places: np.ndarray
    """(n_places, 3) m: the best points of this rank's cells."""
    rows: sparse.csr_matrix
    """(n_places * n_components, n_known): weights on the owned and ghost dofs of the space; components of a place stand together."""
    space: Any
    numbering: Numbering

    def known(self, values: np.ndarray) -> np.ndarray:
        """Return the owned and ghost dofs (n_known,) from this rank's part (n_local,) of a solution (collective)."""
        function = dolfinx.fem.Function(self.space)
        function.x.array[: self.numbering.n_field] = self.numbering.field(values)
        function.x.scatter_forward()
        return np.real(function.x.array).copy()


def force_field(field: FullSpace, numbering: Numbering) -> ForceField:
    """Return the section forces all over the plate (collective). Raises `ModelError` where axes have no direction."""
    field.set_material()
    compiled = field.compiled
    sections, axes = SectionForces(compiled), AxesOfParts(compiled, field.model)
    owned = compiled.tagged.mesh.topology.index_map(2).size_local
    part_of = np.full(owned, -1)
    for number, part in enumerate(axes.parts):
        cells = field.tagged.cells(part)
        part_of[cells[cells < owned]] = number
    directions = {-1: axes.of(None), **{number: axes.of(part) for number, part in enumerate(axes.parts)}}
    places, first = np.empty((owned, len(sections.points), 3)), np.empty((owned, len(sections.points), 3))
    for number, direction in directions.items():
        cells = np.flatnonzero(part_of == number)
        places[cells] = sections.positions(cells)
        try:
            first[cells] = direction.at(places[cells], sections.normals(cells))
        except ModelError as error:
            raise ModelError("plate.axes" if number < 0 else f"parts[{axes.parts[number]}].axes", error.message) from None
    blocks = [
        _rows(field, sections, cells, first[cells])
        for cells in np.split(np.arange(owned), range(CELLS_AT_ONCE, owned, CELLS_AT_ONCE)) if len(cells)
    ]
    n_known = len(compiled.space.tabulate_dof_coordinates()) * len(compiled.components)
    rows = sparse.vstack(blocks, format="csr") if blocks else sparse.csr_matrix((0, n_known))
    units = tuple(UNITS[name[0]] for name in sections.names)
    return ForceField(sections.names, units, places.reshape(-1, 3), rows, compiled.space, numbering)


def _rows(field: FullSpace, sections: SectionForces, cells: np.ndarray, first: np.ndarray) -> sparse.csr_matrix:
    """Return the rows of some cells, whose axis 1 is `first` (n_cells, n_points, 3)."""
    space, block = field.compiled.space, len(field.compiled.components)
    values = sections.rows(cells, first, sections.normals(cells))
    dofs = dof_cells(space)[cells][:, :, None] * block + np.arange(block)
    n_rows = int(np.prod(values.shape[:3]))
    columns = np.broadcast_to(dofs[:, None, None], values.shape).reshape(n_rows, -1)
    flat = values.reshape(n_rows, -1)
    at, among = np.nonzero(flat)
    n_known = len(space.tabulate_dof_coordinates()) * block
    return sparse.csr_matrix((flat[at, among], (at, columns[at, among])), shape=(n_rows, n_known))
