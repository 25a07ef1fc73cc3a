"""Direct solution of one sparse symmetric system, checked by its residual."""

from __future__ import annotations

import logging
import time
from typing import Any

import numpy as np
from petsc4py import PETSc

from solvers.errors import SolverError

log = logging.getLogger(__name__)

SMALL = 2000
"""Up to this many dofs on one rank PETSc's own factorisation beats MUMPS, whose solves cost a fixed 0.1 ms."""

RESIDUAL_LIMIT = 1e-11
"""Largest admissible backward error of a direct solve; a sound factorisation stays below 1e-14."""


class DirectSolver:
    """A factorised matrix. Its owner closes it (`with`); `refactor` follows new values in the same matrix."""

    def __init__(self, matrix: Any, prefix: str, *, definite: bool, what: str = "system") -> None:
        """Factorise `matrix` (collective).

        `definite`: symmetric positive definite, by Cholesky; else symmetric (complex symmetric, not Hermitian).
        `prefix` is the prefix of PETSc options, the same on all ranks; `what` names the system in messages.
        """
        self.matrix = matrix
        self.what = what
        self.factorisations = 0
        self.factor_seconds = 0.0
        self.solve_seconds = 0.0
        self._ksp = PETSc.KSP().create(matrix.comm)
        self._ksp.setOptionsPrefix(prefix)
        self._ksp.setType("preonly")
        self._ksp.setErrorIfNotConverged(True)
        pc = self._ksp.getPC()
        small = matrix.comm.size == 1 and matrix.getSize()[0] <= SMALL
        if small:
            pc.setType("cholesky" if definite else "lu")
            # PETSc compares pivots with an absolute number, which means nothing in another system of units.
            pc.setFactorPivot(zeropivot=1e-290)
        else:
            pc.setType("cholesky")  # L D L^T of the symmetric matrix, half the work of LU
            pc.setFactorSolverType("mumps")
            if definite:
                matrix.setOption(PETSc.Mat.Option.SPD, True)
        self._ksp.setFromOptions()
        self.refactor()

    def refactor(self) -> None:
        """Factorise the present values of the matrix (collective). Raises `SolverError` if it is singular."""
        begin = time.perf_counter()
        try:
            self._ksp.setOperators(self.matrix)
            self._ksp.setUp()
        except PETSc.Error as error:
            raise SolverError(f"the matrix of the {self.what} cannot be factorised: it is singular") from error
        self.factorisations += 1
        self.factor_seconds += time.perf_counter() - begin

    def solve(self, right: Any, solution: Any, *, check: bool = False) -> None:
        """Solve for one right-hand side (collective); with `check`, raise `SolverError` if the residual is not small."""
        begin = time.perf_counter()
        try:
            self._ksp.solve(right, solution)
        except PETSc.Error as error:
            raise SolverError(f"the {self.what} cannot be solved: its matrix is singular") from error
        self.solve_seconds += time.perf_counter() - begin
        if check:
            self.check(right, solution)

    def solve_columns(self, rights: np.ndarray) -> np.ndarray:
        """Solve for many real right-hand sides at once, this rank's rows (n_local, n_columns) (collective).

        Columns that go through the factors together cost less than half of what they cost one by one. The first is checked by its
        residual as in `solve`. Returns the solutions (n_local, n_columns), columns contiguous.
        """
        begin = time.perf_counter()
        n_local, n = self.matrix.getSizes()[0]
        size, comm = ((n_local, n), (PETSc.DECIDE, rights.shape[1])), self.matrix.comm
        given = PETSc.Mat().createDense(size=size, array=np.asfortranarray(rights, dtype=PETSc.ScalarType), comm=comm)
        given.assemble()
        found = PETSc.Mat().createDense(size=size, comm=comm)
        found.setUp()
        try:
            self._ksp.getPC().getFactorMatrix().matSolve(given, found)
        except PETSc.Error as error:
            raise SolverError(f"the {self.what} cannot be solved: its matrix is singular") from error
        solutions = np.real(found.getDenseArray()).copy(order="F")
        given.destroy()
        found.destroy()
        self.solve_seconds += time.perf_counter() - begin
        right, solution = self.matrix.createVecs()
        right.array[:], solution.array[:] = rights[:, 0], solutions[:, 0]
        self.check(right, solution)
        right.destroy()
        solution.destroy()
        return solutions

    def check(self, right: Any, solution: Any) -> float:
        """Return the backward error |D (b - A x)| / (|D b| + |D^-1 x|) with D = |diag A|^-1/2; raise `SolverError` above the limit.

        The scaling weighs each equation by its own stiffness, so that an entry of 1e15 N/m hides no other; D A D has a unit diagonal.
        Relative to |D b| alone the residual would grow with the condition of the matrix, as of a thin plate that gives way to its load.
        Source: Higham, Accuracy and Stability of Numerical Algorithms, section 7.1.
        """
        residual = right.duplicate()
        scale = self.matrix.getDiagonal()
        self.matrix.mult(solution, residual)
        residual.aypx(-1.0, right)
        scale.array[:] = 1.0 / np.sqrt(np.maximum(np.abs(scale.array), np.finfo(float).tiny))
        residual.pointwiseMult(residual, scale)
        size = residual.norm()
        residual.pointwiseMult(right, scale)
        reference = residual.norm()
        residual.pointwiseDivide(solution, scale)
        reference += residual.norm()
        residual.destroy()
        scale.destroy()
        ratio = size / reference if reference > 0 else size
        if not ratio <= RESIDUAL_LIMIT:
            raise SolverError(f"the {self.what} is solved to a backward error of {ratio:.1e} only (limit {RESIDUAL_LIMIT:g})")
        log.debug("%s: backward error %.1e", self.what, ratio)
        return float(ratio)

    def __enter__(self) -> DirectSolver:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Free the factors."""
        self._ksp.destroy()
