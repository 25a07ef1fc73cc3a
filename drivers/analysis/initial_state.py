"""The state that an analysis starts from."""

from __future__ import annotations

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.analysis.initial_conditions import with_initial_conditions
from uplift.drivers.analysis.plate_motion import in_basis, open_contacts, with_joints
from uplift.drivers.analysis.task import Task
from uplift.forms.operators import Operators
from uplift.meshes.findings import say
from uplift.solvers.time_domain.initial import settled_state, static_state
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import State, at_rest, largest_nodal, loads_at, tensions

SETTLED = 1e-6
"""Relative distance from the state of rest up to which a start counts as settled."""


def start_state(task: Task) -> State:
    """Return the state that the scene asks to start from (collective); say so if settling steps end in motion."""
    settings = task.settings
    if settings.start != "settled":
        return with_initial_conditions(task, rest_state(task))
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
        undeformed = _undeformed(task.assembly)
        if starts_at_zero or _balanced(task.assembly.operators, undeformed):
            return undeformed if not task.reduced else _projected(task, undeformed)
        undeformed.__exit__()
    return static_state(operators, exact_uplift=task.exact, rigid_modes=task.rigid_modes)


def _undeformed(assembly: AssembledScene) -> State:
    """Return the state of all dofs with the plate at zero (collective): joints in equilibrium, contacts that would pull open."""
    operators, numbering = assembly.operators, assembly.plate.numbering
    state = at_rest(operators)
    internal = np.array([float(load.internal) for load in operators.loads])
    force = loads_at(operators, internal, state.release)
    state.displacement.array[:] = with_joints(assembly, np.zeros(numbering.n_field), np.real(force.array_r[numbering.n_free :]))
    force.destroy()
    return State(state.displacement, state.velocity, state.acceleration, open_contacts(operators, state.displacement, state.contacts))


def _balanced(operators: Operators, undeformed: State) -> bool:
    """Return whether nothing acts on a plate at zero: no static load, and no contact that presses (collective)."""
    acting = any(load.static and not load.internal and largest_nodal(load) > 0 for load in operators.loads)
    return not acting and bool(np.all(tensions(operators, undeformed.displacement) >= 0))


def _projected(task: Task, state: State) -> State:
    """Return a state without motion in the basis of the task's model (collective)."""
    found = at_rest(task.operators)
    found.displacement.array[:], _ = in_basis(task, *(np.real(vector.array_r) for vector in (state.displacement, state.velocity)))
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
