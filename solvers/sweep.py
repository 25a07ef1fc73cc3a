"""The sweep: transfer functions from loads and release forces to probes, contacts and resultants.

At every point the matrix K + first C + second M is factorised once and solved for all loads and for one unit release force at
each contact; whatever is asked of the contacts afterwards is algebra of the size of the contacts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from forms.operators import Functionals, Operators
from solvers.linear import DirectSolver

FIELD_BYTES = 2**30
"""Whole fields are kept at every point only up to this much memory a rank."""

SAME = PETSc.Mat.Structure.SAME_NONZERO_PATTERN


@dataclass(frozen=True)
class Transfer:
    """Answers to unit loads and unit release forces at each point; columns: loads, then channels of the contacts."""

    probes: np.ndarray
    """(n_points, n_probes, n_columns) m."""
    elongation: np.ndarray
    """(n_points, n_channels, n_columns) m."""
    resultants: np.ndarray
    """(n_points, 3 or 0, n_columns): the linear parts of the reactions."""
    fields: np.ndarray | None
    """(n_points, n_columns, n_local) m: this rank's part of the solutions, where memory allows."""
    factor_seconds: float
    solve_seconds: float

    def field(self, weights: np.ndarray) -> np.ndarray | None:
        """Return this rank's part (n_local,) of the real part of the sum of all solutions times `weights` (n_points, n_columns)."""
        if self.fields is None:
            return None
        return np.real(weights.reshape(-1) @ self.fields.reshape(weights.size, -1))


def sweep(
    operators: Operators, first: np.ndarray, second: np.ndarray, *, more: tuple[Any, ...] = (), prefix: str, what: str
) -> Transfer:
    """Solve (K + first C + second M) X = [loads, unit release forces, more] at each point (collective).

    `first` in 1/s and `second` in 1/s2 are complex, (n_points,); `more` are further load vectors. Needs complex PETSc. One matrix
    is refilled on one pattern, and every solution is checked by its residual.
    """
    if not np.issubdtype(PETSc.ScalarType, np.complexfloating):
        raise RuntimeError(f"the {what} needs complex PETSc, and this process has the real one")
    contacts = operators.contacts
    units = []
    for j in range(contacts.law.n_channels):
        units.append(operators.new_vector())
        units[-1].array[:] = contacts.push[:, [j]].toarray().ravel()
    columns = [*(load.vector for load in operators.loads), *units, *more]
    observed: list[Functionals] = [operators.probes, contacts.elongation]
    if operators.reactions is not None:
        observed.append(operators.reactions.functionals)
    parts = [np.zeros((len(first), len(columns), len(f.names)), dtype=complex) for f in observed]
    fits = 16 * len(first) * len(columns) * operators.n_local <= FIELD_BYTES
    keep = operators.comm.allreduce(int(fits), op=min) == 1
    fields = np.zeros((len(first), len(columns), operators.n_local), dtype=complex) if keep else None
    matrix, solution = operators.stiffness.copy(), operators.new_vector()
    _combine(operators, first[0], second[0], matrix)
    with DirectSolver(matrix, prefix, definite=False, what=what) as solver:
        for i in range(len(first)):
            if i > 0:
                _combine(operators, first[i], second[i], matrix)
                solver.refactor()
            for j, column in enumerate(columns):
                solver.solve(column, solution, check=True)
                here = solution.array_r
                for part, functionals in zip(parts, observed, strict=True):
                    part[i, j] = functionals.partial(here)
                if fields is not None:
                    fields[i, j] = here
        seconds = solver.factor_seconds, solver.solve_seconds
    for thing in (matrix, solution, *units):
        thing.destroy()
    totals = [f.total(part).transpose(0, 2, 1) for f, part in zip(observed, parts, strict=True)]
    if operators.reactions is None:
        totals.append(np.zeros((len(first), 0, len(columns)), dtype=complex))
    return Transfer(totals[0], totals[1], totals[2], fields, *seconds)


def _combine(operators: Operators, first: complex, second: complex, matrix: Any) -> None:
    operators.stiffness.copy(matrix, structure=SAME)
    matrix.axpy(second, operators.mass, structure=SAME)
    if operators.damping is not None:
        matrix.axpy(first, operators.damping, structure=SAME)
