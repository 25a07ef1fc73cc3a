"""Section forces at probes, as outputs of a model: recovered from the cells around each by a polynomial fitted to their best points."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from uplift.forms.assembly.compiled_forms import CompiledForms
from uplift.forms.assembly.full_space import FullSpace
from uplift.forms.assembly.numbering import Numbering
from uplift.forms.operators import OutputGroup
from uplift.forms.parameters import PlateModel, Probe
from uplift.forms.recovery.axes_of_parts import AxesOfParts
from uplift.forms.recovery.fit import weights_at
from uplift.forms.recovery.patches import Patch, patch_at
from uplift.forms.recovery.section_forces import UNITS, SectionForces
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import dof_cells

GROUP = "forces"
"""Name of the group of outputs."""


def probe_forces(field: FullSpace, numbering: Numbering, model: PlateModel) -> tuple[OutputGroup, dict[str, float]]:
    """Return the section forces at the probes that ask for them, named PROBE.N11 and so on, and the thickness in m there (collective).

    Their error at a point decreases with the square of the cells' size at least. Raises `ModelError` where plates meet at a probe that does
    not name its part, and where the axes have no direction.
    """
    field.set_material()
    compiled = field.compiled
    sections, axes = SectionForces(compiled), AxesOfParts(compiled, model)
    names: list[str] = []
    units: list[str] = []
    rows, thickness = [], {}
    for probe in model.probes:
        if not probe.forces:
            continue
        try:
            patch = patch_at(compiled, np.asarray(probe.point), probe.part, f"probe {probe.name}", axes.parts)
            rows.append(_rows_of(probe, patch, sections, axes, numbering))
        except ModelError as error:
            raise ModelError(f"probes[{probe.name}].{error.key}", error.message) from None
        thickness[probe.name] = patch.thickness
        names += [f"{probe.name}.{name}" for name in sections.names]
        units += [UNITS[name[0]] for name in sections.names]
    return OutputGroup(GROUP, tuple(names), tuple(units), sparse.vstack(rows, format="csr")), thickness


def _rows_of(probe: Probe, patch: Patch, sections: SectionForces, axes: AxesOfParts, numbering: Numbering) -> sparse.csr_matrix:
    """Return the section forces at a probe, (n_components, n_local) (collective)."""
    point, compiled, comm = np.asarray(probe.point), sections.compiled, numbering.comm
    directions = axes.of(patch.part)
    directions.at(point, patch.normal)  # refuses a point without axes, around which its neighbours have some
    mine = np.flatnonzero(patch.rank == comm.rank)
    cells = patch.cell[mine]
    positions, normals = sections.positions(cells), sections.normals(cells)
    normals = normals * np.sign(normals @ patch.normal)[..., None]
    weights = _weights(patch, mine, positions - point, compiled, comm)
    values = sections.rows(cells, directions.at(positions, normals), normals)
    summed = np.einsum("cq,cqink->cink", weights, values)
    return _scattered(summed, cells, compiled, numbering)


def _weights(patch: Patch, mine: np.ndarray, away: np.ndarray, compiled: CompiledForms, comm: Any) -> np.ndarray:
    """Return the weights (n_cells, n_points) of this rank's points, `away` (n_cells, n_points, 3) m from the probe.

    They are fitted to the points of all ranks (collective).
    """
    whole = np.empty((len(patch.cell), *away.shape[1:]))
    for numbers, there in comm.allgather((mine, away)):
        whole[numbers] = there
    plane = np.stack([patch.along, np.cross(patch.normal, patch.along)])
    triangle = compiled.tagged.mesh.topology.cell_name() == "triangle"
    degree = max(compiled.degree - 1, 1) if triangle else compiled.degree
    found = weights_at((whole @ plane.T).reshape(-1, 2), degree, in_each=not triangle).reshape(whole.shape[:2])
    chosen: np.ndarray = found[mine]
    return chosen


def _scattered(values: np.ndarray, cells: np.ndarray, compiled: CompiledForms, numbering: Numbering) -> sparse.csr_matrix:
    """Return weights (n_cells, n_rows, n_nodes, n_block) on dofs of this rank's cells as rows of the system (collective).

    The dofs of a cell may belong to other ranks: each takes its own.
    """
    index_map, block = compiled.space.dofmap.index_map, len(compiled.components)
    nodes = dof_cells(compiled.space)[cells]
    dofs = np.asarray(index_map.local_to_global(nodes.ravel().astype(np.int32))).reshape(nodes.shape)[:, :, None] * block + np.arange(block)
    n_rows = values.shape[1]
    rows = np.broadcast_to(np.arange(n_rows)[None, :, None, None], values.shape)
    columns = np.broadcast_to(dofs[:, None], values.shape)
    first, last = (end * block for end in index_map.local_range)
    total = sparse.coo_matrix((n_rows, numbering.n_local)).tocsr()
    for row, column, value in numbering.comm.allgather((rows.ravel(), columns.ravel(), values.ravel())):
        here = (column >= first) & (column < last) & (value != 0)
        local = numbering.local_row[column[here] - first]
        free = local >= 0
        total += sparse.coo_matrix((value[here][free], (row[here][free], local[free])), shape=total.shape).tocsr()
    return total
