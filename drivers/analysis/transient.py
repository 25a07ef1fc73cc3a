"""Direct time integration of an assembled scene in all dofs."""

from __future__ import annotations

import numpy as np

from uplift.drivers.analysis.assembled_scene import Analysis, AssembledScene
from uplift.drivers.analysis.initial_state import distance_from_rest, settings_of, start_state, warn_unsettled
from uplift.drivers.analysis.observers import LiftedShare, Observers
from uplift.drivers.analysis.passes import run_passes
from uplift.drivers.analysis.snapshots import Snapshots
from uplift.drivers.scene.request import Request
from uplift.forms.assembly.row_labels import rigid_motions
from uplift.meshes.checked import ModelError
from uplift.solvers.contact.published_passes import Passes
from uplift.solvers.history import History
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.watch import Watch

LEDGER_DOFS = 50_000
"""Up to this size the ledger of energies is kept, whose products of matrix and vector then cost less than the rest of a step."""


def run_transient(
    assembly: AssembledScene, request: Request, snapshots: Snapshots | None, watch: Watch | None, iterative: bool
) -> Analysis:
    """Integrate in time in all dofs (collective)."""
    settings, exact = settings_of(assembly), request.passes is None
    components = assembly.plate.components
    if iterative and any(name.startswith("DR") for name in components):
        raise ModelError("--solver", "iterative solves for displacements alone; a shell with rotations needs the direct one")
    motions = rigid_motions(assembly.plate.labels, components) if iterative else None
    with (
        assembly.clock.remainder("solution"),
        start_state(assembly, exact_uplift=exact, motions=motions) as start,
        Newmark(assembly.operators, settings.scheme, settings.step, exact_uplift=exact, motions=motions) as method,
    ):
        assembly.clock.add("factorisation", method.solver.factor_seconds)
        if settings.start == "settled" and exact:
            with static_state(assembly.operators, exact_uplift=True, motions=motions) as static:
                away = distance_from_rest(assembly, static)
            warn_unsettled(away)
        share = LiftedShare(assembly, settings.archived)
        ledger = assembly.operators.n <= LEDGER_DOFS
        observer = Observers(assembly, share, snapshots) if snapshots is not None or share.rows.any() else None

        def solve(release: np.ndarray | None) -> History:
            if snapshots is not None:
                snapshots.start(len(settings.archived))
            return transient(
                method, start, settings.steps, every=settings.every, release=release, energy=ledger, observer=observer, watch=watch
            )

        passes = Passes([solve(None)], number=1) if exact else run_passes(solve, assembly, request)
        problem = method.compliance.problem if method.compliance else None
        tries = problem.tries / max(problem.solved, 1) if problem else None
        return Analysis("transient", passes, exact, tries=tries, lifted=None if passes.ended == "diverged" else share.result())
