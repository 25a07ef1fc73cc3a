"""Whether loads, inertia, damping and the reactions of the ground balance at the archived instants of a march.

A rigid motion d strains nothing, so that d^T (f - C v - M a) and the resultant of the ground's forces that works on d are in equilibrium.
In floating point they are as far as K d is zero beside the entries of K: stiff structures on soft springs lose digits here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from uplift.forms.operators import Operators
from uplift.solvers.bases.basis import apply
from uplift.solvers.time_domain.kept import Kept
from uplift.solvers.time_domain.state import Instants


class Equilibrium:
    """Adds up what acts along the rigid motions of the resultants; an observer of a march in all dofs, where no auxiliary node swings."""

    def __init__(self, operators: Operators, motions: np.ndarray, values: np.ndarray, every: int = 1) -> None:
        """Take the rigid motions (k, n_local) of the reactions and the values (nt, n_loads) of the load histories at the archived instants.

        Every `every`-th instant of a march is archived.
        """
        self._operators, self._every = operators, every
        self._reactions = operators.reactions
        loads = [np.zeros(operators.n_local) if load.internal else np.real(load.vector.array_r) for load in operators.loads]
        per_load = operators.outputs.total(motions @ np.array(loads).reshape(len(loads), operators.n_local).T)
        self._acting = values @ per_load.T
        self._mass, self._damping = (_along(matrix, motions) for matrix in (operators.mass, operators.damping))
        self._rows = np.zeros((2, len(values), len(motions)))
        """This rank's shares: forces of springs and conditions on the plate; inertia and damping."""
        self._release = np.zeros((len(values), operators.contacts.law.n_channels))

    def observe(self, instants: Instants) -> None:
        """Take in some instants."""
        which, rows = instants.archived(self._every)
        if not len(which):
            return
        self._rows[0, rows] = (self._reactions.local @ instants.displacement[which].T).T
        self._rows[1, rows] = -instants.acceleration[which] @ self._mass.T - instants.velocity[which] @ self._damping.T
        self._release[rows] = instants.release[which]

    def imbalance(self, reach: float) -> dict[str, float]:
        """Return the largest imbalance of each resultant, relative to the largest force (collective).

        Moments are relative to the largest moment, or to the largest force times `reach` in m where that is larger.
        """
        group = self._reactions
        shares, moved = self._operators.outputs.total(self._rows)
        ground = shares + self._release @ (0.0 if group.per_support_force is None else group.per_support_force.T)
        ground += 0.0 if group.constant is None else group.constant
        left = np.max(np.abs(ground + moved + self._acting), axis=0, initial=0.0)
        largest = np.max(np.abs([ground, moved, self._acting]), axis=(0, 1), initial=0.0)
        forces = np.array([unit == "N" for unit in group.units], dtype=bool)
        force = float(np.max(largest[forces], initial=0.0))
        scale = np.where(forces, force, np.maximum(np.max(largest[~forces], initial=0.0), force * reach))
        relative = np.divide(left, scale, out=np.zeros_like(left), where=scale > 0)
        return dict(zip(group.names, relative.tolist(), strict=True))

    def kept(self) -> Kept:
        """Return what a checkpoint has to keep."""
        return Kept({"release": self._release}, shares={"forces": self._rows})

    def restore(self, kept: Kept) -> None:
        """Take in again what `kept` gave."""
        self._release[:], self._rows[:] = kept.same["release"], kept.shares["forces"]


def _along(matrix: Any, motions: np.ndarray) -> np.ndarray:
    """Return the products (k, n_local) of a symmetric matrix with motions (k, n_local) (collective); zero without a matrix."""
    return np.zeros_like(motions) if matrix is None else apply(matrix, motions.T).T
