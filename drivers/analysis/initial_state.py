"""The state that an analysis starts from."""

from __future__ import annotations

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.analysis.task import Task
from uplift.forms.operators import Operators
from uplift.meshes.findings import say
from uplift.solvers.bases.basis import apply, inner
from uplift.solvers.contact.memory import ContactMemory
from uplift.solvers.dense import solve_definite
from uplift.solvers.time_domain.initial import settled_state, static_state
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import State, at_rest, largest_nodal, loads_at, tensions

SETTLED = 1e-6
"""Relative distance from the state of rest up to which a start counts as settled."""


def start_state(task: Task) -> State:
    """Return the state that the scene asks to start from (collective); say so if settling steps end in motion."""
    settings = task.settings
    if settings.start != "settled":
        return rest_state(task)
    settled = _settled(task)
    if task.exact:
        with rest_state(task) as static:
            away = _distance(settled, static, settings.step)
        if away > SETTLED:
            say("unsettled", f"the settling steps end {away:.1e} (relative) away from the state of rest: more of them, or start = 'static'")
    return settled


def rest_state(task: Task) -> State:
    """Return the static answer to the static loads, or the plate at zero for start = "rest" (collective).

    Contacts across a gap under a plate on which nothing acts are open, however stiff they are beside what holds it: this is no result
    of a solution, in which round-off would have to tell.
    """
    settings, operators = task.assembly.scene.transient, task.operators
    starts_at_zero = task.request.method != "static" and settings is not None and settings.start == "rest"
    internal = any(load.internal for load in operators.loads)
    if starts_at_zero and not internal:
        return at_rest(operators)
    if internal and task.exact:
        undeformed = state_of_plate(task.assembly, *np.zeros((2, task.assembly.plate.numbering.n_field)))
        if starts_at_zero or _balanced(task.assembly.operators, undeformed):
            return undeformed if not task.reduced else _projected(task, undeformed)
        undeformed.__exit__()
    return static_state(operators, exact_uplift=task.exact, rigid_modes=task.rigid_modes)


def state_of_plate(assembly: AssembledScene, displacement: np.ndarray, velocity: np.ndarray) -> State:
    """Return the state of all dofs from that of the plate, `displacement` m and `velocity` m/s (n_field,) (collective).

    The joints' own dofs follow from their equilibrium; contacts that would pull are open.
    """
    operators, numbering = assembly.operators, assembly.plate.numbering
    state, own = at_rest(operators), slice(numbering.n_free, None)
    internal = np.array([float(load.internal) for load in operators.loads])
    force, work, diagonal = loads_at(operators, internal, state.release), operators.new_vector(), operators.stiffness.getDiagonal()
    for vector, field, acting in ((state.displacement, displacement, force.array_r[own]), (state.velocity, velocity, 0.0)):
        given = numbering.vector(field)
        given.copy(vector)
        operators.stiffness.mult(vector, work)
        vector.array[own] = (acting - work.array_r[own]) / diagonal.array_r[own]
        given.destroy()
    law, tension = operators.contacts.law, tensions(operators, state.displacement)
    release = np.where((tension > 0)[law.owner], tension, 0.0)
    for vector in (force, work, diagonal):
        vector.destroy()
    return State(state.displacement, state.velocity, state.acceleration, ContactMemory(release, state.contacts.inner))


def _balanced(operators: Operators, undeformed: State) -> bool:
    """Return whether nothing acts on a plate at zero: no static load, and no contact that presses (collective)."""
    acting = any(load.static and not load.internal and largest_nodal(load) > 0 for load in operators.loads)
    return not acting and bool(np.all(tensions(operators, undeformed.displacement) >= 0))


def _projected(task: Task, state: State) -> State:
    """Return a state in the basis of the task's model: displacements nearest in energy, velocities in the mass (collective)."""
    small, full = task.operators, task.assembly.operators
    assert small.reduction is not None
    vectors, found = small.reduction.vectors, at_rest(small)
    stiffness, mass = (np.real(matrix.getDenseArray()) for matrix in (small.stiffness, small.mass))
    with_mass = np.diag(mass) != 0
    shape, speed = (np.real(vector.array_r)[:, None] for vector in (state.displacement, state.velocity))
    along = inner(vectors, apply(full.stiffness, shape) + apply(full.mass, shape), full.comm)[:, 0]
    found.displacement.array[:] = solve_definite(stiffness + mass, along, "initial state in the basis")
    moving = inner(vectors, apply(full.mass, speed), full.comm)[with_mass, 0]
    rate = np.zeros(small.n)
    rate[with_mass] = solve_definite(mass[np.ix_(with_mass, with_mass)], moving, "initial velocity in the basis")
    found.velocity.array[:] = rate
    state.__exit__()
    return State(found.displacement, found.velocity, found.acceleration, state.contacts)


def rests(task: Task, static: State) -> bool:
    """Return whether the scene's start comes to the state of rest `static` (collective)."""
    if task.settings.start != "settled":
        return True
    with _settled(task) as settled:
        return _distance(settled, static, task.settings.step) <= SETTLED


def _settled(task: Task) -> State:
    settling = task.settings.settling
    scheme = Scheme(settling.beta, settling.gamma)
    return settled_state(
        task.operators, scheme, settling.step, settling.steps, exact_uplift=task.exact, rigid_modes=task.rigid_modes
    )


def _distance(settled: State, static: State, step: float) -> float:
    """Return how far a state is from one of rest, relative to that (collective)."""
    with settled.copy() as difference:
        difference.displacement.axpy(-1.0, static.displacement)
        away = difference.displacement.norm() + step * difference.velocity.norm()
    size = static.displacement.norm()
    return float(away / size) if size > 0 else float(away > 0)
