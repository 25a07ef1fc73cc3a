"""Models from matrices, and back: `Operators` of numpy or scipy arrays, on one rank."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from uplift.forms.contact.law import UpliftLaw
from uplift.forms.operators import (
    Contacts,
    Functionals,
    Load,
    Operators,
    Outputs,
    elongation_group,
    no_contacts,
    no_reactions,
    probe_group,
)
from uplift.meshes.checked import ModelError

Signal = Callable[[np.ndarray], np.ndarray]


def contacts(direction: Any, stiffness: Any, names: Sequence[str] = ()) -> Contacts:
    """Return one-sided springs between dofs and the ground, without gap and without mass.

    `direction` (n, n_c): column j is the force on the dofs under 1 N of compression in contact j, so that direction^T u < 0 presses it.
    `stiffness` (n_c,) or one number for all, N/m. Raises `ModelError` for a stiffness that is not positive.
    """
    push = sparse.csr_matrix(direction)
    n, n_c = push.shape
    k = np.broadcast_to(np.asarray(stiffness, dtype=float), (n_c,)).copy()
    if not np.all(k > 0):
        raise ModelError("stiffness", "expected numbers > 0 N/m")
    given = tuple(names) or tuple(f"c{j + 1}" for j in range(n_c))
    return Contacts(given, np.zeros((n_c, 3)), Functionals(given, push.T.tocsr(), MPI.COMM_SELF), push, UpliftLaw(k, 1 / k))


def from_matrices(
    stiffness: Any,
    mass: Any,
    damping: Any | None = None,
    *,
    loads: Sequence[tuple[Any, Signal] | tuple[Any, float]] = (),
    contacts: Contacts | None = None,
    probes: dict[str, Any] | None = None,
) -> Operators:
    """Return a model of symmetric matrices (n, n), numpy or scipy, that the caller closes (`with`).

    `stiffness` in N/m is that of the structure without its contacts, whose springs are added. `loads` are pairs of a vector (n,) in N and
    a function of times (nt,) s, or a number, for a load that acts already before time 0. `probes` are named weights (n,) of
    displacements; without them every dof is one, u0, u1, ... Raises `ModelError` where shapes do not fit.
    """
    K, M, *rest = (sparse.csr_matrix(a, dtype=float) for a in (stiffness, mass, damping) if a is not None)
    n = K.shape[0]
    if any(a.shape != (n, n) for a in (K, M, *rest)):
        raise ModelError("matrices", f"expected matrices of one shape ({n}, {n}), got {[a.shape for a in (K, M, *rest)]}")
    held = contacts or no_contacts(n, MPI.COMM_SELF)
    if held.push.shape[0] != n:
        raise ModelError("contacts", f"expected directions of {n} dofs, got {held.push.shape[0]}")
    springs = (held.push @ sparse.diags(held.law.stiffness) @ held.push.T).tocsr()
    pattern = sum(abs(a) for a in (K, M, springs, *rest)) + sparse.identity(n)
    weights = {f"u{i}": row for i, row in enumerate(np.eye(n))} if probes is None else probes
    rows = sparse.csr_matrix(np.array([np.asarray(row, dtype=float) for row in weights.values()]).reshape(len(weights), n))
    return Operators(
        stiffness=_matrix(K + springs, pattern),
        mass=_matrix(M, pattern),
        damping=_matrix(rest[0], pattern) if rest else None,
        loads=[_load(number, vector, history, n) for number, (vector, history) in enumerate(loads, start=1)],
        contacts=held,
        outputs=Outputs.of([probe_group(tuple(weights), rows), elongation_group(held), no_reactions(n)], MPI.COMM_SELF),
        comm=MPI.COMM_SELF,
        bonded_springs=sparse.csr_matrix((n, n)),
        unilateral_springs=springs,
    )


def _load(number: int, vector: Any, history: Signal | float, n: int) -> Load:
    values = np.asarray(vector, dtype=float)
    if values.shape != (n,):
        raise ModelError(f"loads.{number}", f"expected a vector of shape ({n},), got {values.shape}")
    force = PETSc.Vec().createSeq(n, comm=MPI.COMM_SELF)
    force.array[:] = values
    if callable(history):
        return Load(f"load {number}", force, history)
    constant = float(history)
    return Load(f"load {number}", force, lambda times: np.full(len(times), constant), static=True)


def _matrix(values: sparse.csr_matrix, pattern: sparse.csr_matrix) -> Any:
    """Return a PETSc matrix with entries wherever `pattern` has some: all matrices of a model share one pattern."""
    whole = sparse.csr_matrix(pattern)
    whole.sort_indices()
    rows = np.repeat(np.arange(whole.shape[0]), np.diff(whole.indptr))
    data = np.asarray(values[rows, whole.indices]).ravel()
    csr = whole.indptr.astype(PETSc.IntType), whole.indices.astype(PETSc.IntType), data.astype(PETSc.ScalarType)
    return PETSc.Mat().createAIJ(size=whole.shape, csr=csr, comm=MPI.COMM_SELF)


def to_matrices(operators: Operators) -> dict[str, sparse.csr_matrix]:
    """Return "stiffness", "mass" and, where there is one, "damping" of a model (n, n), contacts bonded in the stiffness.

    Raises `ModelError` on several ranks, where no rank has them all.
    """
    if operators.comm.size > 1:
        raise ModelError("ranks", "matrices can be had on one rank only")
    result = {}
    for name in ("stiffness", "mass", "damping"):
        matrix = getattr(operators, name)
        if matrix is not None:
            indptr, indices, data = (matrix if matrix.getType() != "seqdense" else matrix.convert("aij")).getValuesCSR()
            result[name] = sparse.csr_matrix((np.real(data), indices, indptr), shape=matrix.getSize())
    return result
