"""Load vectors: inertia of ground motion and gravity, forces, pressure, settlement of supports."""

from __future__ import annotations

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
from uplift.forms.parameters import Force, GroundMotion, Pressure
from uplift.forms.shells.kinematics import up_of
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import Mat, Vec


class Inertia:
    """The mass of the whole model times rigid motions of the base."""

    def __init__(self, field: FullSpace, numbering: Numbering, placement: Placement, mass: Mat) -> None:
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

    def vector(self, motion: int, center: np.ndarray | None = None) -> Vec:
        """Return the mass times the unit rigid motion along or about an axis through `center` (PETSc vector of the system)."""
        center = np.zeros(3) if center is None else center
        vector = self._numbering.vector(self._of_field(motion, center))
        vector.array[:] += joint_matrices.inertia(self._placement, self._numbering, motion, center)
        return vector

    def total_mass(self) -> float:
        """Return the mass in kg of plate, joints and point masses, held nodes included (collective)."""
        axis = next(AXES.index(name[1:]) for name in self._field.compiled.components)
        here = float(self._field.rigid(axis, np.zeros(3)) @ self._of_field(axis, np.zeros(3)))
        model = self._field.model
        points = sum(group.mass * float(group.factors.sum()) for groups in (model.supports, model.masses) for group in groups)
        return float(self._numbering.comm.allreduce(here)) + points


def load_list(field: FullSpace, numbering: Numbering, placement: Placement, inertia: Inertia) -> list[Load]:
    """Return the loads of a model, static ones and histories in time (collective). Raises `ModelError` for what fits no node or group."""
    model = field.model
    loads = []
    if model.gravity != 0:
        vector = inertia.vector(up_of(model, field.compiled.kind))
        vector.scale(-model.gravity)
        loads.append(Load("gravity", vector, Constant(1.0), static=True))
    loads += [Load("ground motion", _motion_vector(motion, numbering, inertia), motion.signal) for motion in model.motions]
    acting: list[tuple[Force | Pressure, Vec]] = [(force, _force_vector(force, field.compiled, numbering)) for force in model.forces]
    acting += [(pressure, _pressure_vector(pressure, field, numbering)) for pressure in model.pressures]
    for load, vector in acting:
        loads.append(Load(load.name, vector, load.signal or Constant(1.0), static=load.signal is None))
    if placement.settles:
        vector = numbering.vector()
        vector.array[:] = joint_matrices.settlement_load(placement, numbering)
        loads.append(Load("gaps and preloads", vector, Constant(1.0), static=True, internal=True))
    return loads


def _motion_vector(motion: GroundMotion, numbering: Numbering, inertia: Inertia) -> Vec:
    total = numbering.vector()
    for axis in np.flatnonzero(motion.direction):
        part = inertia.vector(int(axis), np.array(motion.center))
        total.axpy(-motion.direction[axis], part)
        part.destroy()
    return total


def _pressure_vector(pressure: Pressure, field: FullSpace, numbering: Numbering) -> Vec:
    try:
        return numbering.vector(field.pressure(pressure))
    except ModelError as error:
        raise ModelError(f"load[{pressure.name}].group", error.message) from None


def _force_vector(force: Force, compiled: CompiledForms, numbering: Numbering) -> Vec:
    try:
        nodes = owned_nodes(compiled.space, np.asarray(force.points, dtype=float).reshape(-1, 3), force.name)
    except ModelError as error:
        raise ModelError(f"load[{force.name}].points", error.message) from None
    dofs = NodeDofs(compiled.components)
    for axis in np.flatnonzero(force.components):
        if axis not in dofs.column:
            raise ModelError(f"load[{force.name}].force", f"the kinematics {compiled.kind!r} has nothing along {AXES[axis]}")
    values = np.zeros(numbering.n_field)
    for node, tributary in zip(nodes, force.factors, strict=True):
        for axis in np.flatnonzero(force.components) if node >= 0 else ():
            values[dofs.dof(int(node), axis)] += tributary * force.components[axis]
    return numbering.vector(values)
