"""The frequency sweep: transfer functions from loads and contact forces to probes and contacts, and what follows from them.

Every frequency is factorised once and solved for all loads and for one unit release force at each contact; whatever is
asked of the contacts afterwards is algebra of the size of the contacts.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from forms.operators import Operators
from solvers import fourier
from solvers.history import History
from solvers.linear import DirectSolver
from solvers.newmark import load_values
from solvers.parameters import Window

log = logging.getLogger(__name__)

FIELD_BYTES = 2**30
"""Whole fields are kept at every frequency only up to this much memory a rank."""


@dataclass(frozen=True)
class Transfer:
    """Answers to unit loads and unit release forces at each frequency; columns: loads, then contacts."""

    omega: np.ndarray
    """(n_f,) rad/s."""
    probes: np.ndarray
    """(n_f, n_probes, n_loads + n_c) m."""
    elongation: np.ndarray
    """(n_f, n_c, n_loads + n_c) m."""
    fields: np.ndarray | None
    """(n_f, n_loads + n_c, n_local) m: this rank's part of the solutions, where memory allows."""
    factor_seconds: float
    solve_seconds: float


def sweep(operators: Operators, omega: np.ndarray, prefix: str = "harmonic_") -> Transfer:
    """Solve (K + i omega C - omega^2 M) X = [loads, unit release forces] at each omega in rad/s (collective).

    Needs complex PETSc. One matrix is refilled on one pattern; every solution is checked by its residual.
    """
    if not np.issubdtype(PETSc.ScalarType, np.complexfloating):
        raise RuntimeError("the frequency sweep needs complex PETSc, and this process has the real one")
    contacts = operators.contacts
    n_loads, n_c = len(operators.loads), len(contacts.names)
    columns = [load.vector for load in operators.loads]
    for j in range(n_c):
        unit = operators.new_vector()
        unit.array[:] = contacts.push[:, [j]].toarray().ravel()
        columns.append(unit)
    observed = operators.probes, contacts.elongation
    parts = [np.zeros((len(omega), len(columns), len(f.names)), dtype=complex) for f in observed]
    keep = 16 * len(omega) * len(columns) * operators.n_local <= FIELD_BYTES
    keep = operators.comm.allreduce(int(keep), op=min) == 1
    fields = np.zeros((len(omega), len(columns), operators.n_local), dtype=complex) if keep else None
    matrix = operators.stiffness.copy()
    solution = operators.new_vector()
    solver: DirectSolver | None = None
    for i, w in enumerate(omega):
        _dynamic_stiffness(operators, w, matrix)
        if solver is None:
            solver = DirectSolver(matrix, prefix, definite=False, what="frequency sweep")
        else:
            solver.refactor()
        for j, column in enumerate(columns):
            solver.solve(column, solution, check=True)
            here = solution.array_r
            for part, functionals in zip(parts, observed, strict=True):
                part[i, j] = functionals.partial(here)
            if fields is not None:
                fields[i, j] = here
    seconds = (solver.factor_seconds, solver.solve_seconds) if solver else (0.0, 0.0)
    for thing in (matrix, solution, *columns[n_loads:]):
        thing.destroy()
    if solver is not None:
        solver.__exit__()
    probes, elongation = (f.total(part).transpose(0, 2, 1) for f, part in zip(observed, parts, strict=True))
    return Transfer(np.asarray(omega), probes, elongation, fields, *seconds)


def _dynamic_stiffness(operators: Operators, omega: float, matrix: Any) -> None:
    same = PETSc.Mat.Structure.SAME_NONZERO_PATTERN
    operators.stiffness.copy(matrix, structure=same)
    matrix.axpy(-(omega**2), operators.mass, structure=same)
    if operators.damping is not None:
        matrix.axpy(1j * omega, operators.damping, structure=same)


class FourierResponse:
    """The periodic response over a window, band-limited, to the loads and to given release forces."""

    def __init__(self, operators: Operators, window: Window, transfer: Transfer) -> None:
        """Transform the loads; `transfer` must hold the window's frequencies."""
        self.window = window
        self.transfer = transfer
        n_f = len(transfer.omega)
        self._loads = fourier.forward(load_values(operators, window.times))[:n_f]

    def spectrum(self, release: np.ndarray | None) -> np.ndarray:
        """Return the spectra (n_f, n_loads + n_c) of the loads and of release forces (samples, n_c) N (None: zero)."""
        n_c = self.transfer.elongation.shape[1]
        n_f = len(self._loads)
        forces = np.zeros((n_f, n_c)) if release is None else fourier.forward(release)[:n_f]
        return np.concatenate([self._loads, forces], axis=1)

    def probe_spectrum(self, release: np.ndarray | None) -> np.ndarray:
        """Return the spectra of the probes (n_f, n_probes)."""
        return np.einsum("fpj,fj->fp", self.transfer.probes, self.spectrum(release))

    def history(self, release: np.ndarray | None) -> History:
        """Return the response at the samples of the window."""
        drive = self.spectrum(release)
        samples = self.window.samples
        probes = fourier.inverse(np.einsum("fpj,fj->fp", self.transfer.probes, drive), samples)
        elongation = fourier.inverse(np.einsum("fcj,fj->fc", self.transfer.elongation, drive), samples)
        peak = int(np.argmax(np.max(np.abs(probes), axis=1))) if probes.size else 0
        return History(self.window.times, probes, elongation, peak, self._field(drive, peak))

    def _field(self, drive: np.ndarray, sample: int) -> np.ndarray | None:
        if self.transfer.fields is None:
            return None
        n, k = self.window.samples, np.arange(len(drive))
        weight = np.where((k == 0) | (2 * k == n), 1.0, 2.0) / n * np.exp(2j * np.pi * (k * sample % n) / n)
        return np.real(np.einsum("f,fjn,fj->n", weight, self.transfer.fields, drive))
