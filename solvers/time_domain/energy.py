"""The ledger of energies of a march in time."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from uplift.forms.operators import Operators
from uplift.solvers.history import Ledger
from uplift.solvers.time_domain.kept import Kept
from uplift.solvers.time_domain.state import Drive, Instants


class EnergyLedger:
    """Adds up work and dissipation step by step.

    Between two instants a load does the work of its mean times the displacement's change, and damping takes the mean velocity's
    power: with the average-acceleration rule the ledger then balances to round-off while no contact opens or closes. An open contact
    stores nothing; a closed one half its net force squared times its flexibility.
    """

    def __init__(self, operators: Operators, drive: Drive, step: float, every: int) -> None:
        """Begin with an empty ledger of a march with steps of `step` s, whose every `every`-th is archived."""
        self._operators, self._drive, self._step, self._every = operators, drive, step, every
        self._mass, self._stiffness = _Product(operators.mass), _Product(operators.stiffness)
        self._damping = _Product(operators.damping) if operators.damping is not None else None
        self._external = [i for i, load in enumerate(operators.loads) if not load.internal]
        vectors = [np.real(operators.loads[i].vector.array_r) for i in self._external]
        self._vectors = np.array(vectors).reshape(len(vectors), operators.n_local)
        self._rows = np.zeros((len(drive.values[::every]), 5))
        self._sums = np.zeros(2)
        """Work of the loads and energy damped so far, J."""
        self._last: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None = None
        """Of the last instant: displacement along the loads and load values (1, n_external), velocity and damping force (1, n_local)."""

    def observe(self, instants: Instants) -> None:
        """Take in some instants (collective)."""
        numbers = instants.first + np.arange(len(instants.displacement))
        along = self._sum(instants.displacement @ self._vectors.T)
        loads = self._drive.values[numbers][:, self._external]
        velocity = instants.velocity
        damping = self._damping(velocity) if self._damping is not None else np.zeros((len(numbers), 0))
        last = self._last
        if last is not None:
            along, loads = np.concatenate([last[0], along]), np.concatenate([last[1], loads])
            work = 0.5 * np.sum((loads[1:] + loads[:-1]) * np.diff(along, axis=0), axis=1)
            damped = np.zeros(len(numbers))
            if self._damping is not None:
                v, c = np.concatenate([last[2], velocity]), np.concatenate([last[3], damping])
                power, cross = self._sum(np.stack([np.einsum("kn,kn->k", v, c), np.einsum("kn,kn->k", v, np.roll(c, 1, axis=0))]))
                damped = 0.25 * self._step * (power[1:] + 2 * cross[1:] + power[:-1])
            sums = self._sums + np.cumsum(np.stack([work, damped], axis=1), axis=0)
        else:
            sums = np.repeat(self._sums[None], len(numbers), axis=0)
        self._sums = sums[-1]
        self._last = along[-1:].copy(), loads[-1:].copy(), velocity[-1:].copy(), damping[-1:].copy()
        which, rows = instants.archived(self._every)
        if len(which):
            self._rows[rows, :3] = self._stored(instants, which)
            self._rows[rows, 3:] = sums[which, ::-1]

    def _stored(self, instants: Instants, which: np.ndarray) -> np.ndarray:
        """Return kinetic energy, strain energy and that of springs (k, 3) J at some of the instants (collective)."""
        operators = self._operators
        u, v = instants.displacement[which], instants.velocity[which]
        springs = [(part @ u.T).T for part in (operators.bonded_springs, operators.unilateral_springs)]
        whole = [(v, self._mass(v)), (u, self._stiffness(u)), *((u, force) for force in springs)]
        kinetic, strain, bonded, unilateral = self._sum(0.5 * np.stack([np.einsum("kn,kn->k", a, b) for a, b in whole]))
        law, elongation = operators.contacts.law, operators.contacts.elongation
        tension = law.tension(elongation.total(np.ascontiguousarray(elongation.partial(u.T).T)))
        contacts = 0.5 * (tension - instants.release[which]) ** 2 @ law.flexibility
        return np.stack([kinetic, strain - bonded - unilateral, bonded + contacts], axis=1)

    def _sum(self, share: np.ndarray) -> np.ndarray:
        comm = self._operators.comm
        if comm.size > 1:
            share = np.ascontiguousarray(share)
            comm.Allreduce(MPI.IN_PLACE, share)
        return share

    def ledger(self) -> Ledger:
        """Return the ledger of the archived instants and free the work vectors."""
        for product in (self._mass, self._stiffness, self._damping):
            if product is not None:
                product.close()
        return Ledger(*self._rows.T)

    def kept(self) -> Kept:
        """Return what a checkpoint has to keep."""
        assert self._last is not None
        along, loads, velocity, damping = self._last
        same = {"rows": self._rows, "sums": self._sums, "along": along, "loads": loads}
        moving = {"velocity": velocity.T, "damping": damping.T}
        return Kept(same, fields=moving) if self._operators.reduction is None else Kept(same | moving)

    def restore(self, kept: Kept) -> None:
        """Take in again what `kept` gave."""
        self._rows[:], self._sums = kept.same["rows"], kept.same["sums"]
        moving = {**kept.same, **kept.fields}
        self._last = kept.same["along"], kept.same["loads"], moving["velocity"].T, moving["damping"].T


class _Product:
    """Products of a real symmetric matrix with rows of numbers."""

    def __init__(self, matrix: Any) -> None:
        self._matrix = matrix
        self._dense = np.real(matrix.getDenseArray()).copy() if matrix.getType() == "seqdense" else None
        self._vectors: list[Any] = [] if self._dense is not None else list(matrix.createVecs())

    def __call__(self, rows: np.ndarray) -> np.ndarray:
        """Return the products (k, n_local) with `rows` (k, n_local) (collective)."""
        if self._dense is not None:
            return rows @ self._dense
        right, left = self._vectors
        products = np.empty_like(rows)
        for row, product in zip(rows, products, strict=True):
            right.array[:] = row
            self._matrix.mult(right, left)
            product[:] = np.real(left.array_r)
        return products

    def close(self) -> None:
        for vector in self._vectors:
            vector.destroy()
