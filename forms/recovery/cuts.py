"""Resultants of the forces across a cut, as outputs of a model: from the nodal forces of the cells beyond it.

F = -sum over the nodes of the line of R^T (K_rest u): what the cells of the rest exert on the side. R are the rigid motions about the
point of the cut, by whose virtual work forces and moments come at once; K_rest is the stiffness of the cells beyond alone. With the share
of damping, alpha K_rest u', the side with all nodes of the line is in equilibrium with its nodal loads, inertia and springs to round-off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from uplift.forms.assembly.full_space import FullSpace
from uplift.forms.assembly.nodes import nodes_of, to_owners
from uplift.forms.assembly.numbering import Numbering
from uplift.forms.operators import OutputGroup
from uplift.forms.parameters import Cut, PlateModel
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import dof_cells, geometry_cells
from uplift.meshes.groups import groups_in_words

GROUP, DAMPING = "cuts", "cuts damping"
"""Names of the groups of outputs."""

RESULTANTS = (("FX", "N"), ("FY", "N"), ("FZ", "N"), ("MX", "N m"), ("MY", "N m"), ("MZ", "N m"))

CLOSED = 1e-6
"""Length of the sum of the normals along a line as a part of its own, below which the line has no normal: it closes."""


@dataclass(frozen=True)
class CutOutputs:
    """The outputs of all cuts of a model."""

    groups: tuple[OutputGroup, ...]
    """The elastic resultants and, where the plate is damped, the share of damping."""
    normals: dict[str, np.ndarray | None]
    """Unit normal (3,) of each cut, out of its side; None for a line that has none."""


def cut_outputs(field: FullSpace, numbering: Numbering, model: PlateModel) -> CutOutputs:
    """Return the resultants at the cuts of the model (collective). Raises `ModelError` for a cut that no cell lies on both sides of."""
    names = tuple(f"{cut.name}.{name}" for cut in model.cuts for name, _ in RESULTANTS)
    units = tuple(unit for _ in model.cuts for _, unit in RESULTANTS)
    elastic, damping, normals = [], [], {}
    alphas = {material.alpha for material in field.materials}
    for cut in model.cuts:
        try:
            found = _Line(field, cut)
        except ModelError as error:
            raise ModelError(f"cuts[{cut.name}].{error.key or 'group'}", error.message) from None
        normals[cut.name] = found.normal
        rows = found.rows(numbering)
        elastic.append(rows)
        if len(alphas) == 1:
            damping.append(min(alphas) * rows)
        else:
            damping.append(found.rows(numbering, damped=True))
    whole = sparse.vstack(elastic, format="csr")
    groups = [OutputGroup(GROUP, names, units, whole)]
    if max(alphas) > 0:
        nothing = sparse.csr_matrix(whole.shape)
        damped = tuple(f"{name} damping" for name in names)
        groups.append(OutputGroup(DAMPING, damped, units, nothing, per_velocity=sparse.vstack(damping, format="csr")))
    return CutOutputs(tuple(groups), normals)


class _Line:
    """The nodes of a cut and the cells on its two sides."""

    def __init__(self, field: FullSpace, cut: Cut) -> None:
        """Find them (collective). Raises `ModelError` where one side has no cells at the line."""
        self._field, self._cut = field, cut
        tagged, compiled = field.tagged, field.compiled
        self._owned = tagged.mesh.topology.index_map(2).size_local
        self._side, self._rest = self._sides()
        space = compiled.space
        of_cells = dof_cells(space)[: self._owned]
        at_side, at_rest = (to_owners(space, _marked(of_cells[cells], len(space.tabulate_dof_coordinates()))) > 0
                            for cells in (self._side, self._rest))
        line = at_side & at_rest
        if cut.group:
            on_group = np.zeros(len(line), dtype=bool)
            on_group[nodes_of(tagged, space, cut.group)] = True
            line &= on_group
        comm = tagged.mesh.comm
        if not comm.allreduce(int(line.sum())):
            where = "side" if cut.group else "plane"
            raise ModelError(where, "expected cells on both sides of the cut, which share its nodes")
        self._line = line
        self.normal = self._normal()

    def _sides(self) -> tuple[np.ndarray, np.ndarray]:
        """Return which of this rank's own cells (n_owned,) are on the side and which beyond."""
        tagged, cut = self._field.tagged, self._cut
        limited = np.ones(self._owned, dtype=bool)
        if cut.side:
            try:
                cells = tagged.cells(cut.side)
            except ModelError as error:
                raise ModelError("side", error.message) from None
            limited[:] = False
            limited[cells[cells < self._owned]] = True
        if cut.plane is None:
            if tagged.dimension(cut.group) != 1:
                raise ModelError("group", f"expected an edge group, {groups_in_words(cut.group)} is none")
            return limited, ~limited
        middles = tagged.mesh.geometry.x[geometry_cells(tagged.mesh)[: self._owned]].mean(axis=1)
        behind = (middles - np.array(cut.plane.point)) @ np.array(cut.plane.normal) < 0
        return limited & behind, limited & ~behind

    def rows(self, numbering: Numbering, *, damped: bool = False) -> sparse.csr_matrix:
        """Return the weights (6, n_local) of the resultants on the displacement, or on the velocity for damping stresses (collective)."""
        field, block = self._field, len(self._field.compiled.components)
        field.set_material(**({"young": lambda m: m.alpha} if damped else {}))
        young = field.compiled.material.young.x.array
        young[: self._owned] *= self._rest
        stiffness = field.matrix(field.compiled.stiffness)
        moved, force = stiffness.createVecRight(), stiffness.createVecLeft()
        free = numbering.local_row >= 0
        rows = np.zeros((len(RESULTANTS), numbering.n_local))
        for motion in range(len(RESULTANTS)):
            moved.array[:] = field.rigid(motion, np.array(self._cut.point)) * np.repeat(self._line, block)
            stiffness.mult(moved, force)
            rows[motion, numbering.local_row[free]] = -np.real(force.array_r)[free]
        for thing in (stiffness, moved, force):
            thing.destroy()
        return sparse.csr_matrix(rows)

    def _normal(self) -> np.ndarray | None:
        """Return the unit normal out of the side: of the plane, or the mean along the line of the cells' own (collective)."""
        tagged, cut = self._field.tagged, self._cut
        if cut.plane is not None:
            normal: np.ndarray = np.array(cut.plane.normal) / np.linalg.norm(cut.plane.normal)
            return normal
        x, cells = tagged.mesh.geometry.x, geometry_cells(tagged.mesh)
        total = np.zeros(4)
        for cell, ends in tagged.cell_sides(cut.group):
            if self._side[cell]:
                a, b = x[cells[cell, ends[0]]], x[cells[cell, ends[1]]]
                along = (b - a) / np.linalg.norm(b - a)
                out = (a + b) / 2 - x[cells[cell]].mean(axis=0)
                out -= (out @ along) * along
                total += np.append(out / np.linalg.norm(out), 1.0) * np.linalg.norm(b - a)
        total = tagged.mesh.comm.allreduce(total)
        size = float(np.linalg.norm(total[:3]))
        return total[:3] / size if size > CLOSED * total[3] else None


def _marked(nodes: np.ndarray, n: int) -> np.ndarray:
    """Return 1 at some of n nodes, else 0."""
    marks = np.zeros(n)
    marks[nodes.ravel()] = 1.0
    return marks
