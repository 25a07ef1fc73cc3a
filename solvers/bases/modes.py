"""Undamped modes of a model, K x = lambda M x, each computed, checked and counted.

The modes next to a shift sigma come from a Krylov-Schur iteration (SLEPc) on (K - sigma M)^-1 M, which keeps the digits of the
low frequencies beside joints of 1e18 N/m. Most or all modes of a small model come from a one-sided Jacobi iteration (LAPACK's gejsv),
the one dense method whose error in each eigenvalue is relative to that eigenvalue: joints have 1e15 times the eigenvalue of the plate.
Either way the number of eigenvalues in the range is then counted independently: as many as L D L^T of K - sigma M gains negative
pivots from one end to the other (Sylvester's law of inertia), and no mode is missing if that is the number of modes found.

Sources: Parlett, The Symmetric Eigenvalue Problem, chapters 3 and 15; Grimes, Lewis and Simon, SIAM J. Matrix Anal. Appl. 15
(1994) 228; Demmel and Veselic, ibid. 13 (1992) 1204; Drmac and Veselic, ibid. 29 (2008) 1322 and 1343.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc
from slepc4py import SLEPc

from uplift.forms.operators import Operators
from uplift.meshes.checked import ModelError
from uplift.solvers.bases.basis import Basis, apply, inner
from uplift.solvers.bases.dense_modes import nearest_by_jacobi
from uplift.solvers.bases.pencil import diagonal_of, dofs_with_mass, unheld
from uplift.solvers.bases.sturm import SturmCount, count_below
from uplift.solvers.errors import SolverError

log = logging.getLogger(__name__)

MAX_DENSE_DOFS = 1200
"""Up to this many dofs (then 16 s) a request for more than half of the modes is answered by dense algebra."""

CLOSE = 1e-6
"""Eigenvalues with a smaller relative distance form one group; a count is only made between groups."""

NO_STRAIN = 1e-13
"""A mode with less than this part of the strain energy that its nodes would have one by one has none but round-off."""

RESIDUAL_LIMIT = 1e-6
"""Largest admissible scaled residual of a mode; its eigenvalue is then good to the square of it."""

ROUND_OFF = 8.0
"""Units of round-off, over the strain energy of a mode as a part of what its nodes would have one by one, that its residual may be.

In a thin plate the stiff shear cancels in K x and leaves its round-off; simply supported square plates of t/L = 0.1 to 1e-5 have 1.2
to 1.9 units, whatever the mesh. Their eigenvalues are good to one unit, 1e-5 in the worst case.
"""

ORTHONORMALITY_LIMIT = 1e-8
"""Largest admissible entry of |V^T M V - I|; sound modes stay below 1e-12."""


@dataclass(frozen=True)
class Modes:
    """Modes in the order of their eigenvalues, M-orthonormal, real; the largest component of each is positive.

    Among components that are equally large to 1e-6 the one with the lowest row number decides.
    """

    basis: Basis
    """The vectors (n_local, n_modes) in 1/sqrt(kg)."""
    eigenvalues: np.ndarray
    """(n_modes,) rad2/s2, 0 for rigid-body modes."""
    damping: np.ndarray
    """(n_modes,) ratios phi^T C phi / (2 omega) to critical damping, 0 for rigid-body modes."""
    residuals: np.ndarray
    """(n_modes,) |D (K x - lambda M x)| / (max(lambda, -shift) |D M x|), D = diag(K + lambda M)^-1/2."""
    orthonormality: float
    """Largest entry of |V^T M V - I|."""
    sturm: SturmCount
    """Count over a range that ends in a gap, beyond the last mode returned by at most the rest of a group of close ones."""
    shift: float
    """rad2/s2, the shift that was asked for."""

    @property
    def number(self) -> int:
        """Number of modes."""
        return len(self.eigenvalues)

    @property
    def rigid(self) -> int:
        """Number of rigid-body modes and mechanisms among them."""
        return int(np.sum(self.eigenvalues == 0))

    @property
    def omega(self) -> np.ndarray:
        """(n_modes,) rad/s."""
        return np.sqrt(self.eigenvalues)

    @property
    def frequencies(self) -> np.ndarray:
        """(n_modes,) Hz."""
        return self.omega / (2 * np.pi)


def modes(
    operators: Operators, *, number: int | None = None, band: tuple[float, float] | None = None,
    shift: float = 0.0, prefix: str = "modes_",
) -> Modes:
    """Return the `number` lowest modes, or all modes with frequencies in the `band` (low, high) in Hz (collective).

    `shift` <= 0 in rad2/s2 is where the search begins; 0 needs a structure that is held, a negative one also finds rigid-body modes
    (of frequency 0). Works with real and complex PETSc; counting with the complex one gathers the matrix on every rank.

    Raises `ModelError` for a number that the model does not have, an empty band or a positive shift, `SolverError` for a
    structure that can move without strain while the shift is 0, or if the modes found are not as many as were counted.
    """
    if (number is None) == (band is None):
        raise ModelError("modes", "expected either a number of modes or a band of frequencies")
    if not (np.isfinite(shift) and shift <= 0):
        raise ModelError("shift", f"expected <= 0 rad2/s2, got {shift!r}")
    if number is not None:
        wanted, sturm, values, vectors = _lowest(operators, number, shift, prefix)
    else:
        assert band is not None
        wanted, sturm, values, vectors = _in_band(operators, band, shift, prefix)
    values, vectors = _with_missing(operators, sturm, values, vectors, shift, prefix)
    vectors = _with_signs(_real_orthonormal(operators, values, vectors, shift), operators.comm)
    return _checked(operators, values[:wanted], vectors[:, :wanted], sturm, shift)


def effective_masses(found: Modes, inertia: Sequence[Any]) -> np.ndarray:
    """Return the effective masses (n_modes, n_directions) in kg, (phi^T M d)^2 for each inertia vector M d (collective).

    d is the rigid translation of the whole model by 1 m, so M d is a PETSc vector in kg; a ground motion's load vector is its
    negative. Over all modes they add up to d^T M d, the total mass. Source: Clough and Penzien, Dynamics of Structures, chapter 26.
    """
    rows = np.stack([np.real(vector.array_r) for vector in inertia], axis=1)
    return inner(found.basis.vectors, rows, found.basis.comm) ** 2


def _lowest(
    operators: Operators, number: int, shift: float, prefix: str
) -> tuple[int, SturmCount, np.ndarray, np.ndarray]:
    """Return `number`, the count up to the first gap beyond so many modes, and eigenvalues and vectors below that gap."""
    available = dofs_with_mass(operators)
    if not 1 <= number <= available:
        raise ModelError("number", f"expected >= 1 and <= {available}, the dofs that have mass, got {number}")
    below = count_below(operators, shift)
    if below:
        raise unheld(below)
    reach = number
    while True:
        reach = min(available, reach + max(4, reach // 8))
        values, vectors = _nearest(operators, shift, reach, prefix)
        beyond = np.flatnonzero(_apart(values, shift)[number - 1 :])
        if beyond.size:
            kept = number + int(beyond[0])
            upper = (values[kept - 1] + values[kept]) / 2
            break
        if reach == available:
            kept, upper = available, 2 * values[-1]
            break
    sturm = SturmCount(shift, float(upper), 0, count_below(operators, upper))
    return number, sturm, values[:kept], vectors[:, :kept]


def _in_band(
    operators: Operators, band: tuple[float, float], shift: float, prefix: str
) -> tuple[int, SturmCount, np.ndarray, np.ndarray]:
    """Return the number of modes in the band as counted, the count, and the modes found."""
    low, high = band
    if not 0 <= low < high < np.inf:
        raise ModelError("band", f"expected 0 <= low < high in Hz, got {low!r} to {high!r}")
    lower, upper = ((2 * np.pi * f) ** 2 for f in band)
    if low == 0:
        lower = shift
    below = count_below(operators, lower)
    if low == 0 and below:
        raise unheld(below)
    sturm = SturmCount(lower, upper, below, count_below(operators, upper))
    if sturm.inside == 0:
        near, _ = _nearest(operators, (lower + upper) / 2, min(2, dofs_with_mass(operators)), prefix)
        named = " and ".join(f"{f:.6g} Hz" for f in np.sqrt(np.maximum(near, 0)) / (2 * np.pi))
        raise ModelError("band", f"there is no mode between {low:g} and {high:g} Hz; the nearest are at {named}")
    values, vectors = _nearest(operators, _aim(sturm, shift), sturm.inside, prefix)
    inside = sturm.holds(values)
    return sturm.inside, sturm, values[inside], vectors[:, inside]


def _with_missing(
    operators: Operators, sturm: SturmCount, values: np.ndarray, vectors: np.ndarray, shift: float, prefix: str
) -> tuple[np.ndarray, np.ndarray]:
    """Search again, away from the modes found, for as many as the count says are missing; raise `SolverError` if some remain.

    A Krylov space holds one vector of each multiple eigenvalue, and owes the others to round-off. Beside a singular stiffness the count
    itself is round-off, so that rigid-body modes among those found are what is wrong.
    """
    for _ in range(3):
        missing = sturm.inside - len(values)
        if missing <= 0:
            break
        more, columns = _nearest(operators, _aim(sturm, shift), missing, prefix, away_from=vectors)
        inside = sturm.holds(more)
        order = np.argsort(np.concatenate([values, more[inside]]))
        values = np.concatenate([values, more[inside]])[order]
        vectors = np.hstack([vectors, columns[:, inside]])[:, order]
    if len(values) != sturm.inside:
        rigid = _strain(operators, vectors, apply(operators.stiffness, vectors)) < NO_STRAIN
        if rigid.any() and shift == 0:
            raise unheld(int(rigid.sum()))
        f_low, f_high = (np.sqrt(max(end, 0.0)) / (2 * np.pi) for end in (sturm.lower, sturm.upper))
        raise SolverError(
            f"{len(values)} modes were found between {f_low:g} and {f_high:g} Hz, and {sturm.inside} are there by Sturm count"
        )
    return values, vectors


def _aim(sturm: SturmCount, shift: float) -> float:
    """Return a point to which all modes of the range are closer than any other: its middle, or its lower end if none is below."""
    return shift if sturm.lower == shift else (sturm.lower + sturm.upper) / 2


def _checked(operators: Operators, values: np.ndarray, vectors: np.ndarray, sturm: SturmCount, shift: float) -> Modes:
    """Measure residuals, orthonormality and damping, tell rigid bodies from modes, and log the result."""
    comm = operators.comm
    stiff, mass = apply(operators.stiffness, vectors), apply(operators.mass, vectors)
    own_stiffness, own_mass = (diagonal_of(matrix)[:, None] for matrix in (operators.stiffness, operators.mass))

    def column_sums(array: np.ndarray) -> np.ndarray:
        return _column_sums(array, comm)

    strain = _strain(operators, vectors, stiff)
    rigid = strain < NO_STRAIN
    if rigid.any() and shift == 0:
        raise unheld(int(rigid.sum()))
    values = np.where(rigid, 0.0, values)
    weight = np.maximum(own_stiffness + values * own_mass, np.finfo(float).tiny)
    size = np.maximum(values, -shift) * np.sqrt(column_sums(mass**2 / weight))
    residuals = np.sqrt(column_sums((stiff - values * mass) ** 2 / weight)) / size
    limits = np.maximum(RESIDUAL_LIMIT, ROUND_OFF * np.finfo(float).eps / np.maximum(strain, NO_STRAIN))
    worst, mode = float(residuals.max()), int(np.argmax(residuals / limits))
    if not np.all(residuals <= limits):
        raise SolverError(
            f"mode {mode + 1} has a residual of {residuals[mode]:.1e} (limit {limits[mode]:.1e}): the range of frequencies "
            "is too wide for one shift; ask for the upper ones as a band"
        )
    orthonormality = float(np.max(np.abs(inner(vectors, mass, comm) - np.eye(len(values)))))
    if not orthonormality <= ORTHONORMALITY_LIMIT:
        raise SolverError(f"the modes are orthonormal to {orthonormality:.1e} only (limit {ORTHONORMALITY_LIMIT:g})")
    damping = np.zeros(len(values))
    if operators.damping is not None:
        projected = column_sums(vectors * apply(operators.damping, vectors))
        np.divide(projected, 2 * np.sqrt(values), out=damping, where=~rigid)
    found = Modes(Basis(vectors, comm), values, damping, residuals, orthonormality, sturm, shift)
    log.info(
        "%d modes from %.6g to %.6g Hz%s: Sturm count %d of %d below %.6g Hz, residuals up to %.1e, orthonormal to %.1e",
        found.number, found.frequencies[0], found.frequencies[-1], f", {found.rigid} of them rigid bodies" if found.rigid else "",
        sturm.inside, sturm.inside, np.sqrt(sturm.upper) / (2 * np.pi), worst, orthonormality,
    )
    return found


def _column_sums(array: np.ndarray, comm: Any) -> np.ndarray:
    return inner(np.ones((len(array), 1)), array, comm)[0]


def _strain(operators: Operators, vectors: np.ndarray, stiff: np.ndarray) -> np.ndarray:
    """Return the strain energy of each vector as a part of what its nodes would have one by one, (n_modes,); `stiff` is K `vectors`."""
    one_by_one = _column_sums(diagonal_of(operators.stiffness)[:, None] * np.abs(vectors) ** 2, operators.comm)
    return np.abs(_column_sums(vectors.conj() * stiff, operators.comm)) / np.real(one_by_one)


def _nearest(
    operators: Operators, shift: float, number: int, prefix: str, *, away_from: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the eigenvalues (number,), ascending, that are nearest to `shift` and their vectors (n_local, number) (collective).

    Vectors are M-orthonormal, and complex with complex PETSc. `away_from` (n_local, k) are vectors to stay M-orthogonal to.
    """
    if away_from is None and operators.n <= MAX_DENSE_DOFS and 2 * number > dofs_with_mass(operators):
        return nearest_by_jacobi(operators, shift, number)
    eps = SLEPc.EPS().create(operators.comm)
    eps.setOptionsPrefix(prefix)
    eps.setOperators(operators.stiffness, operators.mass)
    eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    eps.setType(SLEPc.EPS.Type.KRYLOVSCHUR)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    eps.setTarget(shift)
    eps.setDimensions(number)
    eps.setTolerances(1e-12, 500)
    transform = eps.getST()
    transform.setType(SLEPc.ST.Type.SINVERT)
    ksp = transform.getKSP()
    ksp.setType("preonly")
    ksp.getPC().setType("cholesky")
    ksp.getPC().setFactorSolverType("mumps")  # L D L^T with pivoting: K - shift M need not be definite
    avoided = [] if away_from is None else [_vector(operators, column) for column in away_from.T]
    if avoided:
        eps.setDeflationSpace(avoided)
    eps.setFromOptions()
    try:
        eps.solve()
    except PETSc.Error as error:
        raise SolverError(f"the stiffness shifted by {shift:g} rad2/s2 cannot be factorised: it is singular") from error
    found = min(number, eps.getConverged())
    if found < number:
        raise SolverError(f"{found} of {number} modes near {shift:g} rad2/s2 converged in {eps.getIterationNumber()} iterations")
    values = np.array([np.real(eps.getEigenvalue(i)) for i in range(found)])
    vectors = np.empty((operators.n_local, found), dtype=PETSc.ScalarType)
    x = operators.new_vector()
    for i in range(found):
        eps.getEigenvector(i, x)
        vectors[:, i] = x.array_r
    for thing in (x, eps, *avoided):
        thing.destroy()
    order = np.argsort(values)
    return values[order], vectors[:, order]


def _real_orthonormal(operators: Operators, values: np.ndarray, vectors: np.ndarray, shift: float) -> np.ndarray:
    """Return real vectors (n_local, n_modes) for the eigenvalues, M-orthonormal within each group of close ones.

    Complex arithmetic leaves a phase in each vector, and any unitary mixture in the vectors of a multiple eigenvalue.
    """
    comm = operators.comm
    groups = []
    for group in np.split(vectors, np.flatnonzero(_apart(values, shift)) + 1, axis=1):
        parts = np.hstack([group.real, group.imag]) if np.iscomplexobj(group) else group
        gram, mixture = np.linalg.eigh(inner(parts, apply(operators.mass, parts), comm))
        real = parts @ (mixture[:, -group.shape[1] :] / np.sqrt(gram[-group.shape[1] :]))
        _, mixture = np.linalg.eigh(inner(real, apply(operators.stiffness, real), comm))
        groups.append(real @ mixture)
    return np.hstack(groups)


def _apart(values: np.ndarray, shift: float) -> np.ndarray:
    """Return for each eigenvalue but the last whether the next one belongs to another group."""
    return np.diff(values) > CLOSE * np.maximum(np.abs(values[1:]), -shift)


def _with_signs(vectors: np.ndarray, comm: Any) -> np.ndarray:
    """Return the vectors with the largest component of each positive, as `Modes` says."""
    largest = np.max(np.abs(vectors), axis=0, initial=0.0)
    if comm.size > 1:
        largest = np.max(comm.allgather(largest), axis=0)
    # The first large component of each rank that has one; the lowest rank decides.
    large = np.abs(vectors) >= (1 - 1e-6) * largest
    signs = np.zeros(len(largest))
    if len(vectors):
        first = np.take_along_axis(vectors, large.argmax(axis=0)[None], axis=0)[0]
        signs = np.where(large.any(axis=0), np.sign(first), 0.0)
    for other in reversed(comm.allgather(signs)):
        signs = np.where(other != 0, other, signs)
    return vectors * signs


def _vector(operators: Operators, values: np.ndarray) -> Any:
    vector = operators.new_vector()
    vector.array[:] = values
    return vector
