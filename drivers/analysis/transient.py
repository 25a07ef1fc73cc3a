"""Integration in time of an assembled scene, in all dofs or in a basis."""

from __future__ import annotations

import numpy as np

from uplift.drivers.analysis.assembled_scene import Analysis
from uplift.drivers.analysis.envelope_data import EnvelopeData
from uplift.drivers.analysis.envelopes import Envelopes, envelopes_in_time
from uplift.drivers.analysis.equilibrium import equilibrium_notes, equilibrium_of
from uplift.drivers.analysis.initial_state import start_state
from uplift.drivers.analysis.observers import LiftedShare, Watchers
from uplift.drivers.analysis.passes import run_passes
from uplift.drivers.analysis.task import Task
from uplift.solvers.contact.published_passes import Passes
from uplift.solvers.history import History
from uplift.solvers.time_domain.equilibrium import Equilibrium
from uplift.solvers.time_domain.march import Stepper, stepper_of, transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.observers import Observer
from uplift.solvers.time_domain.state import State, load_values

LEDGER_DOFS = 50_000
"""Up to this size the ledger of energies is kept, whose products of matrix and vector then cost less than the rest of a step."""


def run_transient(task: Task) -> Analysis:
    """March through the scene's time, uplift exact or by the published passes (collective)."""
    settings, operators, clock = task.settings, task.operators, task.assembly.clock
    with (
        clock.remainder("march" if task.reduced else "solution"),
        start_state(task) as start,
        stepper_of(operators, settings.scheme, settings.step, exact_uplift=task.exact, rigid_modes=task.rigid_modes) as stepper,
    ):
        if isinstance(stepper, Newmark):
            clock.add("factorisation", stepper.solver.factor_seconds)
        equilibrium = _equilibrium(task, stepper)
        passes, lifted, envelopes = _march(task, start, stepper, [] if equilibrium is None else [equilibrium])
        tries = stepper.contacts.tries if stepper.contacts is not None else None
    notes = task.notes | (equilibrium_notes(task.assembly, equilibrium) if equilibrium is not None and passes.ended != "diverged" else {})
    return Analysis(task.request.method, passes, task.exact, tries=tries, lifted=lifted, notes=notes, envelopes=envelopes)


def _equilibrium(task: Task, stepper: Stepper) -> Equilibrium | None:
    """Return what watches the equilibrium, which holds at the instants themselves.

    None in a basis, for schemes that balance between them, and for heavy joints, whose nodes swing below open contacts.
    """
    scheme, contacts = task.settings.scheme, stepper.contacts
    if task.reduced or scheme.alpha_m or scheme.alpha_f or (contacts is not None and contacts.n_inner):
        return None
    return equilibrium_of(task.assembly, load_values(task.operators, task.settings.archived), task.settings.every)


def _march(
    task: Task, start: State, stepper: Stepper, observers: list[Observer]
) -> tuple[Passes, np.ndarray | None, EnvelopeData | None]:
    """Return the histories, the lifted share of the area (nt,) in percent and the envelopes, where the scene asks for them."""
    settings, snapshots = task.settings, task.snapshots
    share = LiftedShare(task.assembly, settings.archived)
    watchers = Watchers(task, share) if snapshots is not None or share.rows.any() else None

    looking: list[Envelopes] = []

    def solve(release: np.ndarray | None) -> History:
        looking[:] = envelopes_in_time(task, settings.archived, settings.every)
        if snapshots is not None:
            snapshots.start(len(settings.archived))
        return transient(
            stepper, start, settings.steps, every=settings.every, release=release,
            energy=task.operators.n <= LEDGER_DOFS, watcher=watchers, more=[*observers, *looking], watch=task.watch,
        )

    passes = Passes([solve(None)], number=1) if task.exact else run_passes(solve, task)
    if passes.ended == "diverged":
        return passes, None, None
    return passes, share.result(), looking[0].finished() if looking else None
