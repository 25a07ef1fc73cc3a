"""The static answer of an assembled scene."""

from __future__ import annotations

import numpy as np

from uplift.drivers.analysis.assembled_scene import Analysis
from uplift.drivers.analysis.envelopes import envelopes_of
from uplift.drivers.analysis.equilibrium import equilibrium_notes, equilibrium_of
from uplift.drivers.analysis.initial_state import rest_state
from uplift.drivers.analysis.observers import LiftedShare, take_snapshots
from uplift.drivers.analysis.task import Task
from uplift.solvers.contact.published_passes import Passes
from uplift.solvers.history import History
from uplift.solvers.time_domain.state import Instants, load_values


def run_static(task: Task) -> Analysis:
    """Find the static answer (collective)."""
    operators = task.operators
    with task.assembly.clock.phase("solution"), rest_state(task) as state:
        here = np.real(state.displacement.array_r).copy()
        outputs, release = operators.outputs, state.release[None]
        loads, second = load_values(operators, np.zeros(1), static_only=True), np.zeros((1, len(outputs.accelerated)))
        values = outputs.values(outputs.total(outputs.partial(here))[None], release, loads, second)
    equilibrium = equilibrium_of(task.assembly, loads)
    still = np.zeros((1, operators.n_local))
    equilibrium.observe(Instants(0, here[None], still, still, release, np.zeros((1, 0))))
    share = LiftedShare(task.assembly, np.zeros(1))
    share.watch(0, here)
    take_snapshots(task, 1, lambda _: here, costly=False)
    history = History(np.zeros(1), values, outputs, release, 0, here)
    envelopes, notes = envelopes_of(task, history.times, lambda _: here), equilibrium_notes(task.assembly, equilibrium)
    return Analysis("static", Passes([history], number=1), True, lifted=share.result(), notes=notes, envelopes=envelopes)
