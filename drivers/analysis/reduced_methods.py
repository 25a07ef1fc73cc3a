"""The methods of analysis in one Krylov basis: each costs small dense algebra once the basis is there."""

from __future__ import annotations

from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import Analysis, AssembledScene
from uplift.drivers.analysis.basis import basis_notes, basis_of
from uplift.drivers.analysis.initial_state import SETTLED, warn_unsettled
from uplift.drivers.analysis.observers import LiftedShare, film_at
from uplift.drivers.analysis.passes import run_passes
from uplift.drivers.analysis.snapshots import Snapshots
from uplift.drivers.scene.analysis import Transient
from uplift.drivers.scene.request import Request
from uplift.meshes.checked import ModelError
from uplift.solvers.bases.project import ReducedModel, project
from uplift.solvers.bases.reduced_march import ReducedMarch, ReducedState
from uplift.solvers.bases.reduced_march import at_rest as reduced_at_rest
from uplift.solvers.bases.reduced_march import march as reduced_march
from uplift.solvers.bases.reduced_march import settled_state as reduced_settled_state
from uplift.solvers.bases.reduced_march import static_state as reduced_static_state
from uplift.solvers.bases.sweep import ReducedSweep
from uplift.solvers.contact.published_passes import Passes
from uplift.solvers.frequency_domain import fourier
from uplift.solvers.frequency_domain.harmonic import FourierResponse, harmonic_sweep
from uplift.solvers.frequency_domain.laplace import laplace_run
from uplift.solvers.history import History
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import State, at_rest


def analyse_in_basis(assembly: AssembledScene, request: Request, snapshots: Snapshots | None = None) -> Analysis:
    """Run one method in the basis (collective)."""
    assert request.basis is not None
    basis, settings = basis_of(assembly, request.basis, request.basis_file)
    with assembly.clock.phase("projection"):
        model = project(assembly.operators, basis)
    notes = {"basis": basis_notes(basis, settings)}
    if request.method == "transient":
        return march_in_basis(assembly, request, model, notes, snapshots)
    return _fourier(assembly, request, model, notes, snapshots) if request.passes else _laplace(assembly, model, notes, snapshots)


def start_in_basis(settings: Transient, model: ReducedModel, *, exact_uplift: bool) -> ReducedState:
    """Return the state at time 0 that a scene asks for."""
    if settings.start == "rest":
        return reduced_at_rest(model)
    if settings.start == "static":
        return reduced_static_state(model, exact_uplift=exact_uplift)
    settling = settings.settling
    scheme = Scheme(settling.beta, settling.gamma)
    state = reduced_settled_state(model, scheme, settling.step, settling.steps, exact_uplift=exact_uplift)
    if exact_uplift:
        warn_unsettled(_away(state, reduced_static_state(model, exact_uplift=True)))
    return state


def _away(settled: ReducedState, static: ReducedState) -> float:
    """Return how far a state is from the state of rest, relative to that."""
    away = np.linalg.norm(settled.displacement - static.displacement) + np.linalg.norm(settled.velocity)
    size = np.linalg.norm(static.displacement)
    return float(away / size) if size > 0 else float(away > 0)


def march_in_basis(
    assembly: AssembledScene, request: Request, model: ReducedModel, notes: dict[str, Any], snapshots: Snapshots | None = None
) -> Analysis:
    """March in the coordinates of a basis, uplift exact or by the published passes."""
    settings, exact = assembly.scene.transient, request.passes is None
    assert settings is not None
    marched: list[ReducedMarch] = []
    with assembly.clock.phase("march"):
        start = start_in_basis(settings, model, exact_uplift=exact)

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
    return Analysis(request.method, passes, exact, lifted=None if passes.ended == "diverged" else share.result(), notes=notes)


def _laplace(assembly: AssembledScene, model: ReducedModel, notes: dict[str, Any], snapshots: Snapshots | None) -> Analysis:
    settings = assembly.scene.transient
    assert settings is not None
    with assembly.clock.remainder("sweep"):
        state = start_in_basis(settings, model, exact_uplift=True)
        if settings.start == "settled":
            state = _rest(model, state)
        with _lifted(assembly, model, state) as start:
            run = laplace_run(
                assembly.operators, settings.scheme, settings.step, settings.steps, start,
                every=settings.every, solve=ReducedSweep(model),
            )
        assembly.clock.add("march", run.march_seconds)
        share = LiftedShare(assembly, settings.archived)
        for row in np.flatnonzero(share.rows):
            values = run.field(row)
            assert values is not None
            share.watch(row, values)
        film_at(snapshots, len(settings.archived), run.field)
    notes = notes | {"laplace_points": run.points}
    return Analysis("time-frequency", Passes([run.history], number=1), True, tries=run.tries, lifted=share.result(), notes=notes)


def _rest(model: ReducedModel, settled: ReducedState) -> ReducedState:
    """Return the state of rest that the settling steps come to. Raises `ModelError` if they end in motion."""
    static = reduced_static_state(model, exact_uplift=True)
    if _away(settled, static) > SETTLED:
        words = "the sweep starts from a state of rest, and the settling steps end in motion; set start = 'static'"
        raise ModelError("transient.start", words)
    return static


def _lifted(assembly: AssembledScene, model: ReducedModel, state: ReducedState) -> State:
    """Return a state of rest in all dofs."""
    whole = at_rest(assembly.operators)
    whole.displacement.array[:] = model.field(state.displacement)
    whole.release = state.release.copy()
    return whole


def _fourier(
    assembly: AssembledScene, request: Request, model: ReducedModel, notes: dict[str, Any], snapshots: Snapshots | None
) -> Analysis:
    window = assembly.scene.fourier
    assert window is not None
    with assembly.clock.phase("sweep"):
        transfer = harmonic_sweep(assembly.operators, 2 * np.pi * window.frequencies, ReducedSweep(model))
    with assembly.clock.phase("march"):
        response = FourierResponse(assembly.operators, window, transfer)
        passes = run_passes(response.history, assembly, request)
        again = fourier.inverse_by_sum(response.probe_spectrum(passes.final.release), window.samples)
        check = float(np.max(np.abs(again - passes.final.probes), initial=0.0))
        acted = passes.final.release
        film_at(snapshots, window.samples, response.field(acted))
    notes = notes | {"frequencies": len(window.frequencies)}
    return Analysis("time-frequency", passes, False, transform_check=check, notes=notes)
