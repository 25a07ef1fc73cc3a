"""The exact motion of a dense model: from loads and a start to histories, events, extremes and energies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.solvers.contact.step import ContactProblem, settled_release
from uplift.solvers.errors import SolverError
from uplift.solvers.history import Ledger
from uplift.solvers.time_domain.exact.contact_set import ContactSet
from uplift.solvers.time_domain.exact.energies import Energies
from uplift.solvers.time_domain.exact.event_march import Event, EventMarch, Piece
from uplift.solvers.time_domain.exact.first_order import FirstOrder, first_order
from uplift.solvers.time_domain.exact.forcing import Forcing, forcing
from uplift.solvers.time_domain.exact.model import DenseModel
from uplift.solvers.time_domain.exact.observed import Observed
from uplift.solvers.time_domain.exact.peaks import Peaks


@dataclass(frozen=True)
class Start:
    """What a march begins from."""

    displacement: np.ndarray
    """(n_dofs,)."""
    velocity: np.ndarray
    """(n_dofs,)."""
    release: np.ndarray
    """(n_c,) N."""


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
    events: list[Event]
    """In the order of time; none is known where contact forces are polynomials in time."""
    peak_values: np.ndarray | None
    """(2, n_o + 2 n_c): largest and smallest value of outputs, contact forces and gaps, also between instants."""
    peak_times: np.ndarray | None
    """(2, n_o + 2 n_c) s."""
    ledger: Ledger | None
    note: str
    """What was done, for the summary."""


def rest_start(model: DenseModel) -> Start:
    """Return the state of no displacement, velocity and release force."""
    n = len(model.mass)
    return Start(np.zeros(n), np.zeros(n), np.zeros(len(model.names)))


def static_start(model: DenseModel) -> Start:
    """Return the state of rest under the static loads, contacts lifted where they pull.

    Raises `ModelError` if the loads lift or tip the structure off its contacts and nothing else holds it.
    """
    values = np.array([h(np.zeros(1))[0] if static else 0.0 for h, static in zip(model.histories, model.static, strict=True)])
    force = model.loads @ values
    try:
        answers = np.linalg.solve(model.stiffness, np.column_stack([force, model.push]))
    except np.linalg.LinAlgError:
        raise SolverError("nothing holds the structure: it has no static state") from None
    pull = model.law.stiffness[:, None] * model.elongation
    problem = ContactProblem(model.law, pull @ answers[:, 1:])
    release = settled_release(problem, pull @ answers[:, 0], float(np.abs(force).max(initial=0.0)))
    return Start(answers @ np.concatenate([[1.0], release]), np.zeros(len(force)), release)


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


def exact_history(
    model: DenseModel, instants: np.ndarray, start: Start, *, peaks: bool = True, energy: bool = False
) -> ExactHistory:
    """Return the exact motion from `start` at the first of `instants` (nt,) s to the last, archived at each.

    `peaks` looks for extremes between instants, `energy` keeps the ledger. Raises `SolverError` for a signal or a model that the
    march cannot take.
    """
    system, loads = first_order(model), forcing(model.histories, instants)
    archive = _Archive(instants)
    march = EventMarch(system, loads, model.law.flexibility, archive.observe)
    observed = Observed(model, system, march.base)
    archive.peaks = Peaks(observed) if peaks else None
    archive.energies = Energies(model, march.base, observed) if energy else None
    march.run(started(system, loads, start), start.release > 0)
    held = archive.peaks
    return ExactHistory(
        instants,
        *_histories(observed, archive.states),
        march.events,
        held.value if held is not None else None,
        held.time if held is not None else None,
        archive.energies.ledger() if archive.energies is not None else None,
        f"{len(march.events)} contact events, {march.sets_made} sets of open contacts",
    )


def started(system: FirstOrder, loads: Forcing, start: Start) -> np.ndarray:
    """Return the state (n,) of the system at the first edge of its loads."""
    values = loads.constant.copy()
    values[loads.varying] = loads.coefficients[0, :, 0]
    return system.state(start.displacement, start.velocity, values, start.release)


def _histories(observed: Observed, states: list[tuple[ContactSet, np.ndarray]]) -> list[np.ndarray]:
    """Return outputs, accelerations, contact forces, release forces, gaps and displacements, set by set."""
    n_o, n_c = observed.n_outputs, observed.n_contacts
    kept: dict[bytes, list[int]] = {}
    for row, (regime, _) in enumerate(states):
        kept.setdefault(regime.open.tobytes(), []).append(row)
    found: list[np.ndarray] = []
    for rows in kept.values():
        regime = states[rows[0]][0]
        seen, displacement = observed.rows(regime), observed.displacement(regime)
        acceleration = seen[:n_o] @ regime.generator @ regime.generator
        parts = (seen[:n_o], acceleration, seen[n_o : n_o + n_c], regime.release, seen[n_o + n_c :], displacement)
        if not found:
            found = [np.empty((len(states), len(part))) for part in parts]
        whole = np.stack([states[row][1] for row in rows])
        for target, part in zip(found, parts, strict=True):
            target[rows] = whole @ part.T
    return found
