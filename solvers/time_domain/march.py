"""The march of a time integration from instant to instant: the one loop of all methods that step in time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from uplift.forms.operators import Operators
from uplift.solvers.contact.memory import ContactStep
from uplift.solvers.history import History
from uplift.solvers.time_domain.dense_stepper import DenseStepper
from uplift.solvers.time_domain.energy import EnergyLedger
from uplift.solvers.time_domain.kept import Kept
from uplift.solvers.time_domain.march_store import KeptMarch
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.observers import Archive, FieldObserver, FieldWatcher, Observer
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import Drive, Instants, State
from uplift.solvers.watch import Loop, Watch


class Stepper(Protocol):
    """A model on its way in steps of one length; `with` frees what it holds."""

    operators: Operators
    step: float
    contacts: ContactStep | None
    """The law that its contacts follow, None where they stay bonded."""
    block: int
    """Instants at most that `advance` gives at once."""

    def __enter__(self) -> Any:
        """Return itself."""

    def __exit__(self, *_: object) -> None:
        """Free what it holds."""

    def begin(self, start: State, drive: Drive) -> Instants:
        """Take the state at time 0, which is left as it is; return that instant (collective)."""

    def advance(self, drive: Drive, first: int, last: int) -> Instants:
        """Take the steps that end at the instants `first` to `last`, at most `block` (collective)."""

    def kept(self) -> Kept:
        """Return what a checkpoint has to keep."""

    def restore(self, start: State, kept: Kept) -> None:
        """Take in again what `kept` gave, in place of the state of time 0."""


def stepper_of(
    operators: Operators, scheme: Scheme, step: float, *, exact_uplift: bool = False, rigid_modes: np.ndarray | None = None
) -> Stepper:
    """Return what steps a model in time: by small dense products in a basis, else by a factor (collective).

    The parameters are those of `Newmark`.
    """
    if operators.reduction is not None:
        return DenseStepper(operators, scheme, step, exact_uplift=exact_uplift)
    return Newmark(operators, scheme, step, exact_uplift=exact_uplift, rigid_modes=rigid_modes)


def transient(
    stepper: Stepper,
    start: State,
    steps: int,
    *,
    every: int = 1,
    release: np.ndarray | None = None,
    energy: bool = False,
    watcher: FieldWatcher | None = None,
    more: Sequence[Observer] = (),
    watch: Watch | None = None,
) -> History:
    """March `steps` steps from time 0 and the state `start`, which is left as it is (collective).

    Every `every`-th step is archived. `release` (n_archived, n_channels) N are release forces known at the archived instants
    and interpolated linearly between them; without them uplift is exact, or left out, as the stepper was made. `energy`
    keeps the ledger of energies, at three products of a matrix and a vector a step, unless auxiliary nodes have masses that count,
    whose energy it does not know. `watcher` is shown the archived displacements, `more` observers every instant. `watch` shows the
    progress and keeps checkpoints, from which the same march goes on to the same bits on as many ranks.

    Many parameters because all but the first three may be left out.
    """
    operators = stepper.operators
    times = stepper.step * np.arange(steps + 1)
    archived = times[::every]
    given = None if release is None else np.array([np.interp(times, archived, column) for column in release.T]).reshape(-1, len(times)).T
    drive = Drive.of(operators, times, given)
    contacts = stepper.contacts if given is None else None
    archive = Archive(operators, steps, every, contacts)
    observers: list[Observer] = [archive, *more]
    ledger = None
    if energy and (contacts is None or contacts.n_inner == 0):
        ledger = EnergyLedger(operators, drive, stepper.step, every)
        observers.append(ledger)
    if watcher is not None:
        observers.append(FieldObserver(operators, every, watcher))
    observers += more
    kept = KeptMarch(watch, operators.world, stepper, observers)
    reached = kept.read(start)
    if reached < 0:
        reached = 0
        _show(observers, stepper.begin(start, drive))
    with Loop(watch, operators.world, "steps", steps, reached, lambda: kept.save(n)) as loop:
        n = reached
        while n < steps:
            last = min(n + stepper.block, steps)
            _show(observers, stepper.advance(drive, n + 1, last))
            n = last
            if loop.next <= n < steps:
                loop.meet(n)
        loop.finish()
    return archive.history(archived, drive.values[::every], ledger.ledger() if ledger is not None else None)


def _show(observers: list[Observer], instants: Instants) -> None:
    for observer in observers:
        observer.observe(instants)
