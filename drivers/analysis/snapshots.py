"""The deformed plate at a moderate number of instants, and its envelope, recorded while a method runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.meshes.gather import WholeMesh, gather_mesh, gather_nodal

FRAMES = 200
"""Frames at most."""

FILM_BYTES = 2**26
"""Memory at most on each rank; a larger model has fewer frames, evenly spaced."""

COSTLY = 500_000
"""Of fields that are sums over a whole sweep, so many values at most are filmed on each rank."""

FEWEST = 8
"""Fewer frames than this are no film."""


@dataclass(frozen=True)
class SnapshotData(WholeMesh):
    """The whole mesh and what moved on it, on rank 0."""

    peak: np.ndarray
    """(1 or 0, n_nodes, 3) m: the displacement when a probe is farthest from zero, where it was kept."""
    rows: np.ndarray
    """(n_frames,) archived instants that were filmed."""
    snapshots: np.ndarray
    """(n_frames, n_nodes, 3) m, in single precision."""
    envelope: np.ndarray
    """(2 or 0, n_nodes, 3) m: least and largest displacement of each component over `watched` instants."""
    watched: int
    frequency: float = 0.0
    """Hz, of `amplitude`."""
    amplitude: np.ndarray | None = None
    """(n_nodes, 3) m, complex: one-sided amplitudes at the frequency that moves a probe most, where a sweep gave them."""

    lifted: np.ndarray | None = None
    """(nt,) share of the plate's area that has risen, in percent; nan at the instants that were not watched. Not kept in files."""


def vectors_in_space(points: Any) -> np.ndarray:
    """Return points or vectors (n, 2 or 3) as (n, 3)."""
    given = np.asarray(points, dtype=float)
    given = given.reshape(len(given), -1) if given.size else np.zeros((0, 3))
    return np.column_stack([given, np.zeros((len(given), 3 - given.shape[1]))])


class Snapshots:
    """Records this rank's part of the displacements; a method that solves several times films the last."""

    def __init__(self, assembly: AssembledScene) -> None:
        """Take the model that is to be filmed."""
        self._assembly = assembly
        self.rows = np.zeros(0, dtype=int)
        """Rows of the archived instants that make frames."""
        self.start(0)

    def start(self, instants: int, *, costly: bool = False) -> None:
        """Begin anew (collective): `instants` archived instants follow, all of them shown or those of `rows` alone.

        `costly` says that each field has to be summed up from a sweep: a large model then has fewer frames.
        """
        comm, n_local = self._assembly.operators.comm, self._assembly.operators.n_local
        room = FILM_BYTES // max(8 * n_local, 1)
        if costly:
            room = min(room, max(FEWEST, COSTLY // max(n_local, 1)))
        room = comm.allreduce(room, op=min)
        frames = min(FRAMES, room, instants)
        enough = frames >= min(FEWEST, instants)
        self.rows = np.unique(np.round(np.linspace(0, instants - 1, frames)).astype(int)) if enough and frames else np.zeros(0, dtype=int)
        self._frames: dict[int, np.ndarray] = {}
        self._wanted = set(self.rows.tolist())
        self._lowest, self._highest = np.full(n_local, np.inf), np.full(n_local, -np.inf)
        self._lifted = np.full(instants, np.nan)
        self._watched = 0
        self._frequency, self._amplitude = 0.0, np.zeros(0, dtype=complex)

    def note_amplitude(self, frequency: float, values: np.ndarray) -> None:
        """Keep this rank's part (n_local,) of the complex one-sided amplitudes at a frequency in Hz."""
        self._frequency, self._amplitude = frequency, values

    def watch(self, row: int, values: np.ndarray) -> None:
        """Take in this rank's part (n_local,) of the displacements at an archived instant."""
        if row in self._wanted:
            self._frames[row] = values.copy()
        np.minimum(self._lowest, values, out=self._lowest)
        np.maximum(self._highest, values, out=self._highest)
        self._lifted[row] = self._assembly.plate.lifted_area.partial(values)
        self._watched += 1

    def kept(self) -> tuple[np.ndarray, np.ndarray]:
        """Return this rank's shares of the lifted area (nt,) and its fields (n_local, n_frames so far + 2), for a checkpoint."""
        frames = [self._frames[row] for row in sorted(self._frames)]
        return self._lifted, np.stack([*frames, self._lowest, self._highest], axis=1)

    def restore(self, lifted: np.ndarray, fields: np.ndarray) -> None:
        """Take in again what `kept` gave."""
        *frames, lowest, highest = (np.ascontiguousarray(column) for column in fields.T)
        self._frames = dict(zip(self.rows.tolist(), frames, strict=False))
        self._lowest, self._highest = lowest, highest
        self._lifted[:] = lifted
        self._watched = int(np.isfinite(lifted).sum())

    def develop(self, peak: np.ndarray | None) -> SnapshotData | None:
        """Bring the film and this rank's part of the field `peak` to rank 0 (collective); None on other ranks, and where all is missing."""
        frames = [self._frames[row] for row in sorted(self._frames)]
        envelope = [self._lowest, self._highest] if self._watched else []
        amplitude = [self._amplitude.real, self._amplitude.imag] if self._frequency > 0 else []
        fields = [*frames, *envelope, *amplitude, *([] if peak is None else [peak])]
        if not fields:
            return None
        nodal = [vectors_in_space(self._assembly.plate.displacement(values)) for values in fields]
        area = self._assembly.plate.lifted_area
        lifted = area.total(self._lifted) if area.known else None
        mesh = gather_mesh(self._assembly.tagged)
        packed = gather_nodal(self._assembly.tagged, self._assembly.plate.space, np.concatenate(nodal, axis=1))
        if mesh is None or packed is None:
            return None
        whole = packed.reshape(len(packed), len(fields), 3).transpose(1, 0, 2)
        parts = np.split(whole, np.cumsum([len(frames), len(envelope), len(amplitude)]))
        return SnapshotData(
            mesh.points,
            mesh.cells,
            mesh.cell_type,
            parts[3],
            np.array(sorted(self._frames), dtype=int),
            parts[0].astype(np.float32),
            parts[1],
            self._watched,
            self._frequency,
            parts[2][0] + 1j * parts[2][1] if amplitude else None,
            lifted,
        )
