"""What a march in time archives, and how it is kept in a checkpoint."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from scipy import sparse

from forms.operators import Operators
from solvers.contact import ContactProblem
from solvers.energy import EnergyMeter
from solvers.history import History
from solvers.joints import FreeNodes
from solvers.watch import Watch

if TYPE_CHECKING:
    from solvers.newmark import State


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
        """Motions of auxiliary nodes with masses that count, see `solvers.joints`."""
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


class KeptMarch:
    """A march in its checkpoint: the state, what it has archived, and the books that are kept along it."""

    def __init__(self, watch: Watch | None, comm: Any, problem: ContactProblem | None, state: State, record: Record) -> None:
        """Take what is saved, and written over by `read`."""
        self._checkpoint = watch.checkpoint if watch is not None else None
        self._name = watch.name("march") if watch is not None else ""
        self._comm = comm
        self._problem = problem
        self._state = state
        self._record = record

    def save(self, n: int) -> None:
        """Write everything as it stands after step `n` (collective)."""
        checkpoint, state, record, problem = self._checkpoint, self._state, self._record, self._problem
        assert checkpoint is not None
        arrays = {
            "step": np.array(n),
            "release": state.release,
            "acted": record.acted,
            "nodes": state.nodes if state.nodes is not None else np.zeros(0),
            "moved": record.moved,
            "peak": np.array([record.farthest, record.peak]),
            "problems": np.array([problem.tries, problem.solved] if problem is not None else [0, 0]),
        }
        shares = {"seen": record.seen, "felt": record.felt}
        if record.observer is not None:
            shares["observed"], fields = record.observer.kept()
            whole = checkpoint.rows.gather(fields)
            arrays["filmed"] = whole if whole is not None else np.zeros((0, 0))
        for name, share in shares.items():
            # Rank by rank, not summed: sums are taken at the end, in the same order as without a break.
            parts = self._comm.gather(share)
            arrays[name] = np.array(parts if parts is not None else [])
        vectors = {"displacement": state.displacement, "velocity": state.velocity, "acceleration": state.acceleration}
        for name, local in {**{k: v.array_r for k, v in vectors.items()}, "peak field": record.peak_field}.items():
            whole = checkpoint.rows.gather(np.real(local))
            arrays[name] = whole if whole is not None else np.zeros(0)
        if record.meter is not None:
            arrays["energy"], arrays["work"] = record.meter.books()
        checkpoint.save(self._name, arrays)

    def read(self) -> int:
        """Return to the checkpoint, if there is one; return the step that it was made after, -1 without one (collective)."""
        checkpoint, state, record = self._checkpoint, self._state, self._record
        found = checkpoint.load(self._name) if checkpoint is not None else None
        if checkpoint is None or found is None:
            return -1
        large = {"seen", "felt", "observed", "filmed", "displacement", "velocity", "acceleration", "peak field"}
        small = self._comm.bcast({k: v for k, v in found.items() if k not in large})
        state.release = small["release"]
        state.nodes = small["nodes"] if small["nodes"].size else None
        record.acted[:], record.moved[:] = small["acted"], small["moved"]
        record.farthest, record.peak = float(small["peak"][0]), int(small["peak"][1])
        if self._problem is not None:
            self._problem.tries, self._problem.solved = (int(v) for v in small["problems"])
        if record.meter is not None:
            record.meter.restore(small["energy"], small["work"])
        record.seen[:] = self._shares(found.get("seen"))
        record.felt[:] = self._shares(found.get("felt"))
        if record.observer is not None:
            filmed = found.get("filmed")
            width = self._comm.bcast(filmed.shape[1] if filmed is not None else 0)
            record.observer.restore(self._shares(found.get("observed")), checkpoint.rows.scatter(filmed, (width,), float))
        for name, vector in (
            ("displacement", state.displacement), ("velocity", state.velocity), ("acceleration", state.acceleration),
        ):
            vector.array[:] = checkpoint.rows.scatter(found.get(name), (), float)
        record.peak_field[:] = checkpoint.rows.scatter(found.get("peak field"), (), float)
        return int(small["step"])

    def _shares(self, stacked: np.ndarray | None) -> np.ndarray:
        """Give each rank its own share again; on another number of ranks, the sum of all to the first (collective)."""
        parts = None
        if stacked is not None:
            size = self._comm.size
            parts = list(stacked) if len(stacked) == size else [sum(stacked), *[0.0 * stacked[0]] * (size - 1)]
        return np.asarray(self._comm.scatter(parts))
