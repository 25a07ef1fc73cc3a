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
from uplift.solvers.bases.basis import Basis, Projected, apply, inner
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.bases.springs import inside_contacts, proportional, spring_forces
from uplift.solvers.bases.static_answers import DEPENDENT
from uplift.solvers.dense import solve_definite
from uplift.solvers.errors import SolverError
from uplift.solvers.linear import DirectSolver

log = logging.getLogger(__name__)

DEPENDENT_GRAM = 1e-12
"""Directions of a block below this eigenvalue of its scaled Gram matrix are round-off."""

NEARLY = 1e-3
"""A block this close to orthonormal is so to round-off after one more turn."""

STANDSTILL = 0.3
"""A block that leaves more than this part of the residual has come to the end of what blocks can do; usually it leaves a tenth."""

COMBINATIONS = 4
"""Random combinations of all columns whose true residual is measured at a frequency; the mean of their squares is short by a factor of 25
once in 100,000 times."""

LEFT_BY_STATIC = 0.05
"""What the static answer to a spring's force leaves of its share of the response; measured on the reference case to 25 Hz: 0.01."""

BLOCKS = 8
"""As many as the first order takes as a rule; the second takes some fourteen."""


@dataclass
class Growth:
    """How a basis came about."""

    order: int = 1
    """Of the Krylov space: 1, or 2 where damping takes part."""
    columns: int = 0
    """Columns of the starting block."""
    sizes: list[int] = field(default_factory=list)
    """Vectors after each block."""
    residual: list[float] = field(default_factory=list)
    """Largest relative dual norm of the residual over test frequencies and columns, of the basis without its last block."""
    change: list[float] = field(default_factory=list)
    """Largest relative change of a transfer function by the last block."""
    checked: list[tuple[float, float]] = field(default_factory=list)
    """(Hz, relative dual norm of the true residual of the finished basis, root sum of squares of all columns)."""
    solves: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    """Wall seconds: factorisation, solves, orthonormalisation, projection, estimate."""

    @property
    def estimate(self) -> float:
        """The stated error: relative dual norm of the true residual where it was measured."""
        return max((value for _, value in self.checked), default=0.0)


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
        self._stiffness, self._damping, self._mass = (np.zeros((0, 0)) for _ in range(3))
        self._looks = sparse.vstack([operators.probes.local, operators.contacts.elongation.local], format="csr")
        self._seen = np.zeros((self._looks.shape[0], 0))
        self.omega = 2 * np.pi * settings.test_frequencies
        self._worst = float(self.omega[-1])
        self._answers: list[np.ndarray] = []
        """Coordinates of the answers at the test frequencies in the basis that was measured last."""
        self._pairs = PairSpace()
        self._shift = 0.0
        """Where second-order spaces begin, on the real axis of s."""

    @property
    def vectors(self) -> np.ndarray:
        return self._vectors[:, : self.size]

    def run(self, more: tuple[Any, ...]) -> KrylovBasis:
        growth, settings = self.growth, self.settings
        forces = _starting_forces(self.operators, more)
        if forces.shape[1] == 0:
            raise SolverError("the Krylov basis has nothing to start from: the model has neither loads nor contacts")
        answers = self._solve(forces)
        springs, stiff = self._springs_that_count(forces, answers)
        last = self._unit_columns(inside_contacts(self.operators))
        # A spring that begins costs a vector a block, one whose static answer does just that: from here on the second order has fewer.
        costs = self.comm.allreduce(BLOCKS * len(springs) + len(stiff))
        if costs > BLOCKS * forces.shape[1] or not proportional(self.operators, forces, answers):
            answers = self._second_order(forces, answers)
        else:
            begin, end = self._unit_columns(springs), self._unit_columns(stiff)
            forces = np.hstack([forces, begin])
            if begin.shape[1]:
                answers = np.hstack([answers, self._solve(begin)])
            if end.shape[1]:
                last = np.hstack([self._solve(end), last])
        self.forces = forces
        growth.columns = self.forces.shape[1]
        self.generalised = np.zeros((0, growth.columns))
        met = False
        while not met:
            before = self.size
            rights = self._expand(answers)
            growth.sizes.append(self.size)
            exhausted = rights.shape[1] == 0 or self.size == self.operators.n
            if len(growth.sizes) > 1 and self.size > before:
                self._estimate(before)
            if exhausted or self._promising():
                grown = self.size
                self._add(last)
                self._untangle(grown)
                self._check()
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
        return KrylovBasis(self.vectors, self.comm, Projected(self._stiffness, self._mass, self._damping), growth)

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
        scale = float(self.omega[-1])
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

    def _springs_that_count(self, forces: np.ndarray, answers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return this rank's rows of the springs that damping spares: those to begin with, those whose static answers do.

        Beside a structure of compliance c a spring k adds w = k c / (1 + (k c)^2) of the response, and the root of it in the norm of
        the energy. Of stiff and soft ones the static answer alone leaves `LEFT_BY_STATIC` w.
        """
        if self.operators.damping is None:
            return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
        total = self.comm.allreduce(np.abs(forces).sum(axis=0))
        reach = np.max(self.comm.allgather(np.abs(answers).max(axis=0, initial=0.0)), axis=0)
        rows, stiffness = spring_forces(self.operators)
        ratio = stiffness * float(np.max(reach / total))
        weight = ratio / (1 + ratio**2)
        begins = LEFT_BY_STATIC * weight > self.settings.tolerance
        counts = ~begins & (weight > self.settings.tolerance**2)
        return rows[begins], rows[counts]

    def _unit_columns(self, rows: np.ndarray) -> np.ndarray:
        """Return columns (n_local, n_columns) that are 1 in one of the `rows` of each rank, one rank after the other."""
        numbers = self.comm.allgather(len(rows))
        columns = np.zeros((self.operators.n_local, sum(numbers)))
        columns[rows, sum(numbers[: self.comm.rank]) + np.arange(len(rows))] = 1.0
        return columns

    def _add(self, columns: np.ndarray, recent: int = 0) -> np.ndarray:
        """Append what is new in `columns` (n_local, b), M-orthonormal, and project the model on it; return M times what is new.

        `recent` is the first vector that the columns are not orthogonal to but for round-off.
        """
        begin = time.perf_counter()
        new, moved = self._orthonormal(columns, recent)
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
        self._stiffness, self._damping = _bordered(self._stiffness, between[0]), _bordered(self._damping, damped)
        self._mass = np.eye(self.size)
        self.generalised = np.vstack([self.generalised, inner(new, self.forces, self.comm)])
        self._seen = np.hstack([self._seen, self.operators.outputs.total(self._looks @ new)])
        self._clock("projection", begin)
        return moved

    def _untangle(self, first: int) -> None:
        """Turn the vectors from `first` on so that K does not couple them.

        They are stiff, 1e13 to 1e16 per unit of mass, and mixed with one another the softer ones would lose their digits.
        """
        _, turned = np.linalg.eigh(self._stiffness[first:, first:])
        self._vectors[:, first : self.size] = self.vectors[:, first:] @ turned
        for matrix in (self._stiffness, self._damping):
            matrix[:, first:] = matrix[:, first:] @ turned
            matrix[first:] = turned.T @ matrix[first:]
        self.generalised[first:] = turned.T @ self.generalised[first:]
        self._seen[:, first:] = self._seen[:, first:] @ turned

    def _shrink(self, size: int) -> None:
        """Keep the first `size` vectors."""
        self.size = size
        self._stiffness, self._damping, self._mass = (a[:size, :size].copy() for a in (self._stiffness, self._damping, self._mass))
        self.generalised, self._seen = self.generalised[:size], self._seen[:, :size]

    def _orthonormal(self, columns: np.ndarray, recent: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the new directions of `columns` and M times them: block Gram-Schmidt, twice, more often only if that does not do.

        A^-1 M is symmetric in the product of the mass, so A^-1 M times the last block has parts in the last two blocks only: the
        first turn looks at these, the second one removes what round-off has left in all.
        """
        mass, V = self.operators.mass, self.vectors
        moved = apply(mass, columns)
        square = self.comm.allreduce(np.einsum("ij,ij->j", columns, moved))
        keep = square > 0
        X, moved = (np.asfortranarray(a[:, keep] / np.sqrt(square[keep])) for a in (columns, moved))
        for turn in range(5):
            known = V if turn else V[:, recent:]
            X -= known @ inner(known, moved, self.comm)
            moved = apply(mass, X)
            gram = inner(X, moved, self.comm)
            away = np.max(np.abs(gram - np.eye(len(gram))), initial=0.0)
            size = np.sqrt(np.maximum(np.diag(gram), 0.0))
            keep = size > DEPENDENT
            gram, size = gram[np.ix_(keep, keep)], size[keep]
            values, directions = np.linalg.eigh(gram / np.outer(size, size))
            wanted = values > DEPENDENT_GRAM
            wanted[: max(0, len(wanted) - (self.operators.n - self.size))] = False  # a small model is used up: the rest is round-off
            turned = directions[:, wanted] / np.sqrt(values[wanted]) / size[:, None]
            X, moved = (np.asfortranarray(a[:, keep] @ turned) for a in (X, moved))
            if turn and away < NEARLY:
                break
        return X, moved

    def _clock(self, phase: str, begin: float) -> float:
        now = time.perf_counter()
        self.growth.seconds[phase] = self.growth.seconds.get(phase, 0.0) + now - begin
        return now

    def _shifted(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the projection of A = K + sigma M and (n_columns,) the size (b^T A^-1 b)^(1/2) of each column of B."""
        matrix = self._stiffness + self.settings.shift * self._mass + self._shift * self._damping
        return matrix, np.sqrt(np.einsum("ij,ij->j", self.generalised, solve_definite(matrix, self.generalised, "Krylov basis")))

    def _estimate(self, before: int) -> None:
        """Measure the basis of the first `before` vectors in the coordinates of the whole."""
        begin = time.perf_counter()
        shifted, size = self._shifted()
        outputs = np.sqrt(np.einsum("oj,jo->o", self._seen, solve_definite(shifted, self._seen.T, "Krylov basis")))
        scale = np.outer(np.where(outputs > 0, outputs, 1.0), size)
        rests, answers, change = [], [], 0.0
        for i, omega in enumerate(self.omega):
            dynamic = self._dynamic(omega)
            # The larger basis of one block is the smaller one of the next.
            known = self._answers[i] if self._answers else np.zeros((0, 0))
            smaller = known if len(known) == before else np.linalg.solve(dynamic[:before, :before], self.generalised[:before])
            answers.append(np.linalg.solve(dynamic, self.generalised))
            rests.append(_split(self.generalised - dynamic[:, :before] @ smaller))
            difference = self._seen @ answers[-1] - self._seen[:, :before] @ smaller
            change = max(change, float(np.max(np.abs(difference) / scale, initial=0.0)))
        self._answers = answers
        rest = np.hstack(rests)
        square = np.einsum("ij,ij->j", rest, solve_definite(shifted, rest, "Krylov basis"))
        residuals = np.max(np.sqrt(np.maximum(square.reshape(len(rests), 2, -1).sum(axis=1), 0.0)) / size, axis=1)
        self.growth.residual.append(float(np.max(residuals)))
        self._worst = float(self.omega[int(np.argmax(residuals))])
        self.growth.change.append(change)
        self._clock("estimate", begin)

    def _dynamic(self, omega: float) -> np.ndarray:
        return self._stiffness + 1j * omega * self._damping - omega**2 * self._mass

    def _promising(self) -> bool:
        """Whether the true residual is worth measuring: the estimates, carried on, meet the tolerance, or they have come to a stand.

        They stand still where what is left is the share of the stiff springs, which the last vectors bring in.
        """
        residual = self.growth.residual
        if len(residual) < 3 - (self.growth.order == 1):
            return bool(residual) and residual[-1] <= self.settings.tolerance
        if self.growth.order == 2:  # every second block gains more
            return residual[-1] * min(residual[-1] / residual[-3], 1.0) ** 0.5 <= self.settings.tolerance
        gain = residual[-1] / residual[-2]
        stands = gain > STANDSTILL and residual[-1] < 1e-2
        return stands or residual[-1] * min(gain, 1.0) <= self.settings.tolerance

    def _check(self) -> None:
        """Measure the true residual of the whole model: at the end of the band, and where the smaller basis did worst."""
        begin, before = time.perf_counter(), self.solver.solve_seconds
        _, size = self._shifted()
        omegas = sorted({self._worst, float(self.omega[-1])})
        angles = np.random.default_rng(0).random((len(omegas), len(size), COMBINATIONS))
        combinations = np.exp(2j * np.pi * angles) / size[:, None] / np.sqrt(COMBINATIONS)
        rests = []
        for omega, combined in zip(omegas, combinations, strict=True):
            motion = self.vectors @ _split(np.linalg.solve(self._dynamic(omega), self.generalised @ combined))
            rest = self.forces @ _split(combined) - apply(self.operators.stiffness, motion) + omega**2 * apply(self.operators.mass, motion)
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


def _split(values: np.ndarray) -> np.ndarray:
    """Return the real parts of all columns, and then the imaginary ones."""
    return np.hstack([values.real, values.imag])


def _starting_forces(operators: Operators, more: tuple[Any, ...]) -> np.ndarray:
    """Return the loads that are not zero, the unit release forces and `more` as columns (n_local, n_columns) N."""
    vectors = [load.vector for load in operators.loads] + list(more)
    columns = [np.real(vector.array_r)[:, None] for vector in vectors if vector.norm() > 0]
    return np.asfortranarray(np.hstack([np.zeros((operators.n_local, 0)), *columns, operators.contacts.push.toarray()]))


def _bordered(matrix: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return a symmetric (m, m) from its leading part and its last columns (m, b)."""
    m, b = columns.shape
    whole = np.empty((m, m))
    whole[: m - b, : m - b] = matrix
    whole[:, m - b :] = columns
    whole[m - b :, : m - b] = columns[: m - b].T
    corner = whole[m - b :, m - b :]
    whole[m - b :, m - b :] = (corner + corner.T) / 2
    return whole
