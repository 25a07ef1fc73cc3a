"""Static answers to loads, contact forces and the weights of resultants beside the modes of a basis.

With the answer x = K^-1 w to the weights w of a resultant w^T u in the basis, w^T u = x^T (f - C u' - M u''): the resultant balances loads
and inertia, where the strain of a stiff spring would have to be summed up from many modes.

Loads may act on dofs without mass, such as the auxiliary nodes of joints. The norm of the mass does not see what they do there, so
what is new in an answer is judged by its strain energy. Answers of little mass follow from their equilibrium: they are vectors without
mass.
"""

from __future__ import annotations

import logging

import numpy as np

from uplift.forms.operators import Operators
from uplift.solvers.bases.basis import Basis, Projected, apply, inner, projected_matrices
from uplift.solvers.bases.orthonormal import DEPENDENT
from uplift.solvers.bases.springs import inside_contacts
from uplift.solvers.bases.starting_block import unit_columns
from uplift.solvers.linear import SAME_PATTERN, DirectSolver

log = logging.getLogger(__name__)

MASSLESS = (np.finfo(float).eps / DEPENDENT) ** 2
"""Of the largest mass per stiffness among the answers: less is round-off, which leaving out what is known enlarges by 1 / `DEPENDENT`."""


def with_static_answers(
    operators: Operators, basis: Basis, *, shift: float = 0.0, joints: bool = False, prefix: str = "correction_"
) -> Basis:
    """Return `basis` followed by the static answers (K - shift M)^-1 f to every load, unit release force and resultant (collective).

    `basis` holds modes, M-orthonormal; `shift` <= 0 in rad2/s2 is that of their search. What is new in the answers is appended,
    orthogonal to all others in stiffness and mass, so that their projections are diagonal. An answer with nothing new is left out.
    `joints` adds the dofs inside the contacts: where the masses of auxiliary nodes count, their own equation has to hold, or else a
    release force makes energy.
    Raises `SolverError` where nothing holds the structure and the shift is 0.
    """
    push = operators.contacts.push.toarray()
    forces = np.column_stack([*(np.real(load.vector.array_r) for load in operators.loads), *push.T, *operators.reactions.local.toarray()])
    stiffness = operators.stiffness.copy()
    if shift:
        stiffness.axpy(-shift, operators.mass, structure=SAME_PATTERN)
    answers = _answers(operators, stiffness, forces, prefix)
    inside = inside_contacts(operators) if joints else np.zeros(0, dtype=int)
    more = np.hstack([answers, unit_columns(operators, inside)])
    found = _new_directions(operators, stiffness, basis.vectors, more)
    stiffness.destroy()
    largest = _largest_mass_per_stiffness(operators, forces, answers)
    mass, turn = np.linalg.eigh(inner(found, apply(operators.mass, found), operators.comm))
    light = mass <= MASSLESS * largest
    # The slow ones first: what is left of them in the quick ones is round-off.
    vectors = _mass_orthonormal(operators, basis.vectors, (found @ turn[:, ~light])[:, ::-1])
    massless = np.arange(vectors.shape[1] + light.sum()) >= vectors.shape[1]
    vectors = np.hstack([vectors, found @ turn[:, light]])
    log.info("static correction: %d of %d static answers added to %d vectors", found.shape[1], more.shape[1], basis.size)
    known = projected_matrices(operators, vectors)
    kept = np.outer(~massless, ~massless)
    return Basis(vectors, basis.comm, Projected(known.stiffness, np.where(kept, known.mass, 0.0), known.damping))


def _answers(operators: Operators, stiffness: object, forces: np.ndarray, prefix: str) -> np.ndarray:
    """Return the answers (n_local, k) of the stiffness to forces (n_local, k); none to a force that is zero."""
    answers = np.zeros(forces.shape)
    right, answer = operators.new_vector(), operators.new_vector()
    with DirectSolver(stiffness, prefix, definite=True, what="static correction") as solver:
        for column, force in enumerate(forces.T):
            right.array[:] = force
            if right.norm() > 0:
                solver.solve(right, answer, check=True)
                answers[:, column] = np.real(answer.array_r)
    right.destroy()
    answer.destroy()
    return answers


def _new_directions(operators: Operators, stiffness: object, modes: np.ndarray, answers: np.ndarray) -> np.ndarray:
    """Return what the answers (n_local, k) have beside the modes, orthonormal in the stiffness (Gram-Schmidt, twice)."""
    comm, found = operators.comm, np.zeros((len(answers), 0))
    for answer in answers.T:
        column = answer[:, None].copy()
        whole = np.sqrt(inner(column, apply(stiffness, column), comm)[0, 0])
        for _ in range(2):
            column -= modes @ inner(modes, apply(operators.mass, column), comm)
            column -= found @ inner(found, apply(stiffness, column), comm)
        rest = np.sqrt(max(inner(column, apply(stiffness, column), comm)[0, 0], 0.0))
        if rest > DEPENDENT * whole:
            found = np.hstack([found, column / rest])
    return found


def _mass_orthonormal(operators: Operators, vectors: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return `vectors` (n_local, m), M-orthonormal, followed by others (n_local, k) in their order (Gram-Schmidt, twice)."""
    comm = operators.comm
    for other in others.T:
        column = other[:, None]
        for _ in range(2):
            column = column - vectors @ inner(vectors, apply(operators.mass, column), comm)
        vectors = np.hstack([vectors, column / np.sqrt(inner(column, apply(operators.mass, column), comm)[0, 0])])
    return vectors


def _largest_mass_per_stiffness(operators: Operators, forces: np.ndarray, answers: np.ndarray) -> float:
    """Return the largest x^T M x / x^T K x in s2 among the answers x to forces."""
    comm = operators.comm
    mass = np.diag(inner(answers, apply(operators.mass, answers), comm))
    energy = np.diag(inner(answers, forces, comm))
    return float(np.max(np.divide(mass, energy, out=np.zeros_like(mass), where=energy > 0), initial=0.0))
