"""Time integration of an assembled scene on its modes."""

from __future__ import annotations

import numpy as np

from uplift.drivers.analysis.assembled_scene import Analysis, AssembledScene
from uplift.drivers.analysis.initial_state import settings_of
from uplift.drivers.analysis.observers import LiftedShare, film_at
from uplift.drivers.analysis.passes import run_passes
from uplift.drivers.analysis.snapshots import Snapshots
from uplift.drivers.scene.request import Request
from uplift.meshes.findings import say
from uplift.solvers.contact.published_passes import Passes
from uplift.solvers.history import History
from uplift.solvers.time_domain.scheme import Scheme


def run_modal(assembly: AssembledScene, request: Request, snapshots: Snapshots | None) -> Analysis:
    """Integrate in time on the modes of the scene (collective)."""
    from uplift.solvers.bases.modes import modes
    from uplift.solvers.bases.project import project
    from uplift.solvers.bases.reduced_march import ReducedMarch
    from uplift.solvers.bases.reduced_march import at_rest as reduced_at_rest
    from uplift.solvers.bases.reduced_march import march as reduced_march
    from uplift.solvers.bases.reduced_march import settled_state as reduced_settled_state
    from uplift.solvers.bases.reduced_march import static_state as reduced_static_state
    from uplift.solvers.bases.static_answers import with_static_answers

    settings, modal, exact = settings_of(assembly), assembly.scene.modal, request.passes is None
    assert modal is not None
    operators = assembly.operators
    with assembly.clock.phase("modes"):
        found = modes(operators, number=modal.number, band=modal.band, shift=modal.shift)
        basis = found.basis
        if modal.static_correction:
            basis = with_static_answers(operators, basis)
        elif exact and operators.contacts.names:
            say("modes alone", "modes alone give the contact forces badly and exact uplift with them: set modal.static_correction = true")
        model = project(operators, basis, diagonal=modal.diagonal)
    with assembly.clock.phase("solution"):
        if settings.start == "rest":
            start = reduced_at_rest(model)
        elif settings.start == "static":
            start = reduced_static_state(model, exact_uplift=exact)
        else:
            settling = settings.settling
            scheme = Scheme(settling.beta, settling.gamma)
            start = reduced_settled_state(model, scheme, settling.step, settling.steps, exact_uplift=exact)
        marched: list[ReducedMarch] = []

        def solve(release: np.ndarray | None) -> History:
            run = reduced_march(
                model, settings.scheme, settings.step, settings.steps,
                every=settings.every, start=start, release=release, exact_uplift=exact,
            )
            marched[:] = [run]
            return run.history(model)

        passes = Passes([solve(None)], number=1) if exact else run_passes(solve, assembly, request)
    share = LiftedShare(assembly, settings.archived)
    for row in np.flatnonzero(share.rows):
        share.watch(row, model.field(marched[0].coordinates[row]))
    film_at(snapshots, len(settings.archived), lambda row: model.field(marched[0].coordinates[row]), costly=False)
    notes = {
        "modes": found.number,
        "basis_vectors": basis.size,
        "frequencies_Hz": found.frequencies.tolist(),
        "largest_mode_residual": float(np.max(found.residuals, initial=0.0)),
        "orthonormality": found.orthonormality,
        "sturm_count": found.sturm.inside,
    }
    return Analysis("modal", passes, exact, lifted=None if passes.ended == "diverged" else share.result(), notes=notes)
