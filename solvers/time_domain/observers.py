"""What looks at a march: the archive of its outputs, and watchers of the displacements."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from uplift.forms.operators import Operators
from uplift.solvers.contact.memory import ContactStep
from uplift.solvers.history import History, Ledger, farthest
from uplift.solvers.time_domain.kept import Kept
from uplift.solvers.time_domain.state import Instants


class Observer(Protocol):
    """Looks at the instants of a march, in their order and each once."""

    def observe(self, instants: Instants) -> None:
        """Take in some instants (collective)."""

    def kept(self) -> Kept:
        """Return what a checkpoint has to keep."""

    def restore(self, kept: Kept) -> None:
        """Take in again what `kept` gave."""


class FieldWatcher(Protocol):
    """Looks at the displacements of the model, in all its dofs, at archived instants."""

    def wants(self, row: int) -> bool:
        """Return whether the archived instant `row` matters."""

    def watch(self, row: int, values: np.ndarray) -> None:
        """Take this rank's part (n_local,) of the displacements at the archived instant `row`."""

    def kept(self) -> tuple[np.ndarray, np.ndarray]:
        """Return what a checkpoint has to keep: this rank's shares of sums, and fields (n_local, k), k the same on all ranks."""

    def restore(self, shares: np.ndarray, fields: np.ndarray) -> None:
        """Take in again what `kept` gave."""


class FieldObserver:
    """Shows the archived displacements to a watcher; in a basis they are made for the instants that it wants."""

    def __init__(self, operators: Operators, every: int, watcher: FieldWatcher) -> None:
        """Take the model of the march, of which every `every`-th step is archived."""
        self._operators, self._every, self._watcher = operators, every, watcher

    def observe(self, instants: Instants) -> None:
        """Show the wanted ones of some instants."""
        for which, row in zip(*instants.archived(self._every), strict=True):
            if self._watcher.wants(int(row)):
                self._watcher.watch(int(row), self._operators.reconstruct(instants.displacement[which]))

    def kept(self) -> Kept:
        """Return what a checkpoint has to keep."""
        shares, fields = self._watcher.kept()
        return Kept(shares={"watched": shares}, fields={"watched": fields})

    def restore(self, kept: Kept) -> None:
        """Take in again what `kept` gave."""
        self._watcher.restore(kept.shares["watched"], kept.fields["watched"])


class Archive:
    """The outputs at every `every`-th step."""

    def __init__(self, operators: Operators, steps: int, every: int, contacts: ContactStep | None) -> None:
        """Make room for a march of `steps` steps; `contacts` is the law that it follows, None where they stay bonded."""
        self._operators, self._every, self._contacts = operators, every, contacts
        n, n_inner = steps // every + 1, contacts.n_inner if contacts is not None else 0
        outputs = operators.outputs
        # In a basis nothing is sparse.
        self._rows, self._per_velocity = outputs.local, outputs.per_velocity
        if operators.reduction is not None:
            self._rows = self._rows.toarray()
            self._per_velocity = None if self._per_velocity is None else self._per_velocity.toarray()
        self._probes = outputs.layout["probes"]
        self._observed = np.zeros((n, self._rows.shape[0]))
        """This rank's shares of the linear parts of the outputs."""
        self._accelerations = np.zeros((n, len(operators.probes.names)))
        """This rank's shares."""
        self._release = np.zeros((n, operators.contacts.law.n_channels))
        self._inner = np.zeros((n, n_inner))
        self._farthest, self._peak = -1.0, 0
        self._peak_values = np.zeros(operators.n_local)

    def observe(self, instants: Instants) -> None:
        """Archive the due ones of some instants (collective)."""
        which, rows = instants.archived(self._every)
        if not len(which):
            return
        self._observed[rows] = (self._rows @ instants.displacement[which].T).T
        if self._per_velocity is not None:
            self._observed[rows] += (self._per_velocity @ instants.velocity[which].T).T
        self._accelerations[rows] = (self._rows[self._probes] @ instants.acceleration[which].T).T
        self._release[rows] = instants.release[which]
        if self._inner.shape[1]:
            self._inner[rows] = instants.inner[which]
        probes = self._operators.outputs.total(self._observed[rows, self._probes])
        reach = farthest(probes, self._operators.probes.moving)
        best = int(np.argmax(reach))
        if reach[best] > self._farthest:
            self._farthest, self._peak = float(reach[best]), int(rows[best])
            self._peak_values[:] = instants.displacement[which[best]]

    def history(self, times: np.ndarray, ledger: Ledger | None) -> History:
        """Return what was archived, at the instants `times` (nt,) s (collective)."""
        outputs, contacts = self._operators.outputs, self._contacts
        force = contacts.support_force(self._release, self._inner) if contacts is not None else self._release
        return History(
            times=times,
            outputs=outputs.values(outputs.total(self._observed), force),
            layout=outputs,
            release=self._release,
            peak=self._peak,
            peak_field=self._operators.reconstruct(self._peak_values),
            ledger=ledger,
            accelerations=outputs.total(self._accelerations),
            gap=contacts.openings(self._inner) if contacts is not None else None,
        )

    def kept(self) -> Kept:
        """Return what a checkpoint has to keep."""
        same = {"release": self._release, "inner": self._inner, "peak": np.array([self._farthest, self._peak])}
        kept = Kept(same, {"observed": self._observed, "accelerations": self._accelerations})
        (kept.fields if self._operators.reduction is None else kept.same)["peak values"] = self._peak_values
        return kept

    def restore(self, kept: Kept) -> None:
        """Take in again what `kept` gave."""
        self._release[:], self._inner[:] = kept.same["release"], kept.same["inner"]
        self._farthest, self._peak = float(kept.same["peak"][0]), int(kept.same["peak"][1])
        self._observed[:], self._accelerations[:] = kept.shares["observed"], kept.shares["accelerations"]
        self._peak_values[:] = {**kept.same, **kept.fields}["peak values"]
