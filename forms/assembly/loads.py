"""Load vectors: inertia of ground motion and gravity, forces, pressure, settlement of supports."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.forms.assembly.compiled_forms import CompiledForms
from uplift.forms.assembly.full_space import FullSpace
from uplift.forms.assembly.numbering import NodeDofs, Numbering
from uplift.forms.assembly.points import owned_nodes
from uplift.forms.contact import joint_matrices
from uplift.forms.contact.placement import Placement
from uplift.forms.contact.supports import AXES
from uplift.forms.loads.signals import Constant, Signal
from uplift.forms.operators import Load
from uplift.forms.parameters import Force, Pressure
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
        on_field, on_joints = self.parts(motion, np.zeros(3) if center is None else center)
        vector = self._numbering.vector(on_field)
        vector.array[:] += on_joints
        return vector

    def parts(self, motion: int, center: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the same on the dofs of the space, held ones included (n_field,), and of masses on free rows (n_local,)."""
        placed = self._placement, self._numbering, motion, center
        return self._of_field(motion, center) + joint_matrices.held_inertia(*placed), joint_matrices.inertia(*placed)

    def total_mass(self) -> float:
        """Return the mass in kg of plate, joints and point masses, held nodes included (collective)."""
        axis = next(AXES.index(name[1:]) for name in self._field.compiled.components)
        here = float(self._field.rigid(axis, np.zeros(3)) @ self._of_field(axis, np.zeros(3)))
        model = self._field.model
        points = sum(group.mass * float(group.factors.sum()) for groups in (model.supports, model.masses) for group in groups)
        return float(self._numbering.comm.allreduce(here)) + points


@dataclass(frozen=True)
class _Acting:
    """A load on the dofs of the space (n_field,) and on this rank's rows of joints alone (n_local,)."""

    name: str
    on_field: np.ndarray
    signal: Signal | None
    """None: static."""
    on_joints: np.ndarray | float = 0.0
    internal: bool = False


def load_list(field: FullSpace, numbering: Numbering, placement: Placement, inertia: Inertia) -> tuple[list[Load], np.ndarray]:
    """Return the loads of a model, static ones and histories in time, and what of each acts on held dofs, (n_loads, n_field) (collective).

    Raises `ModelError` for what fits no node or group.
    """
    model, loads = field.model, []
    acting = _inertial(field, inertia)
    acting += [_Acting(force.name, _force(force, field.compiled, numbering), force.signal) for force in model.forces]
    acting += [_Acting(pressure.name, _pressure(pressure, field), pressure.signal) for pressure in model.pressures]
    if placement.settles:
        settlement = joint_matrices.settlement_load(placement, numbering)
        acting.append(_Acting("gaps and preloads", np.zeros(numbering.n_field), None, settlement, internal=True))
    for load in acting:
        vector = numbering.vector(load.on_field)
        vector.array[:] += load.on_joints
        loads.append(Load(load.name, vector, load.signal or Constant(1.0), static=load.signal is None, internal=load.internal))
    held = numbering.local_row < 0
    on_held = np.array([np.where(held, np.real(load.on_field), 0.0) for load in acting]).reshape(len(acting), numbering.n_field)
    return loads, on_held


def _inertial(field: FullSpace, inertia: Inertia) -> list[_Acting]:
    model, found = field.model, []
    if model.gravity != 0:
        up = up_of(model, field.compiled.kind)
        on_field, on_joints = inertia.parts(up, np.zeros(3))
        found.append(_Acting("gravity", -model.gravity * on_field, None, -model.gravity * on_joints))
    for motion in model.motions:
        parts = [
            (-motion.direction[axis] * on_field, -motion.direction[axis] * on_joints)
            for axis in np.flatnonzero(motion.direction)
            for on_field, on_joints in [inertia.parts(int(axis), np.array(motion.center))]
        ]
        on_field, on_joints = (np.sum(part, axis=0) for part in zip(*parts, strict=True))
        found.append(_Acting("ground motion", on_field, motion.signal, on_joints))
    return found


def _pressure(pressure: Pressure, field: FullSpace) -> np.ndarray:
    try:
        return field.pressure(pressure)
    except ModelError as error:
        raise ModelError(f"load[{pressure.name}].group", error.message) from None


def _force(force: Force, compiled: CompiledForms, numbering: Numbering) -> np.ndarray:
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
    return values
