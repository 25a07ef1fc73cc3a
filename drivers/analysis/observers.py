"""What looks at the displacements of a march beside its archive: lifted share and snapshots."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.analysis.task import Task


class LiftedShare:
    """Collects the lifted share of the area at the archived instants that the scene asks for."""

    def __init__(self, assembly: AssembledScene, times: np.ndarray) -> None:
        """Take the archived instants (nt,) s."""
        self._area = assembly.plate.lifted_area
        self.rows = assembly.scene.output.uplift_rows(times) & self._area.known
        self.partial = np.full(len(times), np.nan)

    def watch(self, row: int, values: np.ndarray) -> None:
        """Note the share at one archived instant."""
        if self.rows[row]:
            self.partial[row] = self._area.partial(values)

    def result(self) -> np.ndarray | None:
        """Return the shares (nt,) in percent, nan where not asked for; None if nowhere (collective)."""
        return self._area.total(self.partial) if self.rows.any() else None


class Watchers:
    """All who look at the displacements of a march, and what of theirs is kept in its checkpoints."""

    def __init__(self, task: Task, share: LiftedShare) -> None:
        """Take the lifted share; the snapshots are those of the task."""
        self._share, self._snapshots = share, task.snapshots
        # In a basis each field costs a product of the size of the model: frames alone are shown, not every instant for the envelope.
        self._frames_only = task.reduced
        self._nothing = np.zeros((task.assembly.operators.n_local, 0))

    def wants(self, row: int) -> bool:
        """Return whether anybody looks at an archived instant."""
        return bool(self._share.rows[row]) or self._filmed(row)

    def _filmed(self, row: int) -> bool:
        return self._snapshots is not None and (not self._frames_only or row in self._snapshots.rows)

    def watch(self, row: int, values: np.ndarray) -> None:
        """Take in the displacements (n_local,) at an archived instant."""
        self._share.watch(row, values)
        if self._snapshots is not None and self._filmed(row):
            self._snapshots.watch(row, values)

    def kept(self) -> tuple[np.ndarray, np.ndarray]:
        """Return what a checkpoint has to keep."""
        lifted, fields = self._snapshots.kept() if self._snapshots is not None else (self._share.partial, self._nothing)
        return np.stack([self._share.partial, lifted]), fields

    def restore(self, shares: np.ndarray, fields: np.ndarray) -> None:
        """Take in again what `kept` gave."""
        self._share.partial[:] = shares[0]
        if self._snapshots is not None:
            self._snapshots.restore(shares[1], fields)


def take_snapshots(task: Task, instants: int, field: Callable[[int], np.ndarray | None], *, costly: bool = True) -> None:
    """Take what `field` gives at the instants of the snapshots (collective); nothing where fields were not kept."""
    snapshots = task.snapshots
    if snapshots is None:
        return
    snapshots.start(instants, costly=costly)
    for row in snapshots.rows:
        values = field(int(row))
        if values is None:
            return
        snapshots.watch(int(row), values)
