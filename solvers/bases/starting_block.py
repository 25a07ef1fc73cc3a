"""What a Krylov basis begins with: loads, unit release forces, and the springs that damping spares."""

from __future__ import annotations

from typing import Any

import numpy as np

from uplift.forms.operators import Operators
from uplift.solvers.bases.springs import spring_forces

LEFT_BY_STATIC = 0.05
"""What the static answer to a spring's force leaves of its share of the response; measured on the reference case to 25 Hz: 0.01."""


def starting_forces(operators: Operators, more: tuple[Any, ...]) -> np.ndarray:
    """Return the loads that are not zero, the unit release forces and `more` as columns (n_local, n_columns) N."""
    vectors = [load.vector for load in operators.loads] + list(more)
    columns = [np.real(vector.array_r)[:, None] for vector in vectors if vector.norm() > 0]
    return np.asfortranarray(np.hstack([np.zeros((operators.n_local, 0)), *columns, operators.contacts.push.toarray()]))


def springs_that_count(
    operators: Operators, forces: np.ndarray, answers: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return this rank's rows of the springs that damping spares: those to begin with, those whose static answers do.

    `forces` (n_local, b) N begin the basis, `answers` are their static answers. Beside a structure of compliance c a spring k adds
    w = k c / (1 + (k c)^2) of the response, and the root of it in the norm of the energy. Of stiff and soft ones the static answer alone
    leaves `LEFT_BY_STATIC` w.
    """
    if operators.damping is None:
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    total = operators.comm.allreduce(np.abs(forces).sum(axis=0))
    reach = np.max(operators.comm.allgather(np.abs(answers).max(axis=0, initial=0.0)), axis=0)
    rows, stiffness = spring_forces(operators)
    ratio = stiffness * float(np.max(reach / total))
    weight = ratio / (1 + ratio**2)
    begins = LEFT_BY_STATIC * weight > tolerance
    counts = ~begins & (weight > tolerance**2)
    return rows[begins], rows[counts]


def unit_columns(operators: Operators, rows: np.ndarray) -> np.ndarray:
    """Return columns (n_local, n_columns) that are 1 in one of the `rows` of each rank, one rank after the other."""
    numbers = operators.comm.allgather(len(rows))
    columns = np.zeros((operators.n_local, sum(numbers)))
    columns[rows, sum(numbers[: operators.comm.rank]) + np.arange(len(rows))] = 1.0
    return columns
