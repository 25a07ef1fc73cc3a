"""Implicit time integration in acceleration form, with uplift exact at every step and one factorisation in all.

u1 = u0 + dt v0 + dt^2 ((1/2 - beta) a0 + beta a1),  v1 = v0 + dt ((1 - gamma) a0 + gamma a1), and with * for the known parts of u1, v1,

    A a1 = f_alpha - alpha_m M a0 - C v_alpha* - K u_alpha*,    A = (1 - alpha_m) M + (1 - alpha_f) (gamma dt C + beta dt^2 K),

x_alpha = (1 - alpha_f) x1 + alpha_f x0. Newmark's method is alpha_m = alpha_f = 0. Second order for gamma = 1/2 - alpha_m + alpha_f, else
first; unconditionally stable for the parameters that `Scheme` admits. Solving for the acceleration keeps its digits when dt
is small, where the difference of two displacements over dt^2 would not.

The contacts stay bonded in K. What an open one must not carry is taken away by release forces on the right-hand side, which
follow exactly from the compliance of the contacts in one step: one extra solve for each contact before the first step, and then
one solve a step, as in a linear run.

Sources: N. M. Newmark, J. Eng. Mech. Div. ASCE 85 (1959) 67; Hughes, The Finite Element Method, chapter 9; Chung and Hulbert,
J. Appl. Mech. 60 (1993) 371.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from forms.operators import Operators
from solvers.contact import ContactProblem, settled_release
from solvers.energy import EnergyMeter
from solvers.history import History
from solvers.joints import FreeNodes
from solvers.linear import SMALL, LinearSolver, definite_solver
from solvers.parameters import Scheme
from solvers.record import KeptMarch, Observer, Record
from solvers.watch import Loop, Watch

BALANCED = 1e-9
"""A force that is left of the loads by less than this part of them is round-off: the state is one of rest."""

FEW = 16
"""Up to so many contacts it is quicker to take them all than to pick the open ones."""

SAME = PETSc.Mat.Structure.SAME_NONZERO_PATTERN


@dataclass
class State:
    """Displacement, velocity and acceleration (PETSc vectors) and release forces at one instant; `with` destroys it."""

    displacement: Any
    velocity: Any
    acceleration: Any
    release: np.ndarray
    """(n_channels,) N."""
    nodes: np.ndarray | None = None
    """(4, n_c): the motion of auxiliary nodes with mass, see `solvers.joints`; None: at rest, or without mass."""

    def copy(self) -> State:
        """Return an independent copy."""
        vectors = self.displacement.copy(), self.velocity.copy(), self.acceleration.copy()
        return State(*vectors, self.release.copy(), None if self.nodes is None else self.nodes.copy())

    def __enter__(self) -> State:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Destroy the vectors."""
        for vector in (self.displacement, self.velocity, self.acceleration):
            vector.destroy()


def at_rest(operators: Operators) -> State:
    """Return the state of zero displacement, velocity, acceleration and release forces."""
    return State(
        operators.new_vector(), operators.new_vector(), operators.new_vector(), np.zeros(operators.contacts.law.n_channels)
    )


def add_push(operators: Operators, release: np.ndarray, vector: Any) -> None:
    """Add release forces (n_channels,) N to a load vector."""
    if release.any():
        vector.array[:] += operators.contacts.push @ release


def tensions(operators: Operators, displacement: Any) -> np.ndarray:
    """Return the tensions (n_channels,) N of the bonded contacts under a displacement vector (collective)."""
    elongation = operators.contacts.elongation
    return operators.contacts.law.tension(elongation.total(elongation.partial(np.real(displacement.array_r))))


class ContactCompliance:
    """Answers of one factorised matrix to unit release forces, and the contact problem they make."""

    def __init__(self, operators: Operators, solver: LinearSolver, factor: float) -> None:
        """Solve once for each channel (collective); `factor` turns a solution into the displacement it stands for."""
        contacts = operators.contacts
        n = contacts.law.n_channels
        self.answers = np.zeros((n, operators.n_local))
        """(n_channels, n_local): solutions for unit release forces, this rank's rows."""
        pull = sparse.diags(contacts.law.stiffness) @ contacts.elongation.local
        self.pull = pull.toarray() if operators.n_local <= SMALL else pull.tocsr()
        """(n_channels, n_local) N/m: this rank's share of the tensions of the bonded contacts."""
        right, solution = operators.new_vector(), operators.new_vector()
        for j in range(n):
            right.array[:] = contacts.push[:, [j]].toarray().ravel()
            solver.solve(right, solution, check=True)
            self.answers[j] = np.real(solution.array_r)
        right.destroy()
        solution.destroy()
        partial = np.stack([contacts.elongation.partial(answer) for answer in self.answers]) if n else np.zeros((0, 0))
        per_push = factor * contacts.elongation.total(partial).T
        self.problem = ContactProblem(contacts.law, contacts.law.stiffness[:, None] * per_push)


class Newmark:
    """Time stepping of one model with one step length; `with` frees the factors."""

    def __init__(
        self,
        operators: Operators,
        scheme: Scheme,
        step: float,
        *,
        damped: bool = True,
        exact_uplift: bool = False,
        prefix: str = "newmark_",
        motions: np.ndarray | None = None,
    ) -> None:
        """Factorise the effective matrix, or with the rigid `motions` (k, n_local) set up its iterative solution (collective).

        `step` in s; `damped=False` leaves the damping out; `exact_uplift` finds the release forces at every step, else
        contacts stay bonded but for release forces that are given.
        """
        self.operators = operators
        self.scheme = scheme
        self.step = step
        self.damping = operators.damping if damped else None
        keep = 1 - scheme.alpha_f
        effective = operators.mass.copy()
        effective.scale(1 - scheme.alpha_m)
        effective.axpy(keep * scheme.beta * step**2, operators.stiffness, structure=SAME)
        if self.damping is not None:
            effective.axpy(keep * scheme.gamma * step, self.damping, structure=SAME)
        self._effective = effective
        self.motions = motions
        self.solver = definite_solver(effective, prefix, "time step", motions)
        self._right, self._work, self._mean = (operators.new_vector() for _ in range(3))
        self._steps = 0
        self.load_scale = 0.0
        """Forces below 1e-12 of this, in N, are round-off to the contacts."""
        self.nodes = FreeNodes(operators.contacts.law, step)
        self.compliance: ContactCompliance | None = None
        if exact_uplift and operators.contacts.law.n_channels:
            # A release force r1 acts as (1 - alpha_f) r1 at the instant of balance and moves the contacts by beta dt^2 a1.
            self.compliance = ContactCompliance(operators, self.solver, keep * scheme.beta * step**2)

    def __enter__(self) -> Newmark:
        """Return itself."""
        return self

    def __exit__(self, *args: object) -> None:
        """Free the factors and work vectors."""
        self.solver.__exit__(*args)
        for thing in (self._effective, self._right, self._work, self._mean):
            thing.destroy()

    def advance(self, state: State, loads: tuple[np.ndarray, np.ndarray], given: np.ndarray | None = None) -> None:
        """Replace `state` by the state one step later (collective).

        `loads` are the values (n_loads,) of the load histories at the beginning and the end of the step. `given`
        (n_channels,) N are the release forces at its end; without them they are exact, or zero if uplift is not exact.
        """
        scheme, dt = self.scheme, self.step
        right = self._balance(state, loads)
        before = state.release
        if given is not None:
            state.release = given
            add_push(self.operators, (1 - scheme.alpha_f) * given + scheme.alpha_f * before, right)
        elif scheme.alpha_f != 0:
            add_push(self.operators, scheme.alpha_f * before, right)
        # The first step and every power of two are checked: cheap, and a factor gone bad is seen early.
        self.solver.solve(right, state.acceleration, check=(self._steps & (self._steps - 1)) == 0)
        self._steps += 1
        state.displacement.axpy(dt**2 * scheme.beta, state.acceleration)
        state.velocity.axpy(dt * scheme.gamma, state.acceleration)
        if self.compliance is not None and given is None:
            self._release(state, before)

    def _balance(self, state: State, loads: tuple[np.ndarray, np.ndarray]) -> Any:
        """Bring displacement and velocity to their known parts one step later; return the right-hand side without release forces."""
        operators, scheme, dt, right = self.operators, self.scheme, self.step, self._right
        keep, old = 1 - scheme.alpha_f, scheme.alpha_f
        right.zeroEntries()
        for value, load in zip(keep * loads[1] + old * loads[0], operators.loads, strict=True):
            if value != 0:
                right.axpy(value, load.vector)
        if scheme.alpha_m != 0:
            operators.mass.mult(state.acceleration, self._work)
            right.axpy(-scheme.alpha_m, self._work)
        u, v, a = state.displacement, state.velocity, state.acceleration
        for vector, matrix, changes in (
            (u, operators.stiffness, ((dt, v), (dt**2 * (0.5 - scheme.beta), a))),
            (v, self.damping, ((dt * (1 - scheme.gamma), a),)),
        ):
            if old != 0:
                vector.copy(self._mean)
            for factor, rate in changes:
                if factor != 0:
                    vector.axpy(factor, rate)
            if matrix is None:
                continue
            if old != 0:
                self._mean.axpby(keep, old, vector)
            matrix.mult(self._mean if old != 0 else vector, self._work)
            right.axpy(-1.0, self._work)
        return right

    def _release(self, state: State, before: np.ndarray) -> None:
        """Find the release forces and add the motion that they cause to a state without them."""
        scheme, compliance = self.scheme, self.compliance
        assert compliance is not None
        elongation = self.operators.contacts.elongation
        tension = elongation.total(compliance.pull @ np.real(state.displacement.array_r))
        if self.nodes.any:
            motion = self.nodes.still(before) if state.nodes is None else state.nodes
            state.release, state.nodes = self.nodes.solve(compliance.problem, tension, before, motion, self.load_scale)
        else:
            state.release = compliance.problem.solve(tension, before, self.load_scale)
        if state.release.any():
            acting = np.flatnonzero(state.release) if len(state.release) > FEW else slice(None)
            self._work.array[:] = ((1 - scheme.alpha_f) * state.release[acting]) @ compliance.answers[acting]
            state.acceleration.axpy(1.0, self._work)
            state.displacement.axpy(self.step**2 * scheme.beta, self._work)
            state.velocity.axpy(self.step * scheme.gamma, self._work)


def load_values(operators: Operators, times: np.ndarray, *, static_only: bool = False) -> np.ndarray:
    """Return the load histories (nt, n_loads) at `times` (nt,) s; with `static_only` those of the static loads alone."""
    columns = [
        load.history(times) if load.static or not static_only else np.zeros(len(times)) for load in operators.loads
    ]
    return np.stack(columns, axis=1) if columns else np.zeros((len(times), 0))


def load_scale(operators: Operators, values: np.ndarray) -> float:
    """Return the largest nodal load in N that the load histories (nt, n_loads) ever make: what round-off in forces is measured by."""
    largest = np.max(np.abs(values), axis=0, initial=0.0)
    nodal = [load.vector.norm(PETSc.NormType.NORM_INFINITY) for load in operators.loads]
    return float(np.max(largest * nodal, initial=0.0))


def loads_at(operators: Operators, values: np.ndarray, release: np.ndarray) -> Any:
    """Return a new vector of the loads for values (n_loads,) of their histories and release forces (n_channels,) N."""
    right = operators.new_vector()
    for value, load in zip(values, operators.loads, strict=True):
        right.axpy(value, load.vector)
    add_push(operators, release, right)
    return right


def balance_acceleration(
    operators: Operators,
    state: State,
    values: np.ndarray,
    time_scale: float,
    *,
    damped: bool = True,
    motions: np.ndarray | None = None,
) -> None:
    """Set the acceleration that the equation of motion asks for: M a = f - C v - K u (collective).

    `values` (n_loads,) are the load histories at this instant. Dofs without mass (rotations, massless joints) follow from their own
    equilibrium, differentiated twice; it enters through a stiffness weighed with `time_scale`^2 s2, small enough to leave
    the others alone.
    """
    right, work = loads_at(operators, values, state.release), operators.new_vector()
    operators.stiffness.mult(state.displacement, work)
    right.axpy(-1.0, work)
    if operators.damping is not None and damped:
        operators.damping.mult(state.velocity, work)
        right.axpy(-1.0, work)
    state.acceleration.zeroEntries()
    diagonal = operators.mass.getDiagonal()
    massless = np.abs(diagonal.array_r) == 0
    diagonal.destroy()
    right.array[massless] = 0.0  # they are in equilibrium: what is left of their forces is round-off
    if right.norm(PETSc.NormType.NORM_INFINITY) > BALANCED * load_scale(operators, values[None, :]):
        matrix = operators.mass.copy()
        if operators.comm.allreduce(bool(massless.any()), op=MPI.LOR):
            matrix.axpy(1e-13 * time_scale**2, operators.stiffness, structure=SAME)
        with definite_solver(matrix, "initial_", "initial acceleration", motions) as solver:
            solver.solve(right, state.acceleration, check=True)
        matrix.destroy()
    right.destroy()
    work.destroy()


def static_state(operators: Operators, *, exact_uplift: bool = False, motions: np.ndarray | None = None) -> State:
    """Return the static answer to the static loads (collective); contacts bonded, or lifted where they pull.

    With the rigid `motions` (k, n_local) it is found iteratively. Raises `SolverError` if there is none.
    """
    state = at_rest(operators)
    values = load_values(operators, np.zeros(1), static_only=True)[0]
    right = loads_at(operators, values, state.release)
    with definite_solver(operators.stiffness, "static_", "static initial state", motions) as solver:
        solver.solve(right, state.displacement, check=right.norm() > 0)
        if exact_uplift and state.release.size:
            compliance = ContactCompliance(operators, solver, 1.0)
            scale = load_scale(operators, values[None, :])
            state.release = settled_release(compliance.problem, tensions(operators, state.displacement), scale)
            state.displacement.array[:] += state.release @ compliance.answers
    right.destroy()
    return state


def settled_state(
    operators: Operators,
    scheme: Scheme,
    step: float,
    steps: int,
    *,
    exact_uplift: bool = False,
    motions: np.ndarray | None = None,
) -> State:
    """Return the state after `steps` undamped steps under the static loads from rest, ending at time 0 (collective).

    With the rigid `motions` (k, n_local) systems are solved iteratively. With beta = 1, gamma = 1.5 and long steps
    this is the static answer, by numerical damping, as the source obtains it.
    """
    state = at_rest(operators)
    values = load_values(operators, np.zeros(1), static_only=True)[0]
    balance_acceleration(operators, state, values, step, damped=False, motions=motions)
    with Newmark(operators, scheme, step, damped=False, exact_uplift=exact_uplift, prefix="settle_", motions=motions) as method:
        method.load_scale = load_scale(operators, values[None, :])
        for _ in range(steps):
            method.advance(state, (values, values))
    return state


def transient(
    method: Newmark,
    start: State,
    steps: int,
    *,
    every: int = 1,
    release: np.ndarray | None = None,
    energy: bool = False,
    observer: Observer | None = None,
    watch: Watch | None = None,
) -> History:
    """March `steps` steps from time 0 and the state `start`, which is left as it is (collective).

    Every `every`-th step is archived. `release` (n_archived, n_channels) N are release forces known at the archived instants
    and interpolated linearly between them; without them uplift is exact, or left out, as `method` was made. `energy`
    keeps the ledger of energies, at three products of a matrix and a vector a step, unless auxiliary nodes have masses that count,
    whose energy it does not know. `observer` is shown the archived displacements. `watch` shows the progress and keeps checkpoints, from
    which the same march goes on to the same bits on as many ranks.
    """
    operators = method.operators
    times = method.step * np.arange(steps + 1)
    archived = times[::every]
    values = load_values(operators, times)
    method.load_scale = load_scale(operators, values)
    given = None
    if release is not None:
        given = np.stack([np.interp(times, archived, column) for column in release.T], axis=1)
    heavy = method.nodes if method.nodes.any and method.compliance is not None and given is None else None
    record = Record(operators, len(archived), EnergyMeter(operators) if energy and heavy is None else None, observer, heavy)
    with start.copy() as state:
        problem = method.compliance.problem if method.compliance is not None else None
        kept = KeptMarch(watch, operators.comm, problem, state, record)
        reached = kept.read()
        if reached < 0:
            if given is not None:
                state.release = given[0]
            elif method.compliance is None:
                state.release = np.zeros_like(state.release)
            balance_acceleration(operators, state, values[0], method.step, motions=method.motions)
            record.add(state, values[0], row=0)
            reached = 0
        elif record.meter is not None:
            record.meter.resume(state.displacement, state.velocity, values[reached])
        with Loop(watch, operators.comm, "steps", steps, reached, lambda: kept.save(n)) as loop:
            n = reached
            for n in range(reached + 1, steps + 1):
                method.advance(state, (values[n - 1], values[n]), None if given is None else given[n])
                record.add(state, values[n], row=n // every if n % every == 0 else None, step=method.step)
                if n >= loop.next and n < steps:
                    loop.meet(n)
            loop.finish()
    return record.history(archived)
