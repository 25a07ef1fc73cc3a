"""What looks at the displacements of a march beside its archive: lifted share and snapshots."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.analysis.snapshots import Snapshots


class LiftedShare:
    """Collects the lifted share of the area at the archived instants that the scene asks for."""

    def __init__(self, assembly: AssembledScene, times: np.ndarray) -> None:
        """Take the archived instants (nt,) s."""
        self._area = assembly.plate.lifted_area
        self.rows = assembly.scene.output.uplift_rows(times)
        self.partial = np.full(len(times), np.nan)

    def watch(self, row: int, values: np.ndarray) -> None:
        """Note the share at one archived instant."""
        if self.rows[row]:
            self.partial[row] = self._area.partial(values)

    def result(self) -> np.ndarray | None:
        """Return the shares (nt,) in percent, nan where not asked for; None if nowhere (collective)."""
        return self._area.total(self.partial) if self.rows.any() else None


class Observers:
    """All who look at the displacements of a march, and what of theirs is kept in its checkpoints."""

    def __init__(self, assembly: AssembledScene, share: LiftedShare, snapshots: Snapshots | None) -> None:
        """Take the lifted share and the snapshots, which may be None."""
        self._share, self._film = share, snapshots
        self._nothing = np.zeros((assembly.operators.n_local, 0))

    def watch(self, row: int, values: np.ndarray) -> None:
        """Take in the displacements (n_local,) at an archived instant."""
        self._share.watch(row, values)
        if self._film is not None:
            self._film.watch(row, values)

    def kept(self) -> tuple[np.ndarray, np.ndarray]:
        """Return what a checkpoint has to keep."""
        lifted, fields = self._film.kept() if self._film is not None else (self._share.partial, self._nothing)
        return np.stack([self._share.partial, lifted]), fields

    def restore(self, shares: np.ndarray, fields: np.ndarray) -> None:
        """Take in again what `kept` gave."""
        self._share.partial[:] = shares[0]
        if self._film is not None:
            self._film.restore(shares[1], fields)


def film_at(snapshots: Snapshots | None, instants: int, field: Callable[[int], np.ndarray | None], *, costly: bool = True) -> None:
    """Film what `field` gives at the film's own instants (collective); nothing where fields were not kept."""
    if snapshots is None:
        return
    snapshots.start(instants, costly=costly)
    for row in snapshots.rows:
        values = field(int(row))
        if values is None:
            return
        snapshots.watch(int(row), values)
