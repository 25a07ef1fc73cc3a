"""Static answers to loads and contact forces beside the modes of a basis."""

from __future__ import annotations

import logging

import numpy as np

from uplift.forms.operators import Operators
from uplift.solvers.bases.basis import Basis, apply, inner
from uplift.solvers.bases.orthonormal import DEPENDENT
from uplift.solvers.linear import DirectSolver

log = logging.getLogger(__name__)

def with_static_answers(operators: Operators, basis: Basis, prefix: str = "correction_") -> Basis:
    """Return `basis` followed by the static answers K^-1 f to every load and every unit release force (collective).

    `basis` is M-orthonormal, as modes are; what is new in each answer is appended, M-orthonormal to all before it
    (Gram-Schmidt, twice), and an answer with nothing new is left out. Raises `SolverError` where nothing holds the structure.
    """
    push = operators.contacts.push.toarray()
    forces = [np.real(load.vector.array_r) for load in operators.loads] + list(push.T)
    vectors = basis.vectors
    right, answer = operators.new_vector(), operators.new_vector()
    with DirectSolver(operators.stiffness, prefix, definite=True, what="static correction") as solver:
        for force in forces:
            right.array[:] = force
            if right.norm() == 0:
                continue
            solver.solve(right, answer, check=True)
            column = np.real(answer.array_r)[:, None].copy()
            whole = _mass_norm(operators, column)
            for _ in range(2):
                column -= vectors @ inner(vectors, apply(operators.mass, column), operators.comm)
            rest = _mass_norm(operators, column)
            if rest > DEPENDENT * whole:
                vectors = np.hstack([vectors, column / rest])
    right.destroy()
    answer.destroy()
    added = vectors.shape[1] - basis.size
    log.info("static correction: %d of %d static answers added to %d vectors", added, len(forces), basis.size)
    return Basis(vectors, basis.comm)


def _mass_norm(operators: Operators, column: np.ndarray) -> float:
    return float(np.sqrt(inner(column, apply(operators.mass, column), operators.comm)[0, 0]))
