"""Bases: linearly independent vectors of this rank's rows, and products with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from uplift.forms.operators import Operators
from uplift.solvers.linear import dense_columns

TOGETHER = 8
"""Vectors that are multiplied at once: a matrix that is read once for some of them takes half the time, and copies stay small."""


def apply(matrix: Any, vectors: np.ndarray) -> np.ndarray:
    """Return this rank's rows (n_local, m) of a real matrix times real `vectors` (n_local, m) (collective)."""
    product = np.empty(vectors.shape, order="F")
    for first in range(0, vectors.shape[1], TOGETHER):
        some = slice(first, first + TOGETHER)
        given = dense_columns(matrix, vectors[:, some])
        found = matrix.matMult(given)
        product[:, some] = np.real(found.getDenseArray())
        given.destroy()
        found.destroy()
    return product


def inner(left: np.ndarray, right: np.ndarray, comm: Any) -> np.ndarray:
    """Return left^T right (m_left, m_right) of two arrays of local rows, summed over the ranks (collective)."""
    product = np.ascontiguousarray(left.T @ right)
    if comm.size > 1:
        comm.Allreduce(MPI.IN_PLACE, product, op=MPI.SUM)
    return product


@dataclass(frozen=True)
class Projected:
    """The matrices of a model between the vectors of a basis, (m, m) each and symmetric."""

    stiffness: np.ndarray
    mass: np.ndarray
    damping: np.ndarray
    """Zero where the model has no damping."""


@dataclass(frozen=True)
class Basis:
    """Linearly independent real vectors that span the displacements of a reduced model."""

    vectors: np.ndarray
    """(n_local, m): this rank's rows."""
    comm: Any
    projected: Projected | None = None
    """The matrices of the model that the basis was made for, where they are known already."""

    @property
    def size(self) -> int:
        """Number m of vectors."""
        return int(self.vectors.shape[1])


def projected_matrices(operators: Operators, vectors: np.ndarray) -> Projected:
    """Return the matrices of a model between `vectors` (n_local, m) (collective)."""

    def between(matrix: Any) -> np.ndarray:
        full = inner(vectors, apply(matrix, vectors), operators.comm)
        return (full + full.T) / 2

    mass = between(operators.mass)
    damping = np.zeros_like(mass) if operators.damping is None else between(operators.damping)
    return Projected(between(operators.stiffness), mass, damping)
