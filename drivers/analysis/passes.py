"""The published passes that a request asks for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from uplift.drivers.analysis.task import Task
from uplift.solvers.contact.published_passes import Passes, published_passes
from uplift.solvers.history import History

MAX_KEPT_PASSES = 10
"""So many passes are all kept; of more, the first and the last two."""


def run_passes(solve: Callable[[np.ndarray | None], History], task: Task) -> Passes:
    """Run the published passes that a request asks for; `solve` maps release forces (nt, n_channels) N to a history."""
    request = task.request
    assert request.passes is not None
    law = task.operators.contacts.law
    return published_passes(solve, law, request.passes, tolerance=request.tolerance, keep_all=request.passes <= MAX_KEPT_PASSES)
