"""The methods of analysis on an assembled scene: in time, by a sweep, on a basis; uplift exact or by the published passes."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from drivers.analysis import Analysis, Plant
from drivers.film import Film
from drivers.request import Request
from drivers.runtime import require_scalars
from drivers.scene import Transient
from forms.labels import rigid_motions
from meshes.checked import ModelError
from solvers.history import History
from solvers.newmark import Newmark, State, at_rest, settled_state, static_state, transient
from solvers.parameters import Scheme, Window
from solvers.passes import Passes, published_passes
from solvers.watch import Watch

log = logging.getLogger(__name__)

FEW = 10
"""So many passes are all kept; of more, the first and the last two."""

SETTLED = 1e-6
"""Relative distance from the state of rest up to which a start counts as settled."""

WRAPPED = 0.01
"""Part of the largest response that may be left at the end of a window before the run warns of wrap-around."""

LOST = 1e-4
"""Share of a load's energy, 1 % in amplitude, that may lie above the band of a window before the run warns."""

LEDGER_DOFS = 50_000
"""Up to this size the ledger of energies is kept, whose products of matrix and vector then cost less than the rest of a step."""


def analyse(
    plant: Plant,
    request: Request,
    film: Film | None = None,
    *,
    groups: int | None = None,
    watch: Watch | None = None,
    iterative: bool = False,
) -> Analysis:
    """Run one method (collective), filmed if a film is given.

    Raises `ModelError` where it needs a static state and nothing holds the plate.

    A sweep uses `groups` groups of ranks (None: chosen from the sizes), a transient run solves its systems by a factor or by an
    `iterative` method; `watch` shows the progress of long loops and keeps their checkpoints.
    """
    request.check_held(plant.scene, plant.assembled.loose)
    if request.basis is not None:
        from drivers.reduced_methods import analyse_in_basis

        return analyse_in_basis(plant, request, film)
    if request.method == "time-frequency":
        require_scalars("complex")
        sweep = _laplace if request.passes is None else _fourier
        analysis = sweep(plant, request, film, groups, watch)
    elif request.method == "transient":
        analysis = _transient(plant, request, film, watch, iterative)
    else:
        analysis = (_modal if request.method == "modal" else _static)(plant, request, film)
    if film is not None and analysis.passes.ended == "diverged":
        film.start(0)  # what ran away is not what the history holds
    return analysis


def run_passes(solve, plant: Plant, request: Request) -> Passes:  # type: ignore[no-untyped-def]  # the callable of published_passes
    """Run the published passes that a request asks for."""
    assert request.passes is not None
    law = plant.operators.contacts.law
    return published_passes(solve, law, request.passes, tolerance=request.tolerance, keep_all=request.passes <= FEW)


def _settings(plant: Plant) -> Transient:
    settings = plant.scene.transient
    assert settings is not None
    return settings


def _start_state(plant: Plant, *, exact_uplift: bool, motions: np.ndarray | None = None) -> State:
    settings = _settings(plant)
    if settings.start == "rest":
        return at_rest(plant.operators)
    if settings.start == "static":
        return static_state(plant.operators, exact_uplift=exact_uplift, motions=motions)
    settling = settings.settling
    scheme = Scheme(settling.beta, settling.gamma)
    return settled_state(plant.operators, scheme, settling.step, settling.steps, exact_uplift=exact_uplift, motions=motions)


def warn_unsettled(away: float) -> None:
    """Say how far from rest, relative to its displacements, the settling steps have ended, if that is far."""
    if away > SETTLED:
        log.warning("the settling steps end %.1e (relative) away from the state of rest: more of them, or start = 'static'", away)


class LiftedShare:
    """Collects the lifted share of the area at the archived instants that the scene asks for."""

    def __init__(self, plant: Plant, times: np.ndarray) -> None:
        """Take the archived instants (nt,) s."""
        self._area = plant.assembled.lifted_area
        self.rows = plant.scene.output.uplift_rows(times)
        self.partial = np.full(len(times), np.nan)

    def watch(self, row: int, values: np.ndarray) -> None:
        """Note the share at one archived instant."""
        if self.rows[row]:
            self.partial[row] = self._area.partial(values)

    def result(self) -> np.ndarray | None:
        """Return the shares (nt,) in percent, nan where not asked for; None if nowhere (collective)."""
        return self._area.total(self.partial) if self.rows.any() else None


class _Audience:
    """All who look at the displacements of a march, and what of theirs is kept in its checkpoints."""

    def __init__(self, plant: Plant, share: LiftedShare, film: Film | None) -> None:
        self._share, self._film = share, film
        self._nothing = np.zeros((plant.operators.n_local, 0))

    def watch(self, row: int, values: np.ndarray) -> None:
        self._share.watch(row, values)
        if self._film is not None:
            self._film.watch(row, values)

    def kept(self) -> tuple[np.ndarray, np.ndarray]:
        lifted, fields = self._film.kept() if self._film is not None else (self._share.partial, self._nothing)
        return np.stack([self._share.partial, lifted]), fields

    def restore(self, shares: np.ndarray, fields: np.ndarray) -> None:
        self._share.partial[:] = shares[0]
        if self._film is not None:
            self._film.restore(shares[1], fields)


def _transient(plant: Plant, request: Request, film: Film | None, watch: Watch | None, iterative: bool) -> Analysis:
    settings, exact = _settings(plant), request.passes is None
    components = plant.assembled.components
    if iterative and any(name.startswith("DR") for name in components):
        raise ModelError("--solver", "iterative solves for displacements alone; a shell with rotations needs the direct one")
    motions = rigid_motions(plant.assembled.labels, components) if iterative else None
    with (
        plant.clock.remainder("solution"),
        _start_state(plant, exact_uplift=exact, motions=motions) as start,
        Newmark(plant.operators, settings.scheme, settings.step, exact_uplift=exact, motions=motions) as method,
    ):
        plant.clock.add("factorisation", method.solver.factor_seconds)
        if settings.start == "settled" and exact:
            with static_state(plant.operators, exact_uplift=True, motions=motions) as static:
                away = _unsettled(plant, static)
            warn_unsettled(away)
        share = LiftedShare(plant, settings.archived)
        ledger = plant.operators.n <= LEDGER_DOFS
        observer = _Audience(plant, share, film) if film is not None or share.rows.any() else None

        def solve(release: np.ndarray | None) -> History:
            if film is not None:
                film.start(len(settings.archived))
            return transient(
                method, start, settings.steps, every=settings.every, release=release, energy=ledger, observer=observer, watch=watch
            )

        passes = Passes([solve(None)], number=1) if exact else run_passes(solve, plant, request)
        problem = method.compliance.problem if method.compliance else None
        tries = problem.tries / max(problem.solved, 1) if problem else None
        return Analysis("transient", passes, exact, tries=tries, lifted=None if passes.ended == "diverged" else share.result())


def film_at(film: Film | None, instants: int, field: Callable[[int], np.ndarray | None], *, costly: bool = True) -> None:
    """Film what `field` gives at the film's own instants (collective); nothing where fields were not kept."""
    if film is None:
        return
    film.start(instants, costly=costly)
    for row in film.rows:
        values = field(int(row))
        if values is None:
            return
        film.watch(int(row), values)


def _static(plant: Plant, request: Request, film: Film | None) -> Analysis:
    operators = plant.operators
    with plant.clock.phase("solution"), static_state(operators, exact_uplift=True) as state:
        here = np.real(state.displacement.array_r).copy()
        observed = [operators.probes, operators.contacts.elongation] + ([operators.reactions.functionals] if operators.reactions else [])
        probes, elongation, *resultants = (f.total(f.partial(here))[None] for f in observed)
        release = state.release[None]
    reactions = operators.reactions.values(resultants[0], release) if operators.reactions else np.zeros((1, 0))
    share = LiftedShare(plant, np.zeros(1))
    share.watch(0, here)
    film_at(film, 1, lambda _: here, costly=False)
    history = History(np.zeros(1), probes, elongation, release, reactions, 0, here)
    return Analysis("static", Passes([history], number=1), True, lifted=share.result())


def _laplace(plant: Plant, request: Request, film: Film | None, groups: int | None, watch: Watch | None) -> Analysis:
    from solvers.laplace import laplace_run

    settings = _settings(plant)
    with plant.clock.remainder("solution"):
        start = at_rest(plant.operators) if settings.start == "rest" else static_state(plant.operators, exact_uplift=True)
        if settings.start == "settled" and _unsettled(plant, start) > SETTLED:
            words = "the sweep starts from a state of rest, and the settling steps end in motion; set start = 'static'"
            raise ModelError("transient.start", words)
        with start:
            run = laplace_run(
                plant.operators, settings.scheme, settings.step, settings.steps, start, every=settings.every, groups=groups, watch=watch
            )
        plant.clock.add("factorisation", run.factor_seconds)
        plant.clock.add("march", run.march_seconds)
        share = LiftedShare(plant, settings.archived)
        for row in np.flatnonzero(share.rows):
            values = run.field(row)
            if values is not None:
                share.watch(row, values)
        film_at(film, len(settings.archived), run.field)
    notes = {"laplace_points": run.points}
    return Analysis("time-frequency", Passes([run.history], number=1), True, tries=run.tries, lifted=share.result(), notes=notes)


def _unsettled(plant: Plant, static: State) -> float:
    """Return how far the steps before time 0 leave the model from its state of rest, relative to that (collective)."""
    with _start_state(plant, exact_uplift=True) as settled:
        settled.displacement.axpy(-1.0, static.displacement)
        away = settled.displacement.norm() + _settings(plant).step * settled.velocity.norm()
    size = static.displacement.norm()
    return float(away / size) if size > 0 else float(away > 0)


def _fourier(plant: Plant, request: Request, film: Film | None, groups: int | None, watch: Watch | None) -> Analysis:
    from solvers import fourier
    from solvers.harmonic import FourierResponse, harmonic_sweep, shares_beyond

    window: Window | None = plant.scene.fourier
    assert window is not None
    with plant.clock.remainder("solution"):
        transfer = harmonic_sweep(plant.operators, 2 * np.pi * window.frequencies, groups=groups, watch=watch)
        plant.clock.add("factorisation", transfer.factor_seconds)
        response = FourierResponse(plant.operators, window, transfer)
        passes = run_passes(response.history, plant, request)
        again = fourier.inverse_by_sum(response.probe_spectrum(passes.final.release), window.samples)
        check = float(np.max(np.abs(again - passes.final.probes), initial=0.0))
        acted = passes.final.release
        film_at(film, window.samples, response.field(acted))
        if film is not None:
            strongest = 1 + int(np.argmax(np.max(np.abs(response.probe_spectrum(acted)[1:]), axis=1)))
            amplitudes = response.amplitudes(acted, strongest)
            if amplitudes is not None:
                film.note_amplitude(float(window.frequencies[strongest]), amplitudes)
        cut, folded = shares_beyond(plant.operators, window)
        left = response.left_over(passes.final)
    if left > WRAPPED and passes.ended not in ("diverged", "not converged"):  # else it is no response
        log.warning("wrap-around: %.1g of the largest response is left at the end of the window and acts on its start: lengthen it", left)
    if folded > LOST:
        log.warning("aliasing: %.1g of the load's energy is above half the sampling rate and comes back lower: sample finer", folded)
    elif cut > LOST:
        log.warning("%.1g of the load's energy lies above the cutoff of %g Hz and is missed: raise it", cut, window.cutoff)
    notes = {
        "frequencies": len(window.frequencies),
        "response_left_at_end_of_window": left,
        "load_energy_above_cutoff": cut,
        "load_energy_above_nyquist": folded,
    }
    return Analysis("time-frequency", passes, False, transform_check=check, notes=notes)


def _modal(plant: Plant, request: Request, film: Film | None) -> Analysis:
    from solvers import reduced
    from solvers.modal import modes

    settings, modal, exact = _settings(plant), plant.scene.modal, request.passes is None
    assert modal is not None
    operators = plant.operators
    with plant.clock.phase("modes"):
        found = modes(operators, number=modal.number, band=modal.band, shift=modal.shift)
        basis = found.basis
        if modal.static_correction:
            basis = reduced.with_static_answers(operators, basis)
        elif exact and operators.contacts.names:
            log.warning("modes alone give the contact forces badly and exact uplift with them: set modal.static_correction = true")
        model = reduced.project(operators, basis, diagonal=modal.diagonal)
    with plant.clock.phase("solution"):
        if settings.start == "rest":
            start = reduced.at_rest(model)
        elif settings.start == "static":
            start = reduced.static_state(model, exact_uplift=exact)
        else:
            settling = settings.settling
            scheme = Scheme(settling.beta, settling.gamma)
            start = reduced.settled_state(model, scheme, settling.step, settling.steps, exact_uplift=exact)
        marched: list[reduced.ReducedMarch] = []

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
    notes = {
        "modes": found.number,
        "basis_vectors": basis.size,
        "frequencies_Hz": found.frequencies.tolist(),
        "largest_mode_residual": float(np.max(found.residuals, initial=0.0)),
        "orthonormality": found.orthonormality,
        "sturm_count": found.sturm.inside,
    }
    return Analysis("modal", passes, exact, lifted=None if passes.ended == "diverged" else share.result(), notes=notes)
