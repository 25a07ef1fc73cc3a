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

from forms.uplift import CompressionOnly


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
        if self.comm.size == 1:
            return partial
        partial = np.ascontiguousarray(partial)
        total = np.empty_like(partial)
        self.comm.Allreduce(partial, total, op=MPI.SUM)
        return total


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


@dataclass(frozen=True)
class Contacts:
    """The unilateral contacts of a model, in the order of its supports."""

    names: tuple[str, ...]
    points: np.ndarray
    """(n_c, 2) m."""
    elongation: Functionals
    """Elongation of each contact in m, positive when it opens."""
    push: sparse.csr_matrix
    """(n_local, n_c): this rank's part of the unit release force of each contact on the plate."""
    law: CompressionOnly


def no_contacts(n_local: int, comm: Any) -> Contacts:
    """Return the contacts of a model that has none."""
    nothing = Functionals((), sparse.csr_matrix((0, n_local)), comm)
    return Contacts((), np.zeros((0, 2)), nothing, sparse.csr_matrix((n_local, 0)), CompressionOnly(np.zeros(0)))


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
