"""The methods of analysis in one Krylov basis: each costs small dense algebra once the basis is there."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from drivers.analysis import Analysis, Plant
from drivers.film import Film
from drivers.methods import SETTLED, LiftedShare, film_at, run_passes, warn_unsettled
from drivers.request import Request
from drivers.scene import Scene, Transient
from meshes.checked import ModelError
from solvers import fourier, reduced
from solvers.harmonic import FourierResponse, harmonic_sweep
from solvers.history import History
from solvers.krylov import KrylovBasis, krylov_basis
from solvers.laplace import laplace_run
from solvers.newmark import State, at_rest
from solvers.parameters import KrylovSettings, Scheme
from solvers.passes import Passes
from solvers.reduced_sweep import ReducedSweep


def krylov_settings(scene: Scene, tolerance: float, *, loose: bool) -> KrylovSettings:
    """Return the settings of a basis for a scene: its band, and a shift where the plate is `loose`, free to move without strain."""
    settings = KrylovSettings(tolerance=tolerance)
    if scene.basis is not None and scene.basis.band is not None:
        settings = dataclasses.replace(settings, band=scene.basis.band)
    elif scene.fourier is not None:
        settings = dataclasses.replace(settings, band=scene.fourier.cutoff)
    if loose:
        settings = dataclasses.replace(settings, shift=(0.02 * 2 * np.pi * settings.band) ** 2)
    return settings


def basis_of(plant: Plant, tolerance: float, path: Path | None) -> tuple[KrylovBasis, KrylovSettings]:
    """Read the basis from `path` if the file is there, else make one, and write it if a path is given (collective).

    Raises `ModelError` for a file that does not fit the model or whose basis is coarser than `tolerance`.
    """
    operators, settings = plant.operators, krylov_settings(plant.scene, tolerance, loose=bool(plant.assembled.loose))
    if path is not None and operators.comm.bcast(path.exists(), root=0):
        from solvers.basis_file import read_basis

        with plant.clock.phase("basis"):
            basis, made = read_basis(path, operators)
        if made.tolerance > settings.tolerance or made.band < settings.band:
            words = f"made for a tolerance of {made.tolerance:g} to {made.band:g} Hz; this run asks for {settings.tolerance:g} to"
            raise ModelError("--basis-file", f"{path}: {words} {settings.band:g} Hz")
        return basis, made
    with plant.clock.remainder("basis"):
        basis = krylov_basis(operators, settings)
        plant.clock.add("factorisation", basis.growth.seconds["factorisation"])
        if path is not None:
            from solvers.basis_file import write_basis

            write_basis(path, operators, basis, settings)
    return basis, settings


def analyse_in_basis(plant: Plant, request: Request, film: Film | None = None) -> Analysis:
    """Run one method in the basis (collective)."""
    assert request.basis is not None
    basis, settings = basis_of(plant, request.basis, request.basis_file)
    with plant.clock.phase("projection"):
        model = reduced.project(plant.operators, basis)
    notes = {"basis": basis_notes(basis, settings)}
    if request.method == "transient":
        return march_in_basis(plant, request, model, notes, film)
    return _fourier(plant, request, model, notes, film) if request.passes else _laplace(plant, model, notes, film)


def basis_notes(basis: KrylovBasis, settings: KrylovSettings) -> dict[str, Any]:
    """Return what the summary says of a basis."""
    growth = basis.growth
    return {
        "vectors": basis.size,
        "starting_columns": growth.columns,
        "blocks": len(growth.sizes),
        "order": growth.order,
        "solves": growth.solves,
        "tolerance": settings.tolerance,
        "band_Hz": settings.band,
        "estimated_error": growth.estimate,
        "residual_at_Hz": growth.checked,
        "residual_by_block": growth.residual,
        "transfer_change_by_block": growth.change,
        "seconds": growth.seconds,
    }


def start_in_basis(settings: Transient, model: reduced.ReducedModel, *, exact_uplift: bool) -> reduced.ReducedState:
    """Return the state at time 0 that a scene asks for."""
    if settings.start == "rest":
        return reduced.at_rest(model)
    if settings.start == "static":
        return reduced.static_state(model, exact_uplift=exact_uplift)
    settling = settings.settling
    scheme = Scheme(settling.beta, settling.gamma)
    state = reduced.settled_state(model, scheme, settling.step, settling.steps, exact_uplift=exact_uplift)
    if exact_uplift:
        warn_unsettled(_away(state, reduced.static_state(model, exact_uplift=True)))
    return state


def _away(settled: reduced.ReducedState, static: reduced.ReducedState) -> float:
    """Return how far a state is from the state of rest, relative to that."""
    away = np.linalg.norm(settled.displacement - static.displacement) + np.linalg.norm(settled.velocity)
    size = np.linalg.norm(static.displacement)
    return float(away / size) if size > 0 else float(away > 0)


def march_in_basis(
    plant: Plant, request: Request, model: reduced.ReducedModel, notes: dict[str, Any], film: Film | None = None
) -> Analysis:
    """March in the coordinates of a basis, uplift exact or by the published passes."""
    settings, exact = plant.scene.transient, request.passes is None
    assert settings is not None
    marched: list[reduced.ReducedMarch] = []
    with plant.clock.phase("march"):
        start = start_in_basis(settings, model, exact_uplift=exact)

        def solve(release: np.ndarray | None) -> History:
            run = reduced.march(
                model, settings.scheme, settings.step, settings.steps,
                every=settings.every, start=start, release=release, exact_uplift=exact,
            )
            marched[:] = [run]
            return run.history(model)

        passes = Passes([solve(None)], number=1) if exact else run_passes(solve, plant, request)
        share = LiftedShare(plant, settings.archived)
        for row in np.flatnonzero(share.rows):
            share.watch(row, model.field(marched[0].coordinates[row]))
        film_at(film, len(settings.archived), lambda row: model.field(marched[0].coordinates[row]), costly=False)
    return Analysis(request.method, passes, exact, lifted=None if passes.ended == "diverged" else share.result(), notes=notes)


def _laplace(plant: Plant, model: reduced.ReducedModel, notes: dict[str, Any], film: Film | None) -> Analysis:
    settings = plant.scene.transient
    assert settings is not None
    with plant.clock.remainder("sweep"):
        state = start_in_basis(settings, model, exact_uplift=True)
        if settings.start == "settled":
            state = _rest(model, state)
        with _lifted(plant, model, state) as start:
            run = laplace_run(
                plant.operators, settings.scheme, settings.step, settings.steps, start,
                every=settings.every, solve=ReducedSweep(model),
            )
        plant.clock.add("march", run.march_seconds)
        share = LiftedShare(plant, settings.archived)
        for row in np.flatnonzero(share.rows):
            values = run.field(row)
            assert values is not None
            share.watch(row, values)
        film_at(film, len(settings.archived), run.field)
    notes = notes | {"laplace_points": run.points}
    return Analysis("time-frequency", Passes([run.history], number=1), True, tries=run.tries, lifted=share.result(), notes=notes)


def _rest(model: reduced.ReducedModel, settled: reduced.ReducedState) -> reduced.ReducedState:
    """Return the state of rest that the settling steps come to. Raises `ModelError` if they end in motion."""
    static = reduced.static_state(model, exact_uplift=True)
    if _away(settled, static) > SETTLED:
        words = "the sweep starts from a state of rest, and the settling steps end in motion; set start = 'static'"
        raise ModelError("transient.start", words)
    return static


def _lifted(plant: Plant, model: reduced.ReducedModel, state: reduced.ReducedState) -> State:
    """Return a state of rest in all dofs."""
    whole = at_rest(plant.operators)
    whole.displacement.array[:] = model.field(state.displacement)
    whole.release = state.release.copy()
    return whole


def _fourier(
    plant: Plant, request: Request, model: reduced.ReducedModel, notes: dict[str, Any], film: Film | None
) -> Analysis:
    window = plant.scene.fourier
    assert window is not None
    with plant.clock.phase("sweep"):
        transfer = harmonic_sweep(plant.operators, 2 * np.pi * window.frequencies, ReducedSweep(model))
    with plant.clock.phase("march"):
        response = FourierResponse(plant.operators, window, transfer)
        passes = run_passes(response.history, plant, request)
        again = fourier.inverse_by_sum(response.probe_spectrum(passes.final.release), window.samples)
        check = float(np.max(np.abs(again - passes.final.probes), initial=0.0))
        acted = passes.final.release
        film_at(film, window.samples, response.field(acted))
    notes = notes | {"frequencies": len(window.frequencies)}
    return Analysis("time-frequency", passes, False, transform_check=check, notes=notes)
