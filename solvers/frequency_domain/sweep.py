"""The sweep: transfer functions from loads and release forces to probes, contacts and resultants.

At every point the matrix K + first C + second M is factorised once and solved for all loads and for one unit release force at
each contact; whatever is asked of the contacts afterwards is algebra of the size of the contacts. The points are independent of one
another: groups of ranks take them in turn (`uplift.solvers.frequency_domain.groups`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from uplift.forms.operators import Operators
from uplift.solvers.frequency_domain.dense_sweep import dense_sweep
from uplift.solvers.frequency_domain.groups import Layout, System, choose_groups, group_system, split, to_ranks
from uplift.solvers.frequency_domain.transfer import Transfer
from uplift.solvers.linear import SAME_PATTERN, DirectSolver
from uplift.solvers.memory import FIELD_BYTES, available_bytes, group_bytes, ranks_here, size_of
from uplift.solvers.watch import Loop, Watch

TRANSIT_BYTES = 2**26
"""Fields that a group collects before it deals them out to all ranks."""



def sweep(
    operators: Operators,
    first: np.ndarray,
    second: np.ndarray,
    *,
    more: tuple[Any, ...] = (),
    prefix: str,
    what: str,
    groups: int | None = None,
    watch: Watch | None = None,
) -> Transfer:
    """Solve (K + first C + second M) X = [loads, unit release forces, more] at each point (collective).

    `first` in 1/s and `second` in 1/s2 are complex, (n_points,); `more` are further load vectors. Needs complex PETSc. One matrix
    is refilled on one pattern, and every solution is checked by its residual. The ranks form `groups` groups (None: as many as
    memory allows), whose number changes the answers by round-off only. `watch` shows the progress and keeps the points that are done.
    A model in a basis is solved by small dense algebra, whatever the build of PETSc, without checkpoints. Many parameters because all
    but the first three and the names may be left out.
    """
    if operators.reduction is not None:
        return dense_sweep(operators, first, second, more=more, what=what)
    if not np.issubdtype(PETSc.ScalarType, np.complexfloating):
        raise RuntimeError(f"the {what} needs complex PETSc, and this process has the real one")
    comm = operators.comm
    columns = _columns(operators, more)
    outputs = operators.outputs
    rows = outputs.local if outputs.per_velocity is None else sparse.vstack([outputs.local, outputs.per_velocity], format="csr")
    results = _Results(operators, len(first), columns.shape[1])
    kept = _KeptPoints(watch, prefix.rstrip("_"), results)
    left = np.flatnonzero(~results.done)
    if groups is None:
        need = group_bytes(size_of(operators.stiffness), columns.shape[1])
        groups = choose_groups(comm, len(first), need, comm.allreduce(available_bytes() / ranks_here(comm), op=MPI.MIN))
    seconds = np.zeros(2)
    with split(comm, groups) as layout, group_system(operators, columns, rows, layout) as system:
        mine, before = left[layout.group :: groups], len(first) - len(left)
        rounds, done = -(-len(left) // groups), 0
        most = max(1, TRANSIT_BYTES // (16 * columns.shape[1] * operators.n)) if results.fields is not None else rounds
        with (
            _point_solver(system, layout, first, second, mine, prefix, what) as solver,
            Loop(watch, comm, "points", len(first), before, kept.save) as loop,
        ):
            while done < rounds:
                end = min(done + most, -(-(loop.next - before) // groups), rounds)
                _solve_batch(results, layout, system, solver, mine[done:end], left[done * groups : end * groups])
                done = end
                reached = before + min(done * groups, len(left))
                if loop.next <= reached < len(first):
                    loop.meet(reached)
            loop.finish()
            if solver is not None:
                seconds[:] = solver.times
    comm.Allreduce(MPI.IN_PLACE, seconds, op=MPI.MAX)
    return results.transfer(*seconds)


def _columns(operators: Operators, more: tuple[Any, ...]) -> np.ndarray:
    """Return all right-hand sides (n_local, n_columns), this rank's rows."""
    vectors = [*(load.vector for load in operators.loads), *more]
    columns = np.zeros((operators.n_local, len(vectors) + operators.contacts.law.n_channels), dtype=PETSc.ScalarType)
    n_loads = len(operators.loads)
    columns[:, n_loads : columns.shape[1] - len(more)] = operators.contacts.push.toarray()
    for j, vector in enumerate(vectors):
        columns[:, j if j < n_loads else j - len(vectors)] = vector.array_r
    return columns


class _Results:
    """Results of a sweep by point, replicated on every rank."""

    def __init__(self, operators: Operators, n_points: int, n_columns: int) -> None:
        self.operators = operators
        self.done = np.zeros(n_points, dtype=bool)
        self.observed = np.zeros((n_points, n_columns, operators.outputs.local.shape[0]), dtype=complex)
        fits = 16 * n_points * n_columns * operators.n_local <= FIELD_BYTES
        keep = operators.comm.allreduce(int(fits), op=MPI.MIN) == 1
        self.fields = np.zeros((n_points, n_columns, operators.n_local), dtype=complex) if keep else None

    def transfer(self, factor_seconds: float, solve_seconds: float) -> Transfer:
        """Return the transfer functions, all points being done."""
        answers = self.observed.transpose(0, 2, 1)
        return Transfer(answers, self.operators.outputs, self.fields, float(factor_seconds), float(solve_seconds))


class _PointSolver:
    """One matrix of a group, refilled and factorised point by point."""

    def __init__(self, system: System, first: np.ndarray, second: np.ndarray, prefix: str, what: str, start: int) -> None:
        self._system = system
        self._coefficients = first, second
        self._matrix = system.stiffness.copy()
        n_local, n = self._matrix.getLocalSize()[0], self._matrix.getSize()[0]
        self._blocks = [
            PETSc.Mat().createDense(((n_local, n), (None, system.columns.shape[1])), comm=self._matrix.comm) for _ in range(3)
        ]
        for block in self._blocks:
            block.setUp()
            block.assemble()
        self._blocks[0].getDenseArray()[:] = system.columns
        self._blocks[0].assemble()
        self._fill(start)
        self._filled: int | None = start
        self._solver = DirectSolver(self._matrix, prefix, definite=False, what=what)

    @property
    def times(self) -> tuple[float, float]:
        """Seconds of factorisations and of solves."""
        return self._solver.factor_seconds, self._solver.solve_seconds

    def solve(self, point: int) -> np.ndarray:
        """Return the answers (n_held, n_columns) at one point, valid until the next (collective in the group)."""
        if self._filled != point:
            self._fill(point)
            self._solver.refactor()
            self._filled = point
        right, solution, residual = self._blocks
        self._solver.solve_block(right, solution, residual)
        return solution.getDenseArray()

    def observe(self, point: int, n_rows: int) -> tuple[np.ndarray, np.ndarray]:
        """Return this rank's answers at one point, as `solve`, and their shares of the outputs (n_columns, n_rows) (collective)."""
        solution = self.solve(point)
        shares = self._system.outputs @ solution
        observed = shares[:n_rows]
        if len(shares) > n_rows:  # below stand the weights on the velocity, which is `first` times the displacement
            observed = observed + self._coefficients[0][point] * shares[n_rows:]
        return solution, observed.T

    def _fill(self, point: int) -> None:
        first, second = (values[point] for values in self._coefficients)
        system, matrix = self._system, self._matrix
        system.stiffness.copy(matrix, structure=SAME_PATTERN)
        matrix.axpy(second, system.mass, structure=SAME_PATTERN)
        if system.damping is not None:
            matrix.axpy(first, system.damping, structure=SAME_PATTERN)

    def close(self) -> None:
        """Free factors and matrices."""
        self._solver.__exit__()
        for thing in (self._matrix, *self._blocks):
            thing.destroy()


@contextmanager
def _point_solver(
    system: System, layout: Layout, first: np.ndarray, second: np.ndarray, mine: np.ndarray, prefix: str, what: str
) -> Iterator[_PointSolver | None]:
    """Give the solver of this rank's group; None for a group that has no point to solve."""
    if not len(mine) or not system.columns.shape[1]:
        yield None
        return
    solver = _PointSolver(system, first, second, prefix, what, int(mine[0]))
    try:
        yield solver
    finally:
        solver.close()


def _solve_batch(
    results: _Results, layout: Layout, system: System, solver: _PointSolver | None, mine: np.ndarray, all_points: np.ndarray
) -> None:
    """Solve the points `mine` of this group and bring the answers to `all_points` of all groups to all ranks (collective)."""
    comm, n_columns = layout.world, results.observed.shape[1]
    observed = np.zeros((len(all_points), *results.observed.shape[1:]), dtype=complex)
    answers = []
    for k, point in enumerate(mine):
        if solver is None:
            break
        solution, observed[k * layout.groups + layout.group] = solver.observe(int(point), observed.shape[2])
        if results.fields is not None:
            answers.append(solution.copy())
    # Within a group the sum is taken in the order of the ranks, so that its last bit depends on nothing else.
    parts = layout.comm.gather(observed) if layout.comm.size > 1 else [observed]
    observed = np.sum(parts, axis=0) if parts is not None else np.zeros_like(observed)
    if comm.size > 1:
        comm.Allreduce(MPI.IN_PLACE, observed)
    results.observed[all_points] = observed
    if results.fields is not None:
        rows = comm.allgather(results.operators.n_local)
        for group, fields in to_ranks(answers, layout, rows, n_columns).items():
            results.fields[all_points[group :: layout.groups]] = fields.transpose(0, 2, 1)
    results.done[all_points] = True


class _KeptPoints:
    """The points of a sweep in its checkpoint: one file for those that were done between two checkpoints."""

    def __init__(self, watch: Watch | None, what: str, results: _Results) -> None:
        """Read what an earlier run has left into `results` (collective)."""
        self._checkpoint = watch.checkpoint if watch is not None else None
        self._results = results
        self._parts = 0
        if watch is None or self._checkpoint is None:
            return
        self._name = watch.name(what)
        while (part := self._checkpoint.load(f"{self._name}-{self._parts + 1:04d}")) is not None:
            self._read(part)
            self._parts += 1
        self._saved = results.done.copy()

    def _read(self, part: dict[str, np.ndarray]) -> None:
        results, checkpoint = self._results, self._checkpoint
        assert checkpoint is not None
        comm = results.operators.comm
        points, observed, has_fields = comm.bcast((part["points"], part["observed"], "fields" in part) if comm.rank == 0 else None)
        results.observed[points] = observed
        results.done[points] = True
        if not has_fields:
            results.fields = None
        if results.fields is not None:
            for i, point in enumerate(points):
                whole = part["fields"][i] if comm.rank == 0 else None
                results.fields[point] = checkpoint.rows.scatter(whole, (results.observed.shape[1],), complex).T

    def save(self) -> None:
        """Write the points that are done and not yet written (collective)."""
        results, checkpoint = self._results, self._checkpoint
        assert checkpoint is not None
        points = np.flatnonzero(results.done & ~self._saved)
        arrays = {"points": points, "observed": results.observed[points]}
        if results.fields is not None:
            whole = [checkpoint.rows.gather(results.fields[point].T) for point in points]
            if results.operators.comm.rank == 0:
                arrays["fields"] = np.array(whole)
        if checkpoint.save(f"{self._name}-{self._parts + 1:04d}", arrays):
            self._parts += 1
            self._saved = results.done.copy()
