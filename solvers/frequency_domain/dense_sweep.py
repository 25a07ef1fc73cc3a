"""The sweep in a basis: small dense systems instead of one factorisation a point, in real PETSc as well as in the complex one."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from uplift.forms.operators import Operators
from uplift.solvers.errors import SolverError
from uplift.solvers.frequency_domain.transfer import Transfer

BATCH_BYTES = 2**26
"""Points are solved in batches whose matrices take up to this much memory."""

CHECK_EVERY = 8

RESIDUAL_LIMIT = 1e-12
"""Largest admissible backward error of a small system; a sound one stays below 1e-15."""


def dense_sweep(operators: Operators, first: np.ndarray, second: np.ndarray, *, more: tuple[Any, ...] = (), what: str) -> Transfer:
    """Solve (K + first C + second M) X = [loads, unit release forces, more] in the basis at each point; as `sweep.sweep`.

    The systems are scaled to a like diagonal, because a basis holds stiff directions beside soft ones, and one point in
    `CHECK_EVERY` is checked by its residual. Raises `SolverError` where that is not small.
    """
    begin = time.perf_counter()
    stiffness, mass = (np.real(matrix.getDenseArray()) for matrix in (operators.stiffness, operators.mass))
    damping = np.real(operators.damping.getDenseArray()) if operators.damping is not None else np.zeros_like(mass)
    loads, further = ([np.real(vector.array_r) for vector in vectors] for vectors in ((load.vector for load in operators.loads), more))
    columns = np.column_stack([*loads, operators.contacts.push.toarray(), *further])
    scale = 1 / np.sqrt(np.diag(stiffness) + np.median(np.abs(second)) * np.diag(mass))
    stiffness, damping, mass = (a * np.outer(scale, scale) for a in (stiffness, damping, mass))
    right = scale[:, None] * columns
    m, n = right.shape
    answers = np.empty((len(first), m, n), dtype=complex)
    batch = max(1, BATCH_BYTES // (16 * m * m))
    worst = 0.0
    size = np.linalg.norm(right, axis=0)
    for at in range(0, len(first), batch):
        points = slice(at, at + batch)
        matrices = stiffness + first[points, None, None] * damping + second[points, None, None] * mass
        try:
            found = np.linalg.solve(matrices, np.broadcast_to(right, (len(matrices), m, n)))
        except np.linalg.LinAlgError as error:
            raise SolverError(f"the {what} in the basis meets a singular matrix") from error
        some = slice(None, None, CHECK_EVERY)
        rest = np.linalg.norm(matrices[some] @ found[some] - right, axis=1)
        large = size + np.linalg.norm(matrices[some], axis=(1, 2))[:, None] * np.linalg.norm(found[some], axis=1)
        worst = max(worst, float(np.max(rest / np.where(large > 0, large, 1.0), initial=0.0)))
        answers[points] = scale[:, None] * found
    if not worst <= RESIDUAL_LIMIT:
        raise SolverError(f"the {what} in the basis is solved to a backward error of {worst:.1e} only (limit {RESIDUAL_LIMIT:g})")
    observed = operators.outputs.local.toarray() @ answers
    if operators.outputs.per_velocity is not None:
        observed += first[:, None, None] * (operators.outputs.per_velocity.toarray() @ answers)
    return Transfer(observed, operators.outputs, answers.transpose(0, 2, 1), 0.0, time.perf_counter() - begin)
