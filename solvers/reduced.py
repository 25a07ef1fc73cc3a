"""A model projected on a basis of few vectors, and its time stepping in the coordinates of that basis.

With u = V q the model of `forms.operators` becomes V^T M V q'' + V^T C V q' + V^T K V q = V^T f, m equations instead of n.
A basis of modes alone gives the displacements well and the contact forces badly, because a point force excites modes far
beyond any band; the static answers to the loads and to unit contact forces make up for it (static correction: Wilson,
Yuan and Dickens, Earthquake Eng. Struct. Dyn. 10 (1982) 813; residual flexibility: Rubin, AIAA J. 13 (1975) 995).

Vectors are dense arrays of this rank's rows, (n_local, m); nothing here is of size n x n.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import linalg

from forms.operators import Operators, Reactions
from forms.uplift import UpliftLaw
from solvers.contact import ContactProblem, settled_release
from solvers.errors import SolverError
from solvers.history import History
from solvers.joints import FreeNodes
from solvers.linear import DirectSolver, dense_columns
from solvers.parameters import Scheme

log = logging.getLogger(__name__)

DEPENDENT = 1e-8
"""A vector of which less than this part is new, in the norm of the mass, adds no direction to a basis."""


TOGETHER = 8
"""Vectors that are multiplied at once: a matrix that is read once for some of them takes half the time, and copies stay small."""


def apply(matrix: Any, vectors: np.ndarray) -> np.ndarray:
    """Return this rank's rows (n_local, m) of a real matrix times real `vectors` (n_local, m) (collective)."""
    product = np.empty(vectors.shape, order="F")
    for first in range(0, vectors.shape[1], TOGETHER):
        some = slice(first, first + TOGETHER)
        given = dense_columns(matrix, vectors[:, some])
        found = matrix.matMult(given)
        product[:, some] = np.real(found.getDenseArray())
        given.destroy()
        found.destroy()
    return product


def inner(left: np.ndarray, right: np.ndarray, comm: Any) -> np.ndarray:
    """Return left^T right (m_left, m_right) of two arrays of local rows, summed over the ranks (collective)."""
    product = np.ascontiguousarray(left.T @ right)
    if comm.size > 1:
        comm.Allreduce(MPI.IN_PLACE, product, op=MPI.SUM)
    return product


@dataclass(frozen=True)
class Projected:
    """The matrices of a model between the vectors of a basis, (m, m) each and symmetric."""

    stiffness: np.ndarray
    mass: np.ndarray
    damping: np.ndarray
    """Zero where the model has no damping."""


@dataclass(frozen=True)
class Basis:
    """Linearly independent real vectors that span the displacements of a reduced model."""

    vectors: np.ndarray
    """(n_local, m): this rank's rows."""
    comm: Any
    projected: Projected | None = None
    """The matrices of the model that the basis was made for, where they are known already."""

    @property
    def size(self) -> int:
        """Number m of vectors."""
        return int(self.vectors.shape[1])


def with_static_answers(operators: Operators, basis: Basis, prefix: str = "correction_") -> Basis:
    """Return `basis` followed by the static answers K^-1 f to every load and every unit release force (collective).

    `basis` is M-orthonormal, as modes are; what is new in each answer is appended, M-orthonormal to all before it
    (Gram-Schmidt, twice), and an answer with nothing new is left out. Raises `SolverError` where nothing holds the structure.
    """
    push = operators.contacts.push.toarray()
    forces = [np.real(load.vector.array_r) for load in operators.loads] + list(push.T)
    vectors = basis.vectors
    right, answer = operators.new_vector(), operators.new_vector()
    with DirectSolver(operators.stiffness, prefix, definite=True, what="static correction") as solver:
        for force in forces:
            right.array[:] = force
            if right.norm() == 0:
                continue
            solver.solve(right, answer, check=True)
            column = np.real(answer.array_r)[:, None].copy()
            whole = _mass_norm(operators, column)
            for _ in range(2):
                column -= vectors @ inner(vectors, apply(operators.mass, column), operators.comm)
            rest = _mass_norm(operators, column)
            if rest > DEPENDENT * whole:
                vectors = np.hstack([vectors, column / rest])
    right.destroy()
    answer.destroy()
    added = vectors.shape[1] - basis.size
    log.info("static correction: %d of %d static answers added to %d vectors", added, len(forces), basis.size)
    return Basis(vectors, basis.comm)


def _mass_norm(operators: Operators, column: np.ndarray) -> float:
    return float(np.sqrt(inner(column, apply(operators.mass, column), operators.comm)[0, 0]))


@dataclass(frozen=True)
class ReducedModel:
    """The projection of a model on a basis: small dense arrays, the same on every rank."""

    basis: Basis
    stiffness: np.ndarray
    """(m, m) V^T K V."""
    mass: np.ndarray
    """(m, m) V^T M V, positive definite."""
    damping: np.ndarray
    """(m, m) V^T C V, zero where the model has no damping."""
    loads: np.ndarray
    """(m, n_loads): generalised forces of the loads."""
    histories: tuple[Callable[[np.ndarray], np.ndarray], ...]
    """Of each load: its values (nt,) at times (nt,) s."""
    static: tuple[bool, ...]
    """Of each load: whether it already acts before time 0."""
    push: np.ndarray
    """(m, n_channels): generalised forces of the unit release forces."""
    probes: np.ndarray
    """(n_probes, m): displacements of the probes of each vector."""
    elongation: np.ndarray
    """(n_channels, m): elongations of the contacts of each vector."""
    resultants: np.ndarray
    """(3, m): linear part of the reactions of each vector; no rows where the model knows no ground."""
    reactions: Reactions | None
    law: UpliftLaw
    largest: np.ndarray
    """(n_loads,): largest nodal load of each load vector in the model itself."""

    def load_scale(self, values: np.ndarray) -> float:
        """Return the largest nodal load in N that the load histories (nt, n_loads) ever make."""
        return float(np.max(np.max(np.abs(values), axis=0, initial=0.0) * self.largest, initial=0.0))

    def load_values(self, times: np.ndarray, *, static_only: bool = False) -> np.ndarray:
        """Return the load histories (nt, n_loads) at `times` (nt,) s; with `static_only` those of the static loads alone."""
        values = np.zeros((len(times), len(self.histories)))
        for j, (history, static) in enumerate(zip(self.histories, self.static, strict=True)):
            if static or not static_only:
                values[:, j] = history(times)
        return values

    def field(self, coordinates: np.ndarray) -> np.ndarray:
        """Return this rank's part (n_local,) of the solution with coordinates (m,)."""
        return self.basis.vectors @ coordinates


def projected_matrices(operators: Operators, vectors: np.ndarray) -> Projected:
    """Return the matrices of a model between `vectors` (n_local, m) (collective)."""

    def between(matrix: Any) -> np.ndarray:
        full = inner(vectors, apply(matrix, vectors), operators.comm)
        return (full + full.T) / 2

    mass = between(operators.mass)
    damping = np.zeros_like(mass) if operators.damping is None else between(operators.damping)
    return Projected(between(operators.stiffness), mass, damping)


def project(operators: Operators, basis: Basis, *, diagonal: bool = False) -> ReducedModel:
    """Project a model on a basis (collective).

    `diagonal` keeps only the diagonals of the projected stiffness, mass and damping, as modelisation B of SDLS119 does;
    with modes it drops the damping between modes, nothing else. Raises `SolverError` if the basis is not independent
    in the norm of the mass.
    """
    V, comm = basis.vectors, operators.comm
    known = basis.projected or projected_matrices(operators, V)

    def kept(full: np.ndarray) -> np.ndarray:
        return np.diag(np.diag(full)) if diagonal else full

    mass = kept(known.mass)
    size = np.sqrt(np.diag(mass))
    if not (np.all(size > 0) and np.linalg.eigvalsh(mass / np.outer(size, size))[0] > 1e-12):
        raise SolverError("the vectors of the basis are linearly dependent, or one of them moves no mass")
    reactions = operators.reactions
    observed = [operators.probes, operators.contacts.elongation] + ([reactions.functionals] if reactions else [])
    probes, elongation, *resultants = (functionals.total(functionals.partial(V)) for functionals in observed)
    return ReducedModel(
        basis=basis,
        stiffness=kept(known.stiffness),
        mass=mass,
        damping=kept(known.damping),
        loads=inner(V, np.stack([np.real(load.vector.array_r) for load in operators.loads], axis=1), comm)
        if operators.loads
        else np.zeros((basis.size, 0)),
        histories=tuple(load.history for load in operators.loads),
        static=tuple(load.static for load in operators.loads),
        push=inner(V, operators.contacts.push.toarray(), comm),
        probes=probes,
        elongation=elongation,
        resultants=resultants[0] if resultants else np.zeros((0, basis.size)),
        reactions=reactions,
        law=operators.contacts.law,
        largest=np.array([load.vector.norm(PETSc.NormType.NORM_INFINITY) for load in operators.loads]),
    )


@dataclass(frozen=True)
class ReducedState:
    """Coordinates (m,) of displacement and velocity, and release forces (n_channels,) N, at one instant."""

    displacement: np.ndarray
    velocity: np.ndarray
    release: np.ndarray


def at_rest(model: ReducedModel) -> ReducedState:
    """Return the state of zero displacement, velocity and release forces."""
    return ReducedState(np.zeros(model.basis.size), np.zeros(model.basis.size), np.zeros(model.law.n_channels))


def static_state(model: ReducedModel, *, exact_uplift: bool = False) -> ReducedState:
    """Return the static answer of the reduced model to its static loads, contacts bonded or lifted where they pull.

    Raises `SolverError` if it has none.
    """
    force = model.loads @ model.load_values(np.zeros(1), static_only=True)[0]
    answers = solve_definite(model.stiffness, np.column_stack([force, model.push]), "reduced static state")
    release = np.zeros(model.law.n_channels)
    if exact_uplift and release.size:
        problem = ContactProblem(model.law, model.law.stiffness[:, None] * (model.elongation @ answers[:, 1:]))
        scale = model.load_scale(model.load_values(np.zeros(1), static_only=True))
        release = settled_release(problem, model.law.tension(model.elongation @ answers[:, 0]), scale)
    return ReducedState(answers[:, 0] + answers[:, 1:] @ release, np.zeros(model.basis.size), release)


def settled_state(
    model: ReducedModel, scheme: Scheme, step: float, steps: int, *, exact_uplift: bool = False
) -> ReducedState:
    """Return the state after `steps` undamped steps of `step` s under the static loads from rest, ending at time 0.

    Steps that are short beside the periods leave the model on its way down: so starts modelisation B of SDLS119
    (10 steps of 0.001 s with beta = 1, gamma = 1.5). The acceleration at the start follows from the equation of motion.
    """
    stepper = _Stepper(model, scheme, step, damped=False, exact_uplift=exact_uplift)
    values = np.repeat(model.load_values(np.zeros(1), static_only=True), steps + 1, axis=0)
    motion, release, _ = stepper.march(at_rest(model), values, every=steps)
    return ReducedState(motion[-1, 0], motion[-1, 1] / step, release[-1])


@dataclass(frozen=True)
class ReducedMarch:
    """Coordinates of a march at the archived instants."""

    times: np.ndarray
    """(n_archived,) s."""
    coordinates: np.ndarray
    """(n_archived, m)."""
    velocities: np.ndarray
    """(n_archived, m) 1/s."""
    release: np.ndarray
    """(n_archived, n_channels) N, the release forces that acted."""
    accelerations: np.ndarray
    """(n_archived, m) 1/s2."""
    standing: np.ndarray
    """(n_archived, n_channels) N: what stands against the support springs, the release forces unless nodes have masses that count."""
    gap: np.ndarray | None
    """(n_archived, n_c) m, as in `History`."""

    def history(self, model: ReducedModel) -> History:
        """Return the displacements of the probes and contacts, and this rank's part of the field where a probe is farthest."""
        probes = self.coordinates @ model.probes.T
        peak = int(np.argmax(np.max(np.abs(probes), axis=1, initial=0.0)))
        reactions = self.coordinates @ model.resultants.T
        if model.reactions is not None:
            reactions = model.reactions.values(reactions, self.standing)
        elongation = self.coordinates @ model.elongation.T
        felt = self.accelerations @ model.probes.T
        field = model.field(self.coordinates[peak])
        return History(self.times, probes, elongation, self.release, reactions, peak, field, accelerations=felt, gap=self.gap)


def march(
    model: ReducedModel,
    scheme: Scheme,
    step: float,
    steps: int,
    *,
    every: int = 1,
    start: ReducedState,
    release: np.ndarray | None = None,
    exact_uplift: bool = False,
) -> ReducedMarch:
    """March `steps` steps of `step` s from time 0; archive every `every`-th step.

    The scheme, the start and the meaning of `release` (n_archived, n_channels) N are those of `solvers.newmark.transient`:
    the acceleration at time 0 follows from the equation of motion, and given release forces are interpolated linearly between
    the archived instants. Without them contacts stay bonded, or with `exact_uplift` the law of uplift holds at every step.
    """
    times = step * np.arange(steps + 1)
    stepper = _Stepper(model, scheme, step, exact_uplift=exact_uplift and release is None)
    given = None
    if release is not None:
        given = np.stack([np.interp(times, times[::every], column) for column in release.T], axis=1)
    motion, acted, nodes = stepper.march(start, model.load_values(times), every, given)
    standing, gap = (acted, None) if nodes is None else (stepper.nodes.on_ground(acted, nodes), stepper.nodes.gap(nodes))
    return ReducedMarch(times[::every], motion[:, 0], motion[:, 1] / step, acted, motion[:, 2] / step**2, standing, gap)


class _Stepper:
    """The scheme of `solvers.newmark` with one product a step: a1 = R [u_alpha*, v_alpha*, d_alpha], d the loads and contact forces.

    R comes from one Cholesky factorisation of the effective matrix; a step is one product of a dense m x (2 m + n_d) matrix
    and a few sums of vectors: 5,000 steps take 0.04 s with 20 vectors and 0.25 s with 100. Velocities are times dt and
    accelerations times dt^2, so that all parts keep one size, whatever the frequency of a vector.
    """

    def __init__(
        self, model: ReducedModel, scheme: Scheme, step: float, *, damped: bool = True, exact_uplift: bool = False
    ) -> None:
        """`step` in s; `damped=False` leaves the damping out; `exact_uplift` finds the release forces at every step."""
        self.model = model
        self.scheme = scheme
        self.step = step
        damping = step * model.damping if damped else np.zeros_like(model.damping)
        stiffness = step**2 * model.stiffness
        self.balance = np.hstack([-stiffness, -damping, step**2 * model.loads, step**2 * model.push])
        keep = 1 - scheme.alpha_f
        effective = (1 - scheme.alpha_m) * model.mass + keep * (scheme.gamma * damping + scheme.beta * stiffness)
        self.answer = solve_definite(effective, self.balance, "reduced time step")
        self.inertia = solve_definite(effective, -scheme.alpha_m * model.mass, "reduced time step")
        self.problem: ContactProblem | None = None
        if exact_uplift and model.law.n_channels:
            # A release force r1 acts as (1 - alpha_f) r1 at the instant of balance and moves the contacts by beta a1.
            self.per_release = keep * self.answer[:, -model.law.n_channels :]
            compliance = model.law.stiffness[:, None] * (model.elongation @ self.per_release) * scheme.beta
            self.problem = ContactProblem(model.law, compliance)
            self.nodes = FreeNodes(model.law, step)

    def march(
        self, start: ReducedState, values: np.ndarray, every: int, given: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Return (q, dt q', dt^2 q'') (n_archived, 3, m), the release forces (n_archived, n_channels) N and the nodes' motion from `start`.

        `values` (steps + 1, n_loads) are the load histories, `given` (steps + 1, n_channels) N release forces that are known.
        """
        model, scheme, m, n_loads = self.model, self.scheme, self.model.basis.size, values.shape[1]
        first = start.release if given is None else given[0]
        whole = np.concatenate([start.displacement, self.step * start.velocity, values[0], first])
        motion, loads, release = whole[: 2 * m].reshape(2, m), whole[2 * m : 2 * m + n_loads], whole[2 * m + n_loads :]
        acceleration = solve_definite(model.mass, self.balance @ whole, "reduced initial acceleration")
        new = np.array([[scheme.beta], [scheme.gamma]])
        old = np.array([[0.5], [1.0]]) - new
        archived = (len(values) - 1) // every + 1
        archive, acted = np.empty((archived, 3, m)), np.empty((archived, len(release)))
        archive[0, :2], archive[0, 2], acted[0] = motion, acceleration, release
        scale = model.load_scale(values)
        heavy = self.problem is not None and self.nodes.any
        moving = self.nodes.still(release) if heavy else None
        motions = np.repeat(moving[:, None], archived, axis=1) if moving is not None else None
        for n in range(1, len(values)):
            before = whole.copy() if scheme.alpha_f else whole
            held = release.copy()
            motion[0] += motion[1]
            motion += old * acceleration
            loads[:] = values[n]
            release[:] = 0.0 if given is None else given[n]
            known = (1 - scheme.alpha_f) * whole + scheme.alpha_f * before if scheme.alpha_f else whole
            carried = self.inertia @ acceleration if scheme.alpha_m else 0.0
            acceleration = self.answer @ known + carried
            if self.problem is not None:
                elongation = model.elongation @ (motion[0] + scheme.beta * acceleration)
                tension = model.law.tension(elongation)
                if moving is None:
                    release[:] = self.problem.solve(tension, held, scale)
                else:
                    release[:], moving = self.nodes.solve(self.problem, tension, held, moving, scale)
                acceleration += self.per_release @ release
            motion += new * acceleration
            if n % every == 0:
                archive[n // every, :2], archive[n // every, 2], acted[n // every] = motion, acceleration, release
                if motions is not None and moving is not None:
                    motions[:, n // every] = moving
        return archive, acted, motions


def solve_definite(matrix: np.ndarray, right: np.ndarray, what: str) -> np.ndarray:
    """Solve a small symmetric positive definite system, scaled to a unit diagonal. Raises `SolverError` if it is not one."""
    scale = np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    try:
        factor = linalg.cho_factor(matrix / np.outer(scale, scale), lower=True)
    except linalg.LinAlgError as error:
        raise SolverError(f"the matrix of the {what} is not positive definite: nothing holds the structure") from error
    return (linalg.cho_solve(factor, (right.T / scale).T).T / scale).T
