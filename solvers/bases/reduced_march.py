"""A model projected on a basis of few vectors, and its time stepping in the coordinates of that basis.

With u = V q the model of `uplift.forms.operators` becomes V^T M V q'' + V^T C V q' + V^T K V q = V^T f, m equations instead of n.
A basis of modes alone gives the displacements well and the contact forces badly, because a point force excites modes far
beyond any band; the static answers to the loads and to unit contact forces make up for it (static correction: Wilson,
Yuan and Dickens, Earthquake Eng. Struct. Dyn. 10 (1982) 813; residual flexibility: Rubin, AIAA J. 13 (1975) 995).

Vectors are dense arrays of this rank's rows, (n_local, m); nothing here is of size n x n.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from uplift.solvers.bases.project import ReducedModel
from uplift.solvers.contact.auxiliary_nodes import FreeNodes
from uplift.solvers.contact.step import ContactProblem, settled_release
from uplift.solvers.errors import SolverError
from uplift.solvers.history import History
from uplift.solvers.time_domain.scheme import Scheme


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

    The scheme, the start and the meaning of `release` (n_archived, n_channels) N are those of `uplift.solvers.time_domain.march.transient`:
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
    """The scheme of `time_domain.newmark` with one product a step: a1 = R [u_alpha*, v_alpha*, d_alpha], d the loads and contact forces.

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
