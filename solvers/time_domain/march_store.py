"""How a march in time is kept in a checkpoint."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from uplift.solvers.contact.step import ContactProblem
from uplift.solvers.time_domain.observers import Record
from uplift.solvers.watch import Watch

if TYPE_CHECKING:
    from uplift.solvers.time_domain.state import State


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
