"""The exact motion of a dense model: from loads and a start to histories, events, extremes and energies."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uplift.solvers.history import Ledger
from uplift.solvers.time_domain.exact.choice import LONGEST_ITERATED, MOST_HALVINGS, choose, contact_frequency
from uplift.solvers.time_domain.exact.collocation import Collocation
from uplift.solvers.time_domain.exact.contact_set import ContactSet
from uplift.solvers.time_domain.exact.energies import Energies
from uplift.solvers.time_domain.exact.event_march import Event, EventMarch, Piece
from uplift.solvers.time_domain.exact.first_order import FirstOrder, first_order
from uplift.solvers.time_domain.exact.forcing import Forcing, forcing
from uplift.solvers.time_domain.exact.model import DenseModel
from uplift.solvers.time_domain.exact.observed import Observed, carried_by_stiff
from uplift.solvers.time_domain.exact.peaks import Peaks
from uplift.solvers.time_domain.exact.starts import Start


@dataclass(frozen=True)
class ExactHistory:
    """Histories at instants (nt,), the same on every rank."""

    times: np.ndarray
    """(nt,) s."""
    outputs: np.ndarray
    """(nt, n_o), as `DenseModel.output_names`."""
    accelerations: np.ndarray
    """(nt, n_o): their second derivatives, from the side of later times."""
    force: np.ndarray
    """(nt, n_c) N, contact forces, compression positive."""
    release: np.ndarray
    """(nt, n_c) N."""
    gap: np.ndarray
    """(nt, n_c) m."""
    displacement: np.ndarray
    """(nt, n_dofs)."""
    velocity: np.ndarray
    """(nt, n_dofs), from the side of later times; with polynomial contact forces it lacks what `by_collocation` says."""
    events: list[Event] | None
    """In the order of time; None where contact forces are polynomials in time."""
    peak_values: np.ndarray | None
    """(2, n_o + 2 n_c): largest and smallest value of outputs, contact forces and gaps, also between instants."""
    peak_times: np.ndarray | None
    """(2, n_o + 2 n_c) s."""
    ledger: Ledger | None
    reason: str
    """Which time integration was taken and why."""
    error: float
    """Estimate of the largest error in time of outputs and contact forces, as a part of their largest values: 0 from event to event."""


def solve(
    model: DenseModel, instants: np.ndarray, start: Start, *, tolerance: float = 1e-6, peaks: bool = True, energy: bool = False
) -> ExactHistory:
    """Return the motion from `start` at the first of `instants` (nt,) s to the last, archived at each.

    It is exact from event to event for few contacts; for many, contact forces are polynomials in steps that are halved until the error
    in time is below `tolerance` of the largest output of each unit. From event to event, `peaks` looks for extremes between instants and
    `energy` keeps the ledger. Raises `SolverError` for a signal or a model that neither can take.
    """
    system, loads = first_order(model), forcing(model.histories, instants)
    interval = float(np.diff(instants).max())
    choice = choose(system, interval)
    if choice.events:
        return from_events(model, system, loads, instants, start, reason=choice.reason, peaks=peaks, energy=energy)
    step = interval
    while contact_frequency(system) * step > LONGEST_ITERATED:
        step /= 2
    coarse = by_collocation(model, system, loads, instants, start, step=step)
    while True:
        step /= 2
        fine = by_collocation(model, system, loads, instants, start, step=step)
        apart = differences(model, fine, coarse.outputs, coarse.force)
        error = apart.relative / (2**KINK_ORDER - 1)
        if error <= tolerance or step * 2**MOST_HALVINGS < LONGEST_ITERATED * interval:
            return replace(fine, reason=f"{choice.reason}; degree 3, steps of {step:g} s", error=error)
        coarse = fine


KINK_ORDER = 3
"""Order of the collocation while contacts change (measured in its test)."""


@dataclass(frozen=True)
class Differences:
    """How far other histories are from a solution, at its instants."""

    outputs: np.ndarray
    """(n_o,): largest difference of each output, in its unit."""
    force: np.ndarray
    """(n_c,) N: of each contact force."""
    relative: float
    """The largest of all, as a part of the largest value of any output with the same unit, or of any contact force."""


def differences(model: DenseModel, solution: ExactHistory, outputs: np.ndarray, force: np.ndarray) -> Differences:
    """Return how far `outputs` (nt, n_o) and contact forces `force` (nt, n_c) N are from a solution at the same instants.

    That is the error in time of another time integration of the same model, as far as the solution has none.
    """
    apart = np.abs(outputs - solution.outputs).max(axis=0, initial=0.0)
    apart_force = np.abs(force - solution.force).max(axis=0, initial=0.0)
    units = np.array(model.output_units)
    pairs = [(apart[units == unit], solution.outputs[:, units == unit]) for unit in set(model.output_units)]
    pairs.append((apart_force, solution.force))
    sizes = [(float(a.max(initial=0.0)), float(np.abs(whole).max(initial=0.0))) for a, whole in pairs]
    return Differences(apart, apart_force, max((a / size for a, size in sizes if size > 0), default=0.0))


def from_events(
    model: DenseModel,
    system: FirstOrder,
    loads: Forcing,
    instants: np.ndarray,
    start: Start,
    *,
    reason: str = "",
    peaks: bool = True,
    energy: bool = False,
) -> ExactHistory:
    """Return the exact motion of a model, its `system` under its `loads` (see `solve`, which makes them; eight parameters therefore)."""
    archive = _Archive(instants)
    march = EventMarch(system, loads, model.law.flexibility, archive.observe)
    observed = Observed(model, system, march.base)
    archive.peaks = Peaks(observed) if peaks else None
    archive.energies = Energies(model, march.base, observed) if energy else None
    march.run(system.state(start.displacement, start.velocity), start.release > 0)
    held = archive.peaks
    if held is not None:
        held.finish()
    outputs, accelerations, force, release, gap, displacement, velocity = _histories(observed, archive.states)
    return ExactHistory(
        instants, outputs, accelerations, force, release, gap, displacement, velocity,
        events=march.events,
        peak_values=held.value if held is not None else None,
        peak_times=held.time if held is not None else None,
        ledger=archive.energies.ledger() if archive.energies is not None else None,
        reason=f"{reason}: {len(march.events)} events, {march.sets_made} sets",
        error=0.0,
    )


def by_collocation(
    model: DenseModel, system: FirstOrder, loads: Forcing, instants: np.ndarray, start: Start, *, order: int = 3, step: float
) -> ExactHistory:
    """Return the motion with contact forces of degree `order` in steps of at most `step` s (see `solve`; seven parameters therefore).

    Velocities and accelerations lack what loads and contact forces add to massless dofs at once. Raises `SolverError` if contacts are
    too stiff for the step.
    """
    march = Collocation(system, loads, order, step)
    states, release = march.run(system.state(start.displacement, start.velocity))
    rows = np.searchsorted(loads.edges, instants)
    states, release = states[rows], release[rows]
    base, n = march.base, march.base.n
    displacement = states @ base.rows(system.T, system.U).T + release @ system.W.T
    tension = states @ base.rows(system.Q, system.D).T + release @ system.E.T
    outputs = displacement @ model.outputs.T + release @ model.output_release.T + model.output_constant
    rate = states[:, :n] @ system.A.T + states @ base.F.T @ system.B.T + release @ system.P.T
    if model.output_velocity is not None:
        outputs += rate @ (model.output_velocity @ system.T).T
    carried = carried_by_stiff(model, system)
    if carried is not None:
        outputs -= rate @ (carried[0] @ system.T).T + rate @ (carried[1] @ system.T @ system.A).T
    acceleration = rate @ (model.outputs @ system.T @ system.A).T
    return ExactHistory(
        instants, outputs, acceleration, release - tension, release, release * model.law.flexibility, displacement, rate @ system.T.T,
        events=None, peak_values=None, peak_times=None, ledger=None, reason="", error=float("nan"),
    )


class _Archive:
    """Keeps the states at archived instants and shows every piece to those who add up."""

    def __init__(self, instants: np.ndarray) -> None:
        self._instants = instants.tolist()
        self.states: list[tuple[ContactSet, np.ndarray]] = []
        self.peaks: Peaks | None = None
        self.energies: Energies | None = None

    def observe(self, piece: Piece) -> None:
        if len(self.states) < len(self._instants) and piece.begin == self._instants[len(self.states)]:
            self.states.append((piece.regime, piece.state))
            if self.energies is not None:
                self.energies.archive(piece.regime, piece.state)
        if self.energies is not None:
            self.energies.observe(piece)
        if self.peaks is not None:
            self.peaks.observe(piece)


def _histories(observed: Observed, states: list[tuple[ContactSet, np.ndarray]]) -> list[np.ndarray]:
    """Return outputs, accelerations, contact forces, release forces, gaps, displacements and velocities, set by set."""
    n_o, n_c = observed.n_outputs, observed.n_contacts
    kept: dict[bytes, list[int]] = {}
    for row, (regime, _) in enumerate(states):
        kept.setdefault(regime.open.tobytes(), []).append(row)
    found: list[np.ndarray] = []
    for rows in kept.values():
        regime = states[rows[0]][0]
        seen, displacement = observed.rows(regime), observed.displacement(regime)
        acceleration = seen[:n_o] @ regime.generator @ regime.generator
        velocity = displacement @ regime.generator
        parts = (seen[:n_o], acceleration, seen[n_o : n_o + n_c], regime.release, seen[n_o + n_c :], displacement, velocity)
        if not found:
            found = [np.empty((len(states), len(part))) for part in parts]
        whole = np.stack([states[row][1] for row in rows])
        for target, part in zip(found, parts, strict=True):
            target[rows] = whole @ part.T
    for one_sided in found[2:5]:  # at an event they are zero to round-off, of either sign
        np.maximum(one_sided, 0.0, out=one_sided)
    return found
