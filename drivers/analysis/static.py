"""The static answer of an assembled scene."""

from __future__ import annotations

import numpy as np

from uplift.drivers.analysis.assembled_scene import Analysis, AssembledScene
from uplift.drivers.analysis.observers import LiftedShare, film_at
from uplift.drivers.analysis.snapshots import Snapshots
from uplift.drivers.scene.request import Request
from uplift.solvers.contact.published_passes import Passes
from uplift.solvers.history import History
from uplift.solvers.time_domain.initial import static_state


def run_static(assembly: AssembledScene, request: Request, snapshots: Snapshots | None) -> Analysis:
    """Find the static answer (collective)."""
    operators = assembly.operators
    with assembly.clock.phase("solution"), static_state(operators, exact_uplift=True) as state:
        here = np.real(state.displacement.array_r).copy()
        observed = [operators.probes, operators.contacts.elongation] + ([operators.reactions.functionals] if operators.reactions else [])
        probes, elongation, *resultants = (f.total(f.partial(here))[None] for f in observed)
        release = state.release[None]
    reactions = operators.reactions.values(resultants[0], release) if operators.reactions else np.zeros((1, 0))
    share = LiftedShare(assembly, np.zeros(1))
    share.watch(0, here)
    film_at(snapshots, 1, lambda _: here, costly=False)
    history = History(np.zeros(1), probes, elongation, release, reactions, 0, here)
    return Analysis("static", Passes([history], number=1), True, lifted=share.result())
