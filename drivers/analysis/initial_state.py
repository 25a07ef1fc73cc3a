"""The state that an analysis starts from."""

from __future__ import annotations

from uplift.drivers.analysis.task import Task
from uplift.meshes.findings import say
from uplift.solvers.time_domain.initial import settled_state, static_state
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import State, at_rest

SETTLED = 1e-6
"""Relative distance from the state of rest up to which a start counts as settled."""


def start_state(task: Task) -> State:
    """Return the state that the scene asks to start from (collective); say so if settling steps end in motion."""
    settings, operators = task.settings, task.operators
    if settings.start == "rest":
        return at_rest(operators)
    if settings.start == "static":
        return static_state(operators, exact_uplift=task.exact, rigid_modes=task.rigid_modes)
    settled = _settled(task)
    if task.exact:
        with static_state(operators, exact_uplift=True, rigid_modes=task.rigid_modes) as static:
            away = _distance(settled, static, settings.step)
        if away > SETTLED:
            say("unsettled", f"the settling steps end {away:.1e} (relative) away from the state of rest: more of them, or start = 'static'")
    return settled


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
