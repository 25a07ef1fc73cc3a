"""Initial conditions of a scene, added to the state that an analysis starts from.

Joints and contacts follow the plate: nodes of joints stand in equilibrium between their springs, and contacts that would pull are open.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.analysis.plate_motion import in_basis, nodes_at_rest, open_contacts, with_joints
from uplift.drivers.analysis.task import Task
from uplift.forms.assembly.initial_fields import initial_fields
from uplift.forms.contact.supports import AXES, TRANSLATIONS
from uplift.forms.operators import Operators
from uplift.meshes.checked import ModelError
from uplift.meshes.findings import say
from uplift.solvers.bases.basis import apply, inner
from uplift.solvers.time_domain.state import State

LOST = 0.01
"""Part of the energy of the initial conditions that a basis may miss without a word."""

NO_STRAIN = 1e-13
"""A displacement with less than this part of the strain energy that its nodes would have one by one has none but round-off."""


def with_initial_conditions(task: Task, state: State) -> State:
    """Return a state with the initial conditions of the scene added, in place of the one that is given (collective).

    Without any it is the same state. Raises `ModelError` for a group or a mode that the model does not have.
    """
    assembly = task.assembly
    if not assembly.plate.model.initial:
        return state
    displacement, velocity = changes(assembly)
    if task.reduced:
        small = in_basis(task, displacement, velocity)
        _say_what_is_lost(task, (displacement, velocity), small)
        displacement, velocity = small
    state.displacement.array[:] += displacement
    state.velocity.array[:] += velocity
    contacts = state.contacts
    if task.exact:
        contacts = open_contacts(task.operators, state.displacement, contacts)
        contacts = nodes_at_rest(task.operators, state.velocity, contacts, task.settings.step)
    return State(state.displacement, state.velocity, state.acceleration, contacts)


def changes(assembly: AssembledScene) -> tuple[np.ndarray, np.ndarray]:
    """Return displacements and velocities (n_local,) of all dofs of the model that the conditions ask for (collective).

    Raises `ModelError` for a group or a mode that the model does not have.
    """
    plate = assembly.plate
    fields = initial_fields(plate.model.initial, assembly.tagged, plate.space, plate.numbering, plate.components)
    displacement, velocity = (with_joints(assembly, field, 0.0) for field in fields)
    return displacement + _modes(assembly), velocity


def _modes(assembly: AssembledScene) -> np.ndarray:
    """Return the sum of the modes times their amplitudes, (n_local,) m (collective)."""
    operators = assembly.operators
    given = assembly.plate.model.initial
    wanted = [(c.mode, c.amplitude) for c in given if c.mode is not None and c.amplitude is not None]
    total = np.zeros(operators.n_local)
    if not wanted:
        return total
    from uplift.solvers.bases.modes import modes

    modal = assembly.scene.modal
    shift = modal.shift if modal is not None else 0.0
    if assembly.plate.unrestrained and shift == 0.0:
        raise ModelError("initial.mode", "the plate can move without strain: set [modal] shift below 0 rad2/s2 to find its modes")
    with assembly.clock.phase("modes"):
        try:
            found = modes(operators, number=max(number for number, _ in wanted), shift=shift)
        except ModelError as error:
            raise ModelError("initial.mode", error.message) from None
    for number, amplitude in wanted:
        shape = found.basis.vectors[:, number - 1]
        total += amplitude / _largest(assembly, shape) * shape
    return total


def _largest(assembly: AssembledScene, shape: np.ndarray) -> float:
    """Return the largest length of the displacement of a node (collective)."""
    plate = assembly.plate
    nodal = plate.numbering.field(shape).reshape(-1, len(plate.components))
    moved = nodal[:, [column for column, name in enumerate(plate.components) if name[1:] in AXES[:TRANSLATIONS]]]
    return float(max(plate.numbering.comm.allgather(float(np.max(np.linalg.norm(moved, axis=1), initial=0.0)))))


def _say_what_is_lost(task: Task, full: tuple[np.ndarray, np.ndarray], small: tuple[np.ndarray, np.ndarray]) -> None:
    """Say which part of the energy of displacement and velocity (n_local,) their coordinates (m,) in the basis miss (collective)."""
    (displacement, velocity), operators = full, task.assembly.operators
    left, rate = (values - task.operators.reconstruct(coordinates) for values, coordinates in zip(full, small, strict=True))
    whole = _energy(operators, displacement, velocity, displacement)
    missed = _energy(operators, left, rate, displacement) / whole if whole > 0 else 0.0
    if missed > LOST:
        say("initial state", f"the basis misses {missed:.1%} of the energy of the initial conditions")


def _energy(operators: Operators, displacement: np.ndarray, velocity: np.ndarray, scale: np.ndarray) -> float:
    """Return twice the energy in J of displacements and velocities (n_local,), strain below the round-off of `scale` left out (collective).

    Displacements count with their mass too, as velocities at 1 rad/s: rigid ones, which have no strain, then count for something.
    """

    def product(matrix: Any, values: np.ndarray) -> float:
        column = values[:, None]
        return float(inner(column, apply(matrix, column), operators.comm)[0, 0])

    diagonal = operators.stiffness.getDiagonal()
    one_by_one = float(operators.comm.allreduce(float(np.real(diagonal.array_r) @ scale**2)))
    diagonal.destroy()
    strain = product(operators.stiffness, displacement)
    masses = product(operators.mass, displacement) + product(operators.mass, velocity)
    return masses + (strain if strain > NO_STRAIN * one_by_one else 0.0)
