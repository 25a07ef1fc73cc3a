"""One basis for every frequency, load history and state of the contacts: the block Krylov space of a single factorisation.

With a real shift sigma and B = [loads, unit release forces, ...] the answers (K + s C + s^2 M)^-1 B, at all s of a band, lie almost in

    span { A^-1 B, (A^-1 M) A^-1 B, (A^-1 M)^2 A^-1 B, ... },   A = K + sigma M,

of which some ten blocks do. Static answers are in it (for sigma = 0 exactly), so contact forces come out as well as displacements, and
Newmark, Fourier, Laplace and modal runs can all live in it. Rayleigh damping C = a K + b M leaves the space as it is. Damping that spares
the springs, as here, acts as a K + b M and a force on each spring beside it, so these forces belong to B where they matter. Where these are
many, or where the parts of a structure are damped each in its own way, the space is that of second order, in which A^-1 C takes part as
A^-1 M does (`uplift.solvers.bases.arnoldi`): half as many blocks again, but none of their columns for a spring.

The basis is M-orthonormal and grows block by block until an error estimate at test frequencies, where nothing was solved to build it,
meets a tolerance. Two numbers are looked at. While it grows, everything is known of the smaller basis in the coordinates of the larger:
the residual of the smaller one lies, but for the share of damping, in the span of A times the larger, so that its dual norm
(r^T A^-1 r)^(1/2) is a matter of small matrices, and so is the change of the transfer functions. At the end the true residual of the whole
model is measured for a few random combinations of all columns, in the mean square as large as all columns together.

Sources: Bai and Su, SIAM J. Sci. Comput. 26 (2005) 1692 (Krylov projection of second-order systems); Freund, Acta Numerica 12
(2003) 267 (block Krylov spaces, deflation); Stathopoulos and Wu, SIAM J. Sci. Comput. 23 (2002) 2165 (a block made orthonormal by the
eigenvectors of its Gram matrix); Smetana, Zahm and Patera, SIAM J. Sci. Comput. 41 (2019) A900 (residuals of random combinations).
"""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import sparse

from uplift.forms.operators import Operators
from uplift.solvers.bases.arnoldi import PairSpace
from uplift.solvers.bases.basis import Basis, apply, inner
from uplift.solvers.bases.between import Between
from uplift.solvers.bases.estimator import Estimator, Growth, split_complex
from uplift.solvers.bases.orthonormal import orthonormalise
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.bases.springs import inside_contacts, proportional
from uplift.solvers.bases.starting_block import springs_that_count, starting_forces, unit_columns
from uplift.solvers.errors import SolverError
from uplift.solvers.linear import DirectSolver

log = logging.getLogger(__name__)

COMBINATIONS = 4
"""Random combinations of all columns whose true residual is measured at a frequency; the mean of their squares is short by a factor of 25
once in 100,000 times."""

USUAL_BLOCKS = 8
"""As many as the first order takes as a rule; the second takes some fourteen."""


@dataclass(frozen=True)
class KrylovBasis(Basis):
    """An M-orthonormal basis and how it came about."""

    growth: Growth = field(default_factory=Growth)


def krylov_basis(
    operators: Operators, settings: KrylovSettings, *, more: tuple[Any, ...] = (), prefix: str = "krylov_"
) -> KrylovBasis:
    """Grow the basis until the estimate meets the tolerance at the test frequencies (collective).

    `more` are further load vectors that belong to the starting block. Needs real arithmetic only, whatever the build of PETSc.
    Raises `SolverError` if K + sigma M is singular, or if the tolerance is not met with as many blocks as the settings allow.
    """
    growth = Growth()
    matrix = operators.stiffness.copy()
    if settings.shift:
        matrix.axpy(settings.shift, operators.mass, structure=matrix.Structure.SAME_NONZERO_PATTERN)
    try:
        with DirectSolver(matrix, prefix, definite=True, what="Krylov basis") as solver:
            return _Builder(operators, settings, solver, growth).run(more)
    finally:
        matrix.destroy()


class _Builder:
    """The vectors so far and the model between them."""

    def __init__(self, operators: Operators, settings: KrylovSettings, solver: DirectSolver, growth: Growth) -> None:
        self.operators, self.settings, self.solver, self.growth = operators, settings, solver, growth
        self.comm = operators.comm
        self.size = 0
        self._vectors = np.empty((operators.n_local, 0), order="F")
        self._rows = sparse.vstack([operators.probes.local, operators.contacts.elongation.local], format="csr")
        self._pairs = PairSpace()
        self._shift = 0.0
        """Where second-order spaces begin, on the real axis of s."""

    @property
    def vectors(self) -> np.ndarray:
        return self._vectors[:, : self.size]

    def run(self, more: tuple[Any, ...]) -> KrylovBasis:
        growth, settings, operators = self.growth, self.settings, self.operators
        forces = starting_forces(operators, more)
        if forces.shape[1] == 0:
            raise SolverError("the Krylov basis has nothing to start from: the model has neither loads nor contacts")
        answers = self._solve(forces)
        springs, stiff = springs_that_count(operators, forces, answers, settings.tolerance)
        last = unit_columns(operators, inside_contacts(operators))
        # A spring that begins costs a vector a block, one whose static answer does just that: from here on the second order has fewer.
        costs = self.comm.allreduce(USUAL_BLOCKS * len(springs) + len(stiff))
        if costs > USUAL_BLOCKS * forces.shape[1] or not proportional(operators, forces, answers):
            answers = self._second_order(forces, answers)
        else:
            begin, end = unit_columns(operators, springs), unit_columns(operators, stiff)
            forces = np.hstack([forces, begin])
            if begin.shape[1]:
                answers = np.hstack([answers, self._solve(begin)])
            if end.shape[1]:
                last = np.hstack([self._solve(end), last])
        self.forces = forces
        growth.columns = self.forces.shape[1]
        self.between = Between(growth.columns, self._rows.shape[0])
        self.between.sigma, self.between.shift = settings.shift, self._shift
        omega = 2 * np.pi * settings.test_frequencies
        estimator = Estimator(self.between, omega, settings.tolerance, growth)
        met = False
        while not met:
            before = self.size
            rights = self._expand(answers)
            growth.sizes.append(self.size)
            exhausted = rights.shape[1] == 0 or self.size == operators.n
            if len(growth.sizes) > 1 and self.size > before:
                begun = time.perf_counter()
                estimator.measure(before)
                self._clock("estimate", begun)
            if exhausted or estimator.promising():
                grown = self.size
                self._add(last)
                self._vectors[:, grown : self.size] = self.vectors[:, grown:] @ self.between.untangle(grown)
                self._check(sorted({estimator.worst, float(omega[-1])}))
                met = growth.estimate <= settings.tolerance
                if not met:
                    self._shrink(grown)  # the next block must follow from this one alone
            if not met:
                if exhausted or len(growth.sizes) == settings.blocks:
                    raise SolverError(self._failure(exhausted))
                answers = self._solve(rights)
        growth.seconds = {"factorisation": self.solver.factor_seconds, "solves": self.solver.solve_seconds} | growth.seconds
        log.info(
            "Krylov basis: %d vectors from %d columns in %d blocks of order %d, relative residual %.1e to %g Hz",
            self.size, growth.columns, len(growth.sizes), growth.order, growth.estimate, settings.band,
        )
        return KrylovBasis(self.vectors, self.comm, self.between.projected, growth)

    def _second_order(self, forces: np.ndarray, answers: np.ndarray) -> np.ndarray:
        """Choose the space of second order; return the answers (n_local, b) to the forces that it begins with (collective)."""
        self.growth.order = 2
        if self.settings.shift == 0:
            return answers
        # K + s C + s^2 M about a real s instead of K - omega^2 M about omega^2 = -sigma.
        self._shift = float(np.sqrt(self.settings.shift))
        matrix = self.solver.matrix
        matrix.axpy(self._shift, self.operators.damping, structure=matrix.Structure.SAME_NONZERO_PATTERN)
        self.solver.refactor()
        return self._solve(forces)

    def _expand(self, answers: np.ndarray) -> np.ndarray:
        """Add a block of answers to the basis; return the forces (n_local, b) that the next one answers, none at the end (collective)."""
        sizes, before = self.growth.sizes, self.size
        if self.growth.order == 1:
            rights = self._add(answers, recent=sizes[-3] if len(sizes) > 2 else 0)
            return rights if self.size > before else rights[:, :0]
        self._add(answers)
        coordinates = inner(self.vectors, apply(self.operators.mass, answers), self.comm)
        if self._pairs.add(coordinates) == 0:
            return answers[:, :0]
        scale = 2 * np.pi * self.settings.band
        x, y = (self.vectors @ half for half in self._pairs.last(self.size))
        return -scale * apply(self.operators.damping, x) - apply(self.operators.mass, scale**2 * y + 2 * self._shift * scale * x)

    def _failure(self, exhausted: bool) -> str:
        reached = self.growth.estimate if self.growth.checked else min(self.growth.residual, default=float("nan"))
        why = "no new direction is left" if exhausted else f"{len(self.growth.sizes)} blocks are made"
        return (
            f"the Krylov basis of {self.size} vectors has a residual of {reached:.1e} (tolerance {self.settings.tolerance:g}) and {why}: "
            "a larger tolerance, a narrower band or more blocks"
        )

    def _solve(self, rights: np.ndarray) -> np.ndarray:
        self.growth.solves += rights.shape[1]
        return self.solver.solve_columns(rights)

    def _add(self, columns: np.ndarray, recent: int = 0) -> np.ndarray:
        """Append what is new in `columns` (n_local, b), M-orthonormal, and project the model on it; return M times what is new.

        `recent` is the first vector that the columns are not orthogonal to but for round-off.
        """
        begin = time.perf_counter()
        new, moved = orthonormalise(columns, self.vectors, self.operators, recent)
        b, m = new.shape[1], self.size
        if m + b > self._vectors.shape[1]:
            larger = np.empty((len(new), max(m + b, 2 * self._vectors.shape[1], 8 * b)), order="F")
            larger[:, :m] = self.vectors
            self._vectors = larger
        self._vectors[:, m : m + b] = new
        self.size = m + b
        begin = self._clock("orthonormalisation", begin)
        products = [apply(self.operators.stiffness, new)]
        if self.operators.damping is not None:
            products.append(apply(self.operators.damping, new))
        between = np.split(inner(self.vectors, np.hstack(products), self.comm), len(products), axis=1)
        damped = between[1] if len(between) == 2 else np.zeros((self.size, b))
        observed = self.operators.outputs.total(self._rows @ new)
        self.between.append(between[0], damped, inner(new, self.forces, self.comm), observed)
        self._clock("projection", begin)
        return moved

    def _clock(self, phase: str, begin: float) -> float:
        now = time.perf_counter()
        self.growth.seconds[phase] = self.growth.seconds.get(phase, 0.0) + now - begin
        return now

    def _shrink(self, size: int) -> None:
        """Keep the first `size` vectors."""
        self.size = size
        self.between.shrink(size)

    def _check(self, omegas: list[float]) -> None:
        """Measure the true residual of the whole model at some frequencies in rad/s (collective)."""
        begin, before = time.perf_counter(), self.solver.solve_seconds
        _, size = self.between.shifted_sizes()
        angles = np.random.default_rng(0).random((len(omegas), len(size), COMBINATIONS))
        combinations = np.exp(2j * np.pi * angles) / size[:, None] / np.sqrt(COMBINATIONS)
        rests = []
        for omega, combined in zip(omegas, combinations, strict=True):
            motion = self.vectors @ split_complex(np.linalg.solve(self.between.dynamic(omega), self.between.generalised @ combined))
            rest = self.forces @ split_complex(combined) - apply(self.operators.stiffness, motion)
            rest += omega**2 * apply(self.operators.mass, motion)
            if self.operators.damping is not None:
                real, imaginary = np.split(omega * apply(self.operators.damping, motion), 2, axis=1)
                rest += np.hstack([imaginary, -real])
            rests.append(rest)
        rest = np.hstack(rests)
        answers = self._solve(rest)
        square = self.comm.allreduce(np.einsum("ij,ij->j", rest, answers)).reshape(len(omegas), -1).sum(axis=1)
        self.growth.checked = [
            (omega / (2 * np.pi), float(value)) for omega, value in zip(omegas, np.sqrt(np.maximum(square, 0.0)), strict=True)
        ]
        self._clock("estimate", begin + self.solver.solve_seconds - before)
