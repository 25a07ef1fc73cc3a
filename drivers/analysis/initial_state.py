"""The state that an analysis starts from."""

from __future__ import annotations

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.scene.analysis import Transient
from uplift.meshes.findings import say
from uplift.solvers.time_domain.initial import settled_state, static_state
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import State, at_rest

SETTLED = 1e-6
"""Relative distance from the state of rest up to which a start counts as settled."""


def settings_of(assembly: AssembledScene) -> Transient:
    """Return the settings of the integration in time, which the request has checked to be there."""
    settings = assembly.scene.transient
    assert settings is not None
    return settings


def start_state(assembly: AssembledScene, *, exact_uplift: bool, motions: np.ndarray | None = None) -> State:
    """Return the state that the scene asks to start from (collective)."""
    settings = settings_of(assembly)
    if settings.start == "rest":
        return at_rest(assembly.operators)
    if settings.start == "static":
        return static_state(assembly.operators, exact_uplift=exact_uplift, motions=motions)
    settling = settings.settling
    scheme = Scheme(settling.beta, settling.gamma)
    return settled_state(assembly.operators, scheme, settling.step, settling.steps, exact_uplift=exact_uplift, motions=motions)


def warn_unsettled(away: float) -> None:
    """Say how far from rest, relative to its displacements, the settling steps have ended, if that is far."""
    if away > SETTLED:
        say("unsettled", f"the settling steps end {away:.1e} (relative) away from the state of rest: more of them, or start = 'static'")


def distance_from_rest(assembly: AssembledScene, static: State) -> float:
    """Return how far the steps before time 0 leave the model from its state of rest, relative to that (collective)."""
    with start_state(assembly, exact_uplift=True) as settled:
        settled.displacement.axpy(-1.0, static.displacement)
        away = settled.displacement.norm() + settings_of(assembly).step * settled.velocity.norm()
    size = static.displacement.norm()
    return float(away / size) if size > 0 else float(away > 0)
