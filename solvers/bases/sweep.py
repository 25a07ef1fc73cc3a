"""The sweep in a basis: small dense systems instead of one factorisation a point, in real PETSc as well as in the complex one."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from uplift.forms.operators import Operators
from uplift.solvers.bases.basis import Basis, inner
from uplift.solvers.bases.project import ReducedModel
from uplift.solvers.errors import SolverError
from uplift.solvers.frequency_domain.sweep import FieldResponse, Transfer

BATCH_BYTES = 2**26
"""Points are solved in batches whose matrices take up to this much memory."""

CHECK_EVERY = 8

RESIDUAL_LIMIT = 1e-12
"""Largest admissible backward error of a small system; a sound one stays below 1e-15."""


@dataclass(frozen=True)
class ReducedTransfer(Transfer):
    """A transfer whose `fields` are coordinates (n_points, n_columns, m) of a basis."""

    basis: Basis

    def response(self, drive: np.ndarray) -> FieldResponse | None:
        """Return the fields that answer to amplitudes of the columns, as `Transfer.response`."""
        found = super().response(drive)
        return None if found is None else FieldResponse(found.spectrum, self.basis.vectors)


class ReducedSweep:
    """Makes sweeps in the basis of a reduced model; called as `uplift.solvers.frequency_domain.sweep.sweep` is."""

    def __init__(self, model: ReducedModel) -> None:
        """Take the model; its own loads and contacts are the columns."""
        self.model = model

    def __call__(
        self, operators: Operators, first: np.ndarray, second: np.ndarray, *, more: tuple[Any, ...] = (), prefix: str, what: str
    ) -> ReducedTransfer:
        """Solve (K + first C + second M) X = [loads, unit release forces, more] in the basis at each point (collective).

        The systems are scaled to a like diagonal, because a basis holds stiff directions beside soft ones, and one point in
        `CHECK_EVERY` is checked by its residual. Raises `SolverError` where that is not small.
        """
        begin = time.perf_counter()
        model = self.model
        extra = [np.real(vector.array_r)[:, None] for vector in more]
        columns = [model.loads, model.push] + [inner(model.basis.vectors, column, operators.comm) for column in extra]
        scale = 1 / np.sqrt(np.diag(model.stiffness) + np.median(np.abs(second)) * np.diag(model.mass))
        stiffness, damping, mass = (a * np.outer(scale, scale) for a in (model.stiffness, model.damping, model.mass))
        right = scale[:, None] * np.hstack(columns)
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
        seen = [rows @ answers for rows in (model.probes, model.elongation, model.resultants)]
        seconds = time.perf_counter() - begin
        return ReducedTransfer(seen[0], seen[1], seen[2], answers.transpose(0, 2, 1), 0.0, seconds, model.basis)
