"""A model projected on a basis of few vectors: again a model, whose dofs are the coordinates of the basis.

With u = V q the model of `uplift.forms.operators` becomes V^T M V q'' + V^T C V q' + V^T K V q = V^T f, m equations instead of n.
A basis of modes alone gives the displacements well and the contact forces badly, because a point force excites modes far
beyond any band; the static answers to the loads and to unit contact forces make up for it (static correction: Wilson,
Yuan and Dickens, Earthquake Eng. Struct. Dyn. 10 (1982) 813; residual flexibility: Rubin, AIAA J. 13 (1975) 995).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from uplift.forms.operators import Contacts, Functionals, Load, Operators, Reduction
from uplift.solvers.bases.basis import Basis, inner, projected_matrices
from uplift.solvers.errors import SolverError
from uplift.solvers.time_domain.state import largest_nodal


def project(operators: Operators, basis: Basis, *, diagonal: bool = False) -> Operators:
    """Project a model on a basis (collective); the result is the same on every rank, and its owner closes it.

    `diagonal` keeps only the diagonals of the projected stiffness, mass and damping, as modelisation B of SDLS119 does;
    with modes it drops the damping between modes, nothing else. Vectors whose projected mass is zero follow from their equilibrium.
    Raises `SolverError` if the others are not independent in the norm of the mass, or these not in that of the stiffness.
    """
    V, comm, alone = basis.vectors, operators.comm, MPI.COMM_SELF
    known = basis.projected or projected_matrices(operators, V)

    def kept(full: np.ndarray) -> np.ndarray:
        return np.diag(np.diag(full)) if diagonal else full

    def between(part: sparse.csr_matrix) -> sparse.csr_matrix:
        return sparse.csr_matrix(inner(V, part @ V, comm))

    stiffness, mass = kept(known.stiffness), kept(known.mass)
    with_mass = np.diag(mass) != 0
    if not (_definite(mass[np.ix_(with_mass, with_mass)]) and _definite(stiffness[np.ix_(~with_mass, ~with_mass)])):
        raise SolverError("the vectors of the basis are linearly dependent, or one of them has neither mass nor stiffness")
    contacts, elongation = operators.contacts, operators.contacts.elongation
    return Operators(
        stiffness=_matrix(stiffness),
        mass=_matrix(mass),
        damping=_matrix(kept(known.damping)) if operators.damping is not None else None,
        loads=[_load(load, V, comm) for load in operators.loads],
        contacts=Contacts(
            contacts.names,
            contacts.points,
            Functionals(elongation.names, sparse.csr_matrix(elongation.total(elongation.partial(V))), alone),
            sparse.csr_matrix(inner(V, contacts.push.toarray(), comm)),
            contacts.law,
        ),
        outputs=operators.outputs.projected(V, alone),
        comm=alone,
        bonded_springs=between(operators.bonded_springs),
        unilateral_springs=between(operators.unilateral_springs),
        reduction=Reduction(V, comm),
    )


def _definite(matrix: np.ndarray) -> bool:
    """Return whether a symmetric matrix is positive definite, its rows and columns scaled to a diagonal of ones."""
    if not len(matrix):
        return True
    size = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    return bool(np.all(size > 0) and np.linalg.eigvalsh(matrix / np.outer(size, size))[0] > 1e-12)


def _load(load: Load, vectors: np.ndarray, comm: Any) -> Load:
    forces = inner(vectors, np.real(load.vector.array_r)[:, None], comm)[:, 0]
    vector = PETSc.Vec().createSeq(len(forces), comm=MPI.COMM_SELF)
    vector.array[:] = forces
    return replace(load, vector=vector, largest=largest_nodal(load))


def _matrix(values: np.ndarray) -> Any:
    matrix = PETSc.Mat().createDense(size=values.shape, comm=MPI.COMM_SELF)
    matrix.setUp()
    matrix.getDenseArray()[:] = values
    matrix.assemble()
    return matrix
