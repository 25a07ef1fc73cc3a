"""One basis for every frequency, load history and state of the contacts: the block Krylov space of a single factorisation.

With a real shift sigma and B = [loads, unit release forces, ...] the answers (K + s C + s^2 M)^-1 B, at all s of a band, lie almost in

    span { A^-1 B, (A^-1 M) A^-1 B, (A^-1 M)^2 A^-1 B, ... },   A = K + sigma M,

of which some ten blocks do. Static answers are in it (for sigma = 0 exactly), so contact forces come out as well as displacements, and
Newmark, Fourier, Laplace and modal runs can all live in it. Rayleigh damping C = a K + b M leaves the space as it is. Damping that spares
the springs, as here, acts as a K + b M and a force on each spring beside it, so these forces belong to B where they matter.

The basis is M-orthonormal and grows block by block until an error estimate at test frequencies, where nothing was solved to build it,
meets a tolerance. Two numbers are looked at. While it grows, everything is known of the smaller basis in the coordinates of the larger:
the residual of the smaller one lies, but for the springs' share, in the span of A times the larger, so that its dual norm
(r^T A^-1 r)^(1/2) is a matter of small matrices, and so is the change of the transfer functions. At the end the true residual of the whole
model is measured, for one random combination of all columns at each test frequency, which is as large in the mean square as all
columns together.

Sources: Bai and Su, SIAM J. Sci. Comput. 26 (2005) 1692 (Krylov projection of second-order systems); Freund, Acta Numerica 12 (2003) 267
(block Krylov, deflation); Stathopoulos and Wu, SIAM J. Sci. Comput. 23 (2002) 2165 (orthonormalising a block by the eigenvectors of its Gram
matrix); Smetana, Zahm and Patera, SIAM J. Sci. Comput. 41 (2019) A900 (residuals of random combinations).
"""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.csgraph import connected_components

from forms.operators import Operators
from solvers.errors import SolverError
from solvers.linear import DirectSolver
from solvers.parameters import KrylovSettings
from solvers.reduced import Basis, Projected, apply, inner

log = logging.getLogger(__name__)

DEPENDENT = 1e-10
"""A column of which less than this part is new, in the norm of the mass, adds no direction."""

DEPENDENT_GRAM = 1e-14
"""Directions of a block below this eigenvalue of its scaled Gram matrix are round-off."""


@dataclass
class Growth:
    """How a basis came about."""

    columns: int = 0
    """Columns of the starting block."""
    sizes: list[int] = field(default_factory=list)
    """Vectors after each block."""
    residual: list[float] = field(default_factory=list)
    """Largest relative dual norm of the residual over test frequencies and columns, of the basis without its last block."""
    change: list[float] = field(default_factory=list)
    """Largest relative change of a transfer function by the last block."""
    checked: list[tuple[float, float]] = field(default_factory=list)
    """(Hz, relative dual norm of the true residual of the finished basis, all columns together) at each test frequency."""
    solves: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    """Wall seconds: factorisation, solves, orthonormalisation, projection, estimate."""

    @property
    def estimate(self) -> float:
        """The stated error: largest relative dual norm of the true residual over the test frequencies."""
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
    """The vectors so far, their products with the mass, and the model between them."""

    def __init__(self, operators: Operators, settings: KrylovSettings, solver: DirectSolver, growth: Growth) -> None:
        self.operators, self.settings, self.solver, self.growth = operators, settings, solver, growth
        self.comm = operators.comm
        self.size = 0
        self._vectors = np.empty((operators.n_local, 0), order="F")
        self._mass_times = np.empty((operators.n_local, 0), order="F")
        self._stiffness, self._damping, self._mass = (np.zeros((0, 0)) for _ in range(3))
        observed = [operators.probes, operators.contacts.elongation]
        self._looks = sparse.vstack([functionals.local for functionals in observed], format="csr")
        self._seen = np.zeros((self._looks.shape[0], 0))
        self.omega = 2 * np.pi * settings.test_frequencies

    @property
    def vectors(self) -> np.ndarray:
        return self._vectors[:, : self.size]

    @property
    def mass_times(self) -> np.ndarray:
        return self._mass_times[:, : self.size]

    def run(self, more: tuple[Any, ...]) -> KrylovBasis:
        growth, settings = self.growth, self.settings
        forces = _starting_forces(self.operators, more)
        if forces.shape[1] == 0:
            raise SolverError("the Krylov basis has nothing to start from: the model has neither loads nor contacts")
        answers = self._solve(forces)
        springs, stiff = self._spring_forces(forces, answers)
        self.forces = np.hstack([forces, springs])
        growth.columns = self.forces.shape[1]
        self.generalised = np.zeros((0, growth.columns))
        if springs.shape[1]:
            answers = np.hstack([answers, self._solve(springs)])
        stiff_answers = self._solve(stiff) if stiff.shape[1] else stiff
        met = False
        while not met:
            before = self.size
            self._add(answers)
            new = slice(before, self.size)
            growth.sizes.append(self.size)
            exhausted = self.size == before
            if len(growth.sizes) > 1 and not exhausted:
                self._estimate(before)
            if exhausted or self._promising():
                grown = self.size
                self._add(stiff_answers)
                self._check()
                met = growth.estimate <= settings.tolerance
                if not met:
                    self._shrink(grown)  # the next block must follow from this one alone
            if not met:
                if exhausted or len(growth.sizes) == settings.blocks:
                    raise SolverError(self._failure(exhausted))
                answers = self._solve(self._mass_times[:, new])
        growth.seconds = {"factorisation": self.solver.factor_seconds, "solves": self.solver.solve_seconds} | growth.seconds
        log.info(
            "Krylov basis: %d vectors from %d columns in %d blocks, residual %.1e of the loads at %d test frequencies to %g Hz",
            self.size, growth.columns, len(growth.sizes), growth.estimate, len(self.omega), settings.test_frequencies[-1],
        )
        return KrylovBasis(self.vectors, self.comm, Projected(self._stiffness, self._mass, self._damping), growth)

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

    def _spring_forces(self, forces: np.ndarray, answers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the forces (n_local, ...) of the springs that damping spares: those to begin with, those whose static answers do.

        Beside a structure of compliance c a spring k adds min(k c, 1 / (k c)) of the response, and the root of it in the norm of the
        energy. Where only the root counts, the static answer leaves of it what the square does.
        """
        nothing = np.zeros((self.operators.n_local, 0))
        if self.operators.damping is None:
            return nothing, nothing
        total = self.comm.allreduce(np.abs(forces).sum(axis=0))
        reach = np.max(self.comm.allgather(np.abs(answers).max(axis=0, initial=0.0)), axis=0)
        rows, stiffness = spring_forces(self.operators)
        ratio = stiffness * float(np.max(reach / total))
        weight = np.minimum(ratio, 1 / ratio)
        begins = weight > self.settings.tolerance
        counts = ~begins & (weight > self.settings.tolerance**2)
        return self._unit_forces(rows[begins]), self._unit_forces(rows[counts])

    def _unit_forces(self, rows: np.ndarray) -> np.ndarray:
        """Return unit forces (n_local, n_columns) on the `rows` of each rank, one rank after the other."""
        numbers = self.comm.allgather(len(rows))
        columns = np.zeros((self.operators.n_local, sum(numbers)))
        columns[rows, sum(numbers[: self.comm.rank]) + np.arange(len(rows))] = 1.0
        return columns

    def _add(self, columns: np.ndarray) -> None:
        """Append what is new in `columns` (n_local, b), M-orthonormal, and project the model on it."""
        begin = time.perf_counter()
        new, product = self._orthonormal(columns)
        b, m = new.shape[1], self.size
        if m + b > self._vectors.shape[1]:
            self._grow(max(m + b, 2 * self._vectors.shape[1], 8 * b))
        self._vectors[:, m : m + b] = new
        self._mass_times[:, m : m + b] = product
        self.size = m + b
        begin = self._clock("orthonormalisation", begin)
        V = self.vectors
        self._mass = _bordered(self._mass, inner(V, product, self.comm))
        self._stiffness = _bordered(self._stiffness, inner(V, apply(self.operators.stiffness, new), self.comm))
        damping = self.operators.damping
        damped = np.zeros((self.size, b)) if damping is None else inner(V, apply(damping, new), self.comm)
        self._damping = _bordered(self._damping, damped)
        self.generalised = np.vstack([self.generalised, inner(new, self.forces, self.comm)])
        self._seen = np.hstack([self._seen, self.operators.probes.total(self._looks @ new)])
        self._clock("projection", begin)

    def _shrink(self, size: int) -> None:
        """Keep the first `size` vectors."""
        self.size = size
        self._stiffness, self._damping, self._mass = (a[:size, :size] for a in (self._stiffness, self._damping, self._mass))
        self.generalised, self._seen = self.generalised[:size], self._seen[:, :size]

    def _grow(self, capacity: int) -> None:
        for name in ("_vectors", "_mass_times"):
            larger = np.empty((self.operators.n_local, capacity), order="F")
            larger[:, : self.size] = getattr(self, name)[:, : self.size]
            setattr(self, name, larger)

    def _orthonormal(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the new directions of `columns` and their products with the mass: block Gram-Schmidt, twice and until it holds."""
        mass, comm = self.operators.mass, self.comm
        X = columns
        product = apply(mass, X)
        square = comm.allreduce(np.einsum("ij,ij->j", X, product))
        keep = square > 0
        X = X[:, keep] / np.sqrt(square[keep])
        for turn in range(4):
            share = inner(self.mass_times, X, comm)
            X = X - self.vectors @ share
            product = apply(mass, X)
            gram = inner(X, product, comm)
            size = np.sqrt(np.maximum(np.diag(gram), 0.0))
            if turn and np.max(np.abs(gram - np.eye(len(gram))), initial=0.0) < 1e-12:
                break
            keep = size > DEPENDENT
            gram, size = gram[np.ix_(keep, keep)], size[keep]
            values, directions = np.linalg.eigh(gram / np.outer(size, size))
            wanted = values > DEPENDENT_GRAM
            turned = directions[:, wanted] / np.sqrt(values[wanted]) / size[:, None]
            X, product = X[:, keep] @ turned, product[:, keep] @ turned
        return X, product

    def _clock(self, phase: str, begin: float) -> float:
        now = time.perf_counter()
        self.growth.seconds[phase] = self.growth.seconds.get(phase, 0.0) + now - begin
        return now

    def _shifted(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the projection of A = K + sigma M and (n_columns,) the size (b^T A^-1 b)^(1/2) of each column of B."""
        matrix = self._stiffness + self.settings.shift * self._mass
        return matrix, np.sqrt(np.einsum("ij,ij->j", self.generalised, linalg.solve(matrix, self.generalised, assume_a="pos")))

    def _estimate(self, before: int) -> None:
        """Measure the basis of the first `before` vectors in the coordinates of the whole."""
        begin = time.perf_counter()
        shifted, size = self._shifted()
        outputs = np.sqrt(np.einsum("oj,jo->o", self._seen, linalg.solve(shifted, self._seen.T, assume_a="pos")))
        scale = np.outer(np.where(outputs > 0, outputs, 1.0), size)
        residual = change = 0.0
        for omega in self.omega:
            dynamic = self._dynamic(omega)
            smaller = np.linalg.solve(dynamic[:before, :before], self.generalised[:before])
            larger = np.linalg.solve(dynamic, self.generalised)
            rest = self.generalised - dynamic[:, :before] @ smaller
            square = np.real(np.einsum("ij,ij->j", rest.conj(), np.linalg.solve(shifted, rest)))
            residual = max(residual, float(np.max(np.sqrt(np.maximum(square, 0.0)) / size)))
            difference = self._seen @ larger - self._seen[:, :before] @ smaller
            change = max(change, float(np.max(np.abs(difference) / scale, initial=0.0)))
        self.growth.residual.append(residual)
        self.growth.change.append(change)
        self._clock("estimate", begin)

    def _dynamic(self, omega: float) -> np.ndarray:
        return self._stiffness + 1j * omega * self._damping - omega**2 * self._mass

    def _promising(self) -> bool:
        """Whether the estimates of the last two blocks, carried on, meet the tolerance with the present basis."""
        residual = self.growth.residual
        if len(residual) < 2:
            return bool(residual) and residual[-1] <= self.settings.tolerance
        return residual[-1] * min(residual[-1] / residual[-2], 1.0) <= self.settings.tolerance

    def _check(self) -> None:
        """Measure the true residual of the whole model at the test frequencies, for one random combination of all columns."""
        begin, before = time.perf_counter(), self.solver.solve_seconds
        _, size = self._shifted()
        phases = np.exp(2j * np.pi * np.random.default_rng(len(self.omega)).random((len(size), len(self.omega)))) / size[:, None]
        checks = range(len(self.omega) - 1, -1, -max(1, len(self.omega) // self.settings.checks))
        checks = list(checks)[: self.settings.checks]
        rests = []
        for k in checks:
            omega, combined = self.omega[k], phases[:, k]
            motion = self.vectors @ np.linalg.solve(self._dynamic(omega), self.generalised @ combined)
            parts = np.column_stack([motion.real, motion.imag])
            force = self.forces @ np.column_stack([combined.real, combined.imag])
            rest = force - apply(self.operators.stiffness, parts) + omega**2 * apply(self.operators.mass, parts)
            if self.operators.damping is not None:
                damped = omega * apply(self.operators.damping, parts)
                rest += np.column_stack([damped[:, 1], -damped[:, 0]])
            rests.append(rest)
        rest = np.hstack(rests)
        answers = self._solve(rest)
        square = self.comm.allreduce(np.einsum("ij,ij->j", rest, answers)).reshape(-1, 2).sum(axis=1)
        found = np.sqrt(np.maximum(square, 0.0))
        self.growth.checked = sorted((float(self.omega[k] / (2 * np.pi)), float(value)) for k, value in zip(checks, found, strict=True))
        self._clock("estimate", begin + self.solver.solve_seconds - before)


def _starting_forces(operators: Operators, more: tuple[Any, ...]) -> np.ndarray:
    """Return the loads that are not zero, the unit release forces and `more` as columns (n_local, n_columns) N."""
    vectors = [load.vector for load in operators.loads] + list(more)
    columns = [np.real(vector.array_r)[:, None] for vector in vectors if vector.norm() > 0]
    return np.asfortranarray(np.hstack([np.zeros((operators.n_local, 0)), *columns, operators.contacts.push.toarray()]))


def spring_forces(operators: Operators) -> tuple[np.ndarray, np.ndarray]:
    """Return this rank's rows (n_springs,) on which bonded springs pull the structure, and their stiffnesses (n_springs,) N/m.

    Dofs that only springs hold, as those inside a joint, are condensed: with little mass of their own they pass the force on.
    """
    springs = operators.bonded_springs
    rows = np.flatnonzero(springs.diagonal())
    start = operators.stiffness.getOwnershipRange()[0]
    _, group = connected_components(springs, directed=False)
    pulled, stiffness = [], []
    for members in [rows[group[rows] == g] for g in np.unique(group[rows])]:
        inside = np.array([_alone(operators.stiffness, start, row, members) for row in members])
        outer = members[~inside]
        block = springs[np.ix_(outer, outer)].toarray()
        if inside.any():
            coupling = springs[np.ix_(outer, members[inside])].toarray()
            block -= coupling @ np.linalg.solve(springs[np.ix_(members[inside], members[inside])].toarray(), coupling.T)
        pulled += list(outer)
        stiffness += list(np.diag(block))
    return np.array(pulled, dtype=int), np.array(stiffness)


def _alone(stiffness: Any, start: int, row: int, members: np.ndarray) -> bool:
    """Return whether the row of the stiffness (`row` within this rank) holds nothing outside the columns `members`."""
    columns, values = stiffness.getRow(start + row)
    return bool(np.isin(columns[values != 0] - start, members).all())


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
