"""Load vectors: inertia of ground motion and gravity, forces, pressure, settlement of supports."""

from __future__ import annotations

from typing import Any

import numpy as np

from uplift.forms.assembly.compiled_forms import CompiledForms
from uplift.forms.assembly.full_space import FullSpace
from uplift.forms.assembly.numbering import NodeDofs, Numbering
from uplift.forms.assembly.points import owned_nodes
from uplift.forms.contact import joint_matrices
from uplift.forms.contact.placement import Placement
from uplift.forms.contact.supports import AXES
from uplift.forms.loads.signals import Constant
from uplift.forms.operators import Load
from uplift.forms.parameters import Force, PlateModel
from uplift.forms.shells.kinematics import up_of
from uplift.meshes.checked import ModelError


class Inertia:
    """The mass of the whole model times rigid motions of the base."""

    def __init__(self, field: FullSpace, numbering: Numbering, placement: Placement, mass: Any) -> None:
        """Take the assembled mass of the whole space."""
        self._field, self._numbering, self._placement, self._mass = field, numbering, placement, mass

    def _of_field(self, motion: int, center: np.ndarray) -> np.ndarray:
        moved, force = self._mass.createVecRight(), self._mass.createVecLeft()
        moved.array[:] = self._field.rigid(motion, center)
        self._mass.mult(moved, force)
        values: np.ndarray = np.real(force.array_r).copy()
        moved.destroy()
        force.destroy()
        return values

    def vector(self, motion: int, center: np.ndarray | None = None) -> Any:
        """Return the mass times the unit rigid motion along or about an axis through `center` (PETSc vector of the system)."""
        center = np.zeros(3) if center is None else center
        vector = self._numbering.vector(self._of_field(motion, center))
        vector.array[:] += joint_matrices.inertia(self._placement, self._numbering, motion, center)
        return vector

    def total_mass(self) -> float:
        """Return the mass in kg of plate, joints and point masses, held nodes included (collective)."""
        axis = next(AXES.index(name[1:]) for name in self._field.forms.components)
        here = float(self._field.rigid(axis, np.zeros(3)) @ self._of_field(axis, np.zeros(3)))
        model = self._field.model
        points = sum(group.mass * float(group.factors.sum()) for groups in (model.supports, model.masses) for group in groups)
        return float(self._numbering.comm.allreduce(here)) + points


def load_list(
    forms: CompiledForms, field: FullSpace, numbering: Numbering, placement: Placement, inertia: Inertia, model: PlateModel
) -> list[Load]:
    """Return the loads of a model, static ones and histories in time (collective)."""
    loads = []
    if model.gravity != 0:
        vector = inertia.vector(up_of(model, forms.kind))
        vector.scale(-model.gravity)
        loads.append(Load("gravity", vector, Constant(1.0), static=True))
    for motion in model.motions:
        total = numbering.vector()
        for axis, value in enumerate(motion.direction):
            if value != 0:
                part = inertia.vector(axis, np.array(motion.center))
                total.axpy(-value, part)
                part.destroy()
        loads.append(Load("ground motion", total, motion.signal))
    for force in model.forces:
        vector = _force_vector(force, forms, numbering)
        loads.append(Load(force.name, vector, force.signal or Constant(1.0), static=force.signal is None))
    for pressure in model.pressures:
        try:
            vector = numbering.vector(field.pressure(pressure))
        except ModelError as error:
            raise ModelError(f"load[{pressure.name}].group", error.message) from None
        loads.append(Load(pressure.name, vector, pressure.signal or Constant(1.0), static=pressure.signal is None))
    if placement.settles:
        loads.append(Load("gaps and preloads", numbering.vector(), Constant(1.0), static=True, internal=True))
        loads[-1].vector.array[:] = joint_matrices.settlement_load(placement, numbering)
    return loads


def _force_vector(force: Force, forms: CompiledForms, numbering: Numbering) -> Any:
    try:
        nodes = owned_nodes(forms.space, np.asarray(force.points, dtype=float).reshape(-1, 3), force.name)
    except ModelError as error:
        raise ModelError(f"load[{force.name}].points", error.message) from None
    dofs = NodeDofs(forms.components)
    for axis in np.flatnonzero(force.components):
        if axis not in dofs.column:
            raise ModelError(f"load[{force.name}].force", f"the kinematics {forms.kind!r} has nothing along {AXES[axis]}")
    values = np.zeros(numbering.n_field)
    for node, share in zip(nodes, force.factors, strict=True):
        for axis, value in enumerate(force.components):
            if node >= 0 and value != 0:
                values[dofs.dof(int(node), axis)] += share * value
    return numbering.vector(values)
