"""The operators of a model: the one object that stands between the forms and the solvers.

M u'' + C u' + K u = sum over loads of vector(l) * history(l)(t) + push @ contact release forces

with every contact bonded in K. A solver needs nothing else, so a model may as well be a two-dof oscillator.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy import sparse

from uplift.forms.contact.law import UpliftLaw


def _sum_over_ranks(partial: np.ndarray, comm: Any) -> np.ndarray:
    if comm.size == 1:
        return partial
    partial = np.ascontiguousarray(partial)
    total = np.empty_like(partial)
    comm.Allreduce(partial, total, op=MPI.SUM)
    return total


@dataclass(frozen=True)
class Functionals:
    """Sparse linear functionals of the solution, such as the displacement of a probe."""

    names: tuple[str, ...]
    local: sparse.csr_matrix
    """(n_functionals, n_local): weights on this rank's part of a solution; the value is the sum over ranks."""
    comm: Any

    def partial(self, values: np.ndarray) -> np.ndarray:
        """Return this rank's share of the functionals (n_functionals,) of its part (n_local,) of a solution."""
        return self.local @ values

    def total(self, partial: np.ndarray) -> np.ndarray:
        """Return the sum over ranks of shares of any shape (collective)."""
        return _sum_over_ranks(partial, self.comm)


@dataclass(frozen=True)
class LiftedArea:
    """The share of the plate's area whose nodes have risen: a nodal field, 1 where DY > 0 and else 0, integrated over the cells."""

    rows: np.ndarray
    """Rows within this rank of the vertical displacements of its nodes."""
    weights: np.ndarray
    """Area of the plate that belongs to each of them, as a part of the whole."""
    comm: Any

    def partial(self, values: np.ndarray) -> np.ndarray:
        """Return this rank's share of the lifted area, in percent, for its part (n_local, ...) of solutions."""
        return 100.0 * (self.weights @ (values[self.rows] > 0))

    def total(self, partial: np.ndarray) -> np.ndarray:
        """Return the sum over ranks of shares of any shape (collective)."""
        return _sum_over_ranks(partial, self.comm)


@dataclass(frozen=True)
class Load:
    """A load: a vector in space times a function of time."""

    name: str
    vector: Any
    """PETSc vector in N (times the unit of `history`)."""
    history: Callable[[np.ndarray], np.ndarray]
    """Values (nt,) at times (nt,) s."""
    static: bool = False
    """Whether it already acts before time 0, as gravity does."""
    internal: bool = False
    """Whether it stands for the strain of springs at zero displacement and so does no work from outside."""


@dataclass(frozen=True)
class Contacts:
    """The unilateral contacts of a model, in the order of its supports, and their channels (see `uplift.forms.contact.law`)."""

    names: tuple[str, ...]
    points: np.ndarray
    """(n_c, 2) m."""
    elongation: Functionals
    """Elongation of each channel in m, positive when it opens."""
    push: sparse.csr_matrix
    """(n_local, n_channels): this rank's part of the unit release force of each channel on the plate."""
    law: UpliftLaw


def no_contacts(n_local: int, comm: Any) -> Contacts:
    """Return the contacts of a model that has none."""
    nothing = Functionals((), sparse.csr_matrix((0, n_local)), comm)
    return Contacts((), np.zeros((0, 2)), nothing, sparse.csr_matrix((n_local, 0)), UpliftLaw(np.zeros(0), np.zeros(0)))


@dataclass(frozen=True)
class Reactions:
    """Resultants of the forces of the ground on the plate: a linear part in the solution and one in the release forces.

    Resultant = functionals(u) + release @ per_release^T + constant; base shear along X in N, vertical reaction in N,
    overturning moment in N m, counter-clockwise, about the middle of the plate's foot.
    """

    functionals: Functionals
    per_release: np.ndarray
    """(3, n_channels)."""
    constant: np.ndarray
    """(3,): of springs that are strained at zero displacement."""

    def values(self, linear: np.ndarray, release: np.ndarray) -> np.ndarray:
        """Return the resultants (nt, 3) from the functionals' values (nt, 3) and release forces (nt, n_channels) N."""
        return linear + release @ self.per_release.T + self.constant


@dataclass
class Operators:
    """Matrices, loads, contacts and probes of a model; it owns its PETSc objects (`with` closes them)."""

    stiffness: Any
    mass: Any
    damping: Any | None
    """None where the model has no damping."""
    loads: list[Load]
    contacts: Contacts
    probes: Functionals
    comm: Any
    bonded_springs: sparse.csr_matrix
    """(n_local, n_local) N/m: the part of the stiffness that is plain springs and bonded components of joints."""
    unilateral_springs: sparse.csr_matrix
    """(n_local, n_local) N/m: the part that is components of joints whose contact can open."""
    reactions: Reactions | None = None
    """None where the model knows no ground, as an oscillator written down in numbers."""

    @property
    def n(self) -> int:
        """Number of dofs."""
        return int(self.stiffness.getSize()[0])

    @property
    def n_local(self) -> int:
        """Number of dofs of this rank."""
        return int(self.stiffness.getLocalSize()[0])

    def new_vector(self) -> Any:
        """Return a new zero vector of the system; the caller destroys it."""
        return self.stiffness.createVecRight()

    def __enter__(self) -> Operators:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Destroy the matrices and load vectors."""
        for thing in (self.stiffness, self.mass, self.damping, *(load.vector for load in self.loads)):
            if thing is not None:
                thing.destroy()
