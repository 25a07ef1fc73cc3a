"""Integration in time without steps: exact between contact events, or with contact forces that are polynomials in time."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import Analysis, ContactEvents
from uplift.drivers.analysis.envelopes import envelopes_of
from uplift.drivers.analysis.initial_conditions import with_initial_conditions
from uplift.drivers.analysis.initial_state import rest_state, rests
from uplift.drivers.analysis.observers import LiftedShare, Watchers
from uplift.drivers.analysis.task import Task
from uplift.meshes.checked import ModelError
from uplift.meshes.findings import say
from uplift.solvers.contact.published_passes import Passes
from uplift.solvers.history import History, farthest
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.state import load_values

if TYPE_CHECKING:
    from uplift.solvers.time_domain.exact.model import DenseModel
    from uplift.solvers.time_domain.exact.solution import ExactHistory
    from uplift.solvers.time_domain.exact.starts import Start

MAX_DENSE_DOFS = 200
"""Up to so many dofs the motion is exact in all of them; a larger model is projected on a Krylov basis first."""

BASIS_TOLERANCE = 1e-8
"""Of that basis, where the request names none."""

DOUBTFUL_ERROR = 0.02
"""Relative error in time from which on a finding says so."""


def run_exact(task: Task) -> Analysis:
    """March from contact event to contact event, or by collocation where contacts are many (collective)."""
    if not task.exact:
        raise ModelError("run.iterations", "the method exact knows no published passes")
    if not task.reduced and task.operators.n > MAX_DENSE_DOFS:
        return _in_small_basis(task)
    from uplift.solvers.time_domain.exact.model import dense_model
    from uplift.solvers.time_domain.exact.solution import solve
    from uplift.solvers.time_domain.exact.starts import rest_start, static_start

    settings = task.settings
    with task.assembly.clock.phase("march" if task.reduced else "solution"):
        model = dense_model(task.operators)
        if settings.start == "settled":
            with static_state(task.operators, exact_uplift=True) as static:
                if not rests(task, static):
                    words = "the method exact starts from a state of rest, and the settling steps end in motion; set start = 'static'"
                    raise ModelError("transient.start", words)
        if any(model.internal) or task.assembly.plate.model.initial:
            start = _whole_start(task)
        else:
            start = rest_start(model) if settings.start == "rest" else static_start(model)
        found = solve(model, settings.archived, start, energy=True)
        history, lifted = _history(task, model, found), _lifted(task, found)
    if found.error > DOUBTFUL_ERROR:
        say("error in time", f"the time integration is estimated to be off by {found.error:.1%} of the largest value of its kind")
    envelopes = envelopes_of(task, found.times, lambda row: task.operators.reconstruct(_own(task, found.displacement[row])))
    partial = {name for group in task.operators.outputs.groups if group.inertia for name in group.names}
    notes, events = task.notes | _notes(model, found, partial), _events(model, found)
    return Analysis("exact", Passes([history], number=1), True, lifted=lifted, notes=notes, events=events, envelopes=envelopes)


def _in_small_basis(task: Task) -> Analysis:
    from uplift.drivers.analysis.basis import basis_notes, basis_of
    from uplift.solvers.bases.project import project

    basis, settings = basis_of(task.assembly, task.request.basis or BASIS_TOLERANCE, task.request.basis_file)
    with project(task.operators, basis) as small:
        return run_exact(replace(task, operators=small, notes={"basis": basis_notes(basis, settings)}))


def _history(task: Task, model: DenseModel, found: ExactHistory) -> History:
    """Return the archived outputs in the order of the model's own."""
    outputs = task.operators.outputs
    column = 0
    values, second = np.zeros((2, len(found.times), outputs.local.shape[0]))
    for name, rows in outputs.layout.items():
        if name == "elongation":
            values[:, rows] = found.displacement @ model.elongation.T
        else:
            here = slice(column, column + rows.stop - rows.start)
            values[:, rows], second[:, rows] = found.outputs[:, here], found.accelerations[:, here]
            column = here.stop
    loads = load_values(task.operators, found.times)
    for group, rows in zip(outputs.groups, outputs.layout.values(), strict=True):  # springs and velocities are in them already
        if group.per_load is not None:
            values[:, rows] += loads @ group.per_load.T
        if group.inertia:
            values[:, rows] += second[:, outputs.layout[group.inertia]]
    probes = outputs.layout["probes"]
    peak = int(np.argmax(farthest(values[:, probes], task.operators.probes.moving)))
    return History(
        found.times, values, outputs, found.release, peak, task.operators.reconstruct(_own(task, found.displacement[peak])),
        found.ledger, found.accelerations[:, : probes.stop - probes.start], found.gap,
    )


def _whole_start(task: Task) -> Start:
    """Return the start of a model with gaps, preloads or initial conditions (collective)."""
    from uplift.solvers.time_domain.exact.starts import Start

    with with_initial_conditions(task, rest_state(task)) as state:
        displacement, velocity = (
            np.concatenate(task.operators.comm.allgather(np.real(vector.array_r).copy())) for vector in (state.displacement, state.velocity)
        )
    return Start(displacement, velocity, state.release)


def _own(task: Task, displacement: np.ndarray) -> np.ndarray:
    """Return this rank's rows of a displacement (n_dofs, ...) in all dofs of the model that is solved."""
    first, last = task.operators.stiffness.getOwnershipRange()
    return displacement[first:last]


def _lifted(task: Task, found: ExactHistory) -> np.ndarray | None:
    """Take snapshots and the lifted share of the area (nt,) in percent, where the scene asks for them."""
    share = LiftedShare(task.assembly, found.times)
    if task.snapshots is not None:
        task.snapshots.start(len(found.times))
    watchers = Watchers(task, share)
    for row in range(len(found.times)):
        if watchers.wants(row):
            watchers.watch(row, task.operators.reconstruct(_own(task, found.displacement[row])))
    return share.result()


def _events(model: DenseModel, found: ExactHistory) -> ContactEvents | None:
    if found.events is None:
        return None
    return ContactEvents(
        np.array([event.time for event in found.events]),
        tuple(model.names[event.contact] for event in found.events),
        tuple("opens" if event.opens else "closes" for event in found.events),
        np.array([event.speed for event in found.events]),
    )


def _notes(model: DenseModel, found: ExactHistory, partial: set[str]) -> dict[str, Any]:
    """Return what the summary says: how it was done, the error in time, and extremes between the archived instants.

    Of the outputs `partial` that have parts in accelerations and loads as well, extremes between instants are not known.
    """
    notes: dict[str, Any] = {"reason": found.reason, "relative_error_in_time": found.error}
    if found.events is not None:
        notes["events"] = len(found.events)
    if found.peak_values is not None and found.peak_times is not None:
        names = [*model.output_names, *(f"{name} force" for name in model.names), *(f"{name} gap" for name in model.names)]
        notes["extremes_between_instants"] = {
            name: {"max": float(high), "t_max": float(t_high), "min": float(low), "t_min": float(t_low)}
            for name, high, low, t_high, t_low in zip(names, *found.peak_values, *found.peak_times, strict=True)
            if name not in partial
        }
    return {"exact": notes}
