"""Sweeps over frequencies of an assembled scene: convolution with exact uplift, or the Fourier sweep of the published passes."""

from __future__ import annotations

import numpy as np

from uplift.drivers.analysis.assembled_scene import Analysis
from uplift.drivers.analysis.envelopes import envelopes_of
from uplift.drivers.analysis.initial_state import rest_state, rests
from uplift.drivers.analysis.observers import LiftedShare, take_snapshots
from uplift.drivers.analysis.passes import run_passes
from uplift.drivers.analysis.task import Task
from uplift.meshes.checked import ModelError
from uplift.meshes.findings import say
from uplift.solvers.contact.published_passes import Passes
from uplift.solvers.frequency_domain.window import Window

WRAPPED = 0.01
"""Part of the largest response that may be left at the end of a window before the run warns of wrap-around."""

LOST = 1e-4
"""Share of a load's energy, 1 % in amplitude, that may lie above the band of a window before the run warns."""


def run_laplace(task: Task) -> Analysis:
    """Sweep over Laplace points and march with exact uplift (collective)."""
    from uplift.solvers.frequency_domain.laplace import laplace_run

    settings, operators, clock = task.settings, task.operators, task.assembly.clock
    with clock.remainder("sweep" if task.reduced else "solution"):
        start = rest_state(task)
        if not rests(task, start):
            words = "the sweep starts from a state of rest, and the settling steps end in motion; set start = 'static'"
            raise ModelError("transient.start", words)
        with start:
            run = laplace_run(
                operators, settings.scheme, settings.step, settings.steps, start,
                every=settings.every, at_zero=settings.start == "rest", groups=task.groups, watch=task.watch,
            )
        clock.add("factorisation", run.factor_seconds)
        clock.add("march", run.march_seconds)
        share = LiftedShare(task.assembly, settings.archived)
        for row in np.flatnonzero(share.rows):
            values = run.field(row)
            if values is not None:
                share.watch(row, values)
        take_snapshots(task, len(settings.archived), run.field)
    notes = task.notes | {"laplace_points": run.points}
    envelopes = envelopes_of(task, settings.archived, run.field)
    return Analysis(
        "time-frequency", Passes([run.history], number=1), True, tries=run.tries, lifted=share.result(), notes=notes, envelopes=envelopes
    )


def run_fourier(task: Task) -> Analysis:
    """Sweep over frequencies and run the published passes (collective)."""
    from uplift.solvers.frequency_domain import fourier
    from uplift.solvers.frequency_domain.harmonic import FourierResponse, harmonic_sweep, shares_beyond

    window: Window | None = task.assembly.scene.fourier
    assert window is not None
    operators, clock, snapshots = task.operators, task.assembly.clock, task.snapshots
    with clock.remainder("sweep" if task.reduced else "solution"):
        transfer = harmonic_sweep(operators, 2 * np.pi * window.frequencies, groups=task.groups, watch=task.watch)
        clock.add("factorisation", transfer.factor_seconds)
        response = FourierResponse(operators, window, transfer)
        passes = run_passes(response.history, task)
        again = fourier.inverse_by_sum(response.probe_spectrum(passes.final.release), window.samples)
        check = float(np.max(np.abs(again - passes.final.probes), initial=0.0))
        acted = passes.final.release
        take_snapshots(task, window.samples, response.field(acted))
        if snapshots is not None:
            strongest = 1 + int(np.argmax(np.max(np.abs(response.probe_spectrum(acted)[1:]), axis=1)))
            amplitudes = response.amplitudes(acted, strongest)
            if amplitudes is not None:
                snapshots.note_amplitude(float(window.frequencies[strongest]), amplitudes)
        cut, folded = shares_beyond(operators, window)
        left = response.left_over(passes.final)
    if left > WRAPPED and passes.ended not in ("diverged", "not converged"):  # else it is no response
        share = f"{left:.1%} of the largest response"
        say("wrap-around", f"wrap-around: {share} is left at the end of the window and acts on its start: lengthen it")
    if folded > LOST:
        say("aliasing", f"aliasing: {folded:.1%} of the load's energy is above half the sampling rate and comes back lower: sample finer")
    elif cut > LOST:
        say("cutoff", f"{cut:.1%} of the load's energy lies above the cutoff of {window.cutoff:g} Hz and is missed: raise it")
    notes = task.notes | {
        "frequencies": len(window.frequencies),
        "response_left_at_end_of_window": left,
        "load_energy_above_cutoff": cut,
        "load_energy_above_nyquist": folded,
    }
    envelopes = None if passes.ended == "diverged" else envelopes_of(task, window.times, response.field(acted))
    return Analysis("time-frequency", passes, False, transform_check=check, notes=notes, envelopes=envelopes)
