"""What a march in time archives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy import sparse

from uplift.forms.operators import Operators
from uplift.solvers.contact.auxiliary_nodes import FreeNodes
from uplift.solvers.history import History
from uplift.solvers.time_domain.energy import EnergyMeter

if TYPE_CHECKING:
    from uplift.solvers.time_domain.state import State


class Observer(Protocol):
    """Looks at the displacements at the archived instants."""

    def watch(self, row: int, values: np.ndarray) -> None:
        """Take this rank's part (n_local,) of the displacements at the archived instant `row`."""

    def kept(self) -> tuple[np.ndarray, np.ndarray]:
        """Return what a checkpoint has to keep: this rank's shares of sums, and fields (n_local, k), k the same on all ranks."""

    def restore(self, shares: np.ndarray, fields: np.ndarray) -> None:
        """Take in again what `kept` gave."""


class Record:
    """What a march archives."""

    def __init__(
        self,
        operators: Operators,
        n_archived: int,
        meter: EnergyMeter | None,
        observer: Observer | None,
        nodes: FreeNodes | None = None,
    ) -> None:
        """Make room for `n_archived` instants; `nodes` are those of auxiliary nodes with masses that count."""
        self.meter = meter
        self.observer = observer
        self._operators = operators
        self._observed = [operators.probes, operators.contacts.elongation]
        if operators.reactions is not None:
            self._observed.append(operators.reactions.functionals)
        self._looks = sparse.vstack([functionals.local for functionals in self._observed], format="csr")
        self._n_probes = len(operators.probes.names)
        self.seen = np.zeros((n_archived, self._looks.shape[0]))
        """This rank's shares of all functionals."""
        self.felt = np.zeros((n_archived, self._n_probes))
        """This rank's shares of the probes' accelerations."""
        self.acted = np.zeros((n_archived, operators.contacts.law.n_channels))
        self._nodes = nodes
        self.moved = np.zeros((4, n_archived if nodes is not None else 0, operators.contacts.law.n_contacts))
        """Motions of auxiliary nodes with masses that count, see `uplift.solvers.contact.auxiliary_nodes`."""
        self.farthest, self.peak = -1.0, 0
        self.peak_field = np.zeros(operators.n_local)

    def add(self, state: State, values: np.ndarray, *, row: int | None, step: float = 0.0) -> None:
        """Take a state `step` s after the one before, archived in `row` unless that is None (collective)."""
        if self.meter is not None:
            self.meter.add(state.displacement, state.velocity, values, state.release, step=step, archive=row is not None)
        if row is None:
            return
        here = np.real(state.displacement.array_r)
        self.seen[row] = self._looks @ here
        self.felt[row] = self._operators.probes.partial(np.real(state.acceleration.array_r))
        self.acted[row] = state.release
        if self._nodes is not None:
            self.moved[:, row] = self._nodes.still(state.release) if state.nodes is None else state.nodes
        if self.observer is not None:
            self.observer.watch(row, here)
        reach = np.max(np.abs(self._operators.probes.total(self.seen[row, : self._n_probes])), initial=0.0)
        if reach > self.farthest:
            self.farthest, self.peak = float(reach), row
            self.peak_field[:] = here

    def history(self, archived: np.ndarray) -> History:
        """Return what was archived at these instants (collective)."""
        reactions = self._operators.reactions
        ends = np.cumsum([len(functionals.names) for functionals in self._observed])
        probes, elongation, *resultants = np.split(self._operators.probes.total(self.seen), ends[:-1], axis=1)
        nodes = self._nodes
        standing, gap = (self.acted, None) if nodes is None else (nodes.on_ground(self.acted, self.moved), nodes.gap(self.moved))
        forces = reactions.values(resultants[0], standing) if reactions is not None else np.zeros((len(archived), 0))
        ledger = self.meter.ledger() if self.meter is not None else None
        felt = self._operators.probes.total(self.felt)
        return History(archived, probes, elongation, self.acted, forces, self.peak, self.peak_field, ledger, felt, gap)
