"""From the motion of the plate to that of all dofs of a model: its joints, its contacts, the coordinates of a basis."""

from __future__ import annotations

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.analysis.task import Task
from uplift.forms.operators import Operators
from uplift.meshes.compat import Vec
from uplift.solvers.bases.basis import apply, inner
from uplift.solvers.contact.auxiliary_nodes import AuxiliaryNodes
from uplift.solvers.contact.memory import ContactMemory
from uplift.solvers.dense import solve_definite
from uplift.solvers.time_domain.state import tensions


def with_joints(assembly: AssembledScene, field: np.ndarray, acting: np.ndarray | float) -> np.ndarray:
    """Return displacements of all dofs (n_local,) m from those of the plate, `field` (n_field,) m (collective).

    The joints' own dofs are in equilibrium between their springs and what is `acting` on them, (n_extra,) N. Velocities follow likewise.
    """
    operators, numbering = assembly.operators, assembly.plate.numbering
    own = slice(numbering.n_free, None)
    vector, work, diagonal = numbering.vector(field), operators.new_vector(), operators.stiffness.getDiagonal()
    operators.stiffness.mult(vector, work)
    vector.array[own] = (acting - work.array_r[own]) / diagonal.array_r[own]
    values: np.ndarray = np.real(vector.array_r).copy()
    for thing in (vector, work, diagonal):
        thing.destroy()
    return values


def open_contacts(operators: Operators, displacement: Vec, memory: ContactMemory) -> ContactMemory:
    """Return the contacts under a displacement of all dofs, open where they would pull (collective)."""
    law, tension = operators.contacts.law, tensions(operators, displacement)
    return ContactMemory(np.where((tension > 0)[law.owner], tension, 0.0), memory.inner)


def nodes_at_rest(operators: Operators, velocity: Vec, memory: ContactMemory, step: float) -> ContactMemory:
    """Return the contacts with the heavy nodes below open ones at rest while the plate moves; `step` s is the march's (collective)."""
    law = operators.contacts.law
    nodes = AuxiliaryNodes(law, step)
    if not nodes.any:
        return memory
    growing = np.where(memory.release > 0, tensions(operators, velocity), 0.0)
    return ContactMemory(memory.release, nodes.in_equilibrium(memory.release, growing).ravel())


def in_basis(task: Task, displacement: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinates (m,) in the basis of the task's model of displacement and velocity (n_local,) of all dofs (collective).

    Displacements are the nearest in energy, velocities in the mass; coordinates without mass have no velocity.
    """
    small, full = task.operators, task.assembly.operators
    assert small.reduction is not None
    vectors = small.reduction.vectors
    stiffness, mass = (np.real(matrix.getDenseArray()) for matrix in (small.stiffness, small.mass))
    with_mass = np.diag(mass) != 0
    shape, speed = displacement[:, None], velocity[:, None]
    along = inner(vectors, apply(full.stiffness, shape) + apply(full.mass, shape), full.comm)[:, 0]
    coordinates = solve_definite(stiffness + mass, along, "initial state in the basis")
    moving = inner(vectors, apply(full.mass, speed), full.comm)[with_mass, 0]
    rates = np.zeros(small.n)
    rates[with_mass] = solve_definite(mass[np.ix_(with_mass, with_mass)], moving, "initial velocity in the basis")
    return coordinates, rates
