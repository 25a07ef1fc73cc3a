"""The static answer of an assembled scene."""

from __future__ import annotations

import numpy as np

from uplift.drivers.analysis.assembled_scene import Analysis
from uplift.drivers.analysis.envelopes import envelopes_of
from uplift.drivers.analysis.observers import LiftedShare, take_snapshots
from uplift.drivers.analysis.task import Task
from uplift.solvers.contact.published_passes import Passes
from uplift.solvers.history import History
from uplift.solvers.time_domain.initial import static_state


def run_static(task: Task) -> Analysis:
    """Find the static answer (collective)."""
    operators = task.operators
    with task.assembly.clock.phase("solution"), static_state(operators, exact_uplift=True) as state:
        here = np.real(state.displacement.array_r).copy()
        outputs, release = operators.outputs, state.release[None]
        values = outputs.values(outputs.total(outputs.partial(here))[None], release)
    share = LiftedShare(task.assembly, np.zeros(1))
    share.watch(0, here)
    take_snapshots(task, 1, lambda _: here, costly=False)
    history = History(np.zeros(1), values, outputs, release, 0, here)
    envelopes = envelopes_of(task, history.times, lambda _: here)
    return Analysis("static", Passes([history], number=1), True, lifted=share.result(), envelopes=envelopes)
