"""The ledger of energies of a march in time."""

from __future__ import annotations

from typing import Any

import numpy as np

from uplift.forms.operators import Operators
from uplift.solvers.history import Ledger


class EnergyMeter:
    """Adds up work and dissipation step by step.

    Between two instants a load does the work of its mean times the displacement's change, and damping takes the mean velocity's
    power: with the average-acceleration rule the books then balance to round-off while no contact opens or closes. An open contact
    stores nothing; a closed one half its net force squared times its flexibility.
    """

    def __init__(self, operators: Operators) -> None:
        """Begin with an empty ledger."""
        self._operators = operators
        self._work_vector = operators.new_vector()
        self._damped_vector = operators.new_vector() if operators.damping is not None else None
        self._external = [i for i, load in enumerate(operators.loads) if not load.internal]
        self._rows: list[tuple[float, float, float, float, float]] = []
        self._reached: np.ndarray | None = None
        self._values = np.zeros(0)
        self._power = 0.0
        self.work = 0.0
        self.damped = 0.0

    def add(self, displacement: Any, velocity: Any, values: np.ndarray, release: np.ndarray, *, step: float, archive: bool) -> None:
        """Add the next instant, `step` s after the one before (collective); `values` (n_loads,) are the load histories there."""
        operators = self._operators
        reached = np.array([np.real(operators.loads[i].vector.dot(displacement)) for i in self._external])
        external = values[self._external]
        cross, power = 0.0, 0.0
        if self._damped_vector is not None and operators.damping is not None:
            if self._reached is not None:
                cross = float(np.real(self._damped_vector.dot(velocity)))
            operators.damping.mult(velocity, self._damped_vector)
            power = float(np.real(self._damped_vector.dot(velocity)))
        if self._reached is not None:
            self.work += float(0.5 * (external + self._values) @ (reached - self._reached))
            self.damped += 0.25 * step * (power + 2 * cross + self._power)
        self._reached, self._values, self._power = reached, external, power
        if archive:
            self._rows.append((*self._stored(displacement, velocity, release), self.damped, self.work))

    def books(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the rows of the archived instants (n, 5) J, and damped energy and work (2,) J so far: all that `restore` needs."""
        return np.array(self._rows).reshape(-1, 5), np.array([self.damped, self.work])

    def restore(self, rows: np.ndarray, sums: np.ndarray) -> None:
        """Return to the books of an earlier instant; `resume` then takes its state."""
        self._rows = [tuple(row) for row in rows.tolist()]
        self.damped, self.work = (float(v) for v in sums)

    def resume(self, displacement: Any, velocity: Any, values: np.ndarray) -> None:
        """Take the state that the restored books end with (collective)."""
        self._reached = None
        self.add(displacement, velocity, values, np.zeros(0), step=0.0, archive=False)

    def _stored(self, displacement: Any, velocity: Any, release: np.ndarray) -> tuple[float, float, float]:
        operators, work = self._operators, self._work_vector
        operators.mass.mult(velocity, work)
        kinetic = 0.5 * float(np.real(work.dot(velocity)))
        operators.stiffness.mult(displacement, work)
        whole = 0.5 * float(np.real(work.dot(displacement)))
        here = np.real(displacement.array_r)
        bonded, unilateral = (
            0.5 * float(operators.comm.allreduce(here @ (part @ here)))
            for part in (operators.bonded_springs, operators.unilateral_springs)
        )
        law, elongation = operators.contacts.law, operators.contacts.elongation
        net = law.tension(elongation.total(elongation.partial(here))) - release
        contacts = 0.5 * float(net**2 @ law.flexibility)
        return kinetic, whole - bonded - unilateral, bonded + contacts

    def ledger(self) -> Ledger:
        """Return the ledger of the archived instants and free the work vectors."""
        for vector in (self._work_vector, self._damped_vector):
            if vector is not None:
                vector.destroy()
        kinetic, strain, springs, damped, work = np.array(self._rows).reshape(-1, 5).T
        return Ledger(kinetic, strain, springs, damped, work)
