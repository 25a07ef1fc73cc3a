"""What a factor costs against conjugate gradients with multigrid, in time and memory, as the mesh grows."""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.evidence.scaling.cost import refined
from uplift.drivers.scene.scene import Scene
from uplift.forms.assembly.row_labels import rigid_motions
from uplift.solvers.linear import IterativeSolver, LinearSolver, definite_solver
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.state import at_rest, load_values, loads_at

CASES = (16, 32, 64, 128)
"""Refinement of the scene."""

QUICK = (2, 4)

STEPS = 20

NAMES = ("direct", "iterative")

WHAT = f"""The same systems by a factor (Cholesky, MUMPS) / by conjugate gradients with algebraic multigrid (GAMG), which
`--solver iterative` takes: the static answer to the weight, and {STEPS} time steps with exact uplift from there. Set-up is the
factorisation, or that of the multigrid; a solve is the mean over the steps and the answers to unit contact forces before them. Each on
one rank in a process of its own; "memory" is what its peak from there on lies above what it held as the model was ready. "P3" is the
largest difference between both histories, over the largest displacement."""
"""What the table shows."""

HEAD = [
    "| dofs | model GiB | static: set-up s | solve s | iterations | time step: set-up s | solve s | iterations | memory GiB | P3 |",
    "|" + "---:|" * 10,
]


@dataclass(frozen=True)
class Solved:
    """One way to solve; wall seconds."""

    dofs: int
    model: float
    """Bytes of the process before anything is solved."""
    static_setup: float
    static_solve: float
    static_iterations: int
    step_setup: float
    step_solve: float
    """The mean of a solve."""
    step_iterations: float
    """The mean of a solve; 0 with a factor."""
    memory: float
    """Bytes that the process has held above that."""


def measure_solver(scene: Scene, comm: Any, factor: int, name: str, folder: Path) -> Solved:
    """Solve the static state and march a few steps in the way called `name`; leave the probes in `folder`."""
    settings = scene.transient
    assert settings is not None
    with prepare(refined(scene, factor), comm) as assembly:
        operators = assembly.operators
        rigid_modes = rigid_motions(assembly.plate.labels) if name == "iterative" else None
        ctypes.CDLL(None).malloc_trim(0)  # what assembly has given back would hide what the solver takes
        model = _resident("VmRSS")
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # the peak starts anew
        with at_rest(operators) as state:
            values = load_values(operators, np.zeros(1), static_only=True)[0]
            right = loads_at(operators, values, state.release)
            with definite_solver(operators.stiffness, "static_", "static state", rigid_modes) as solver:
                solver.solve(right, state.displacement, check=True)
                static = solver.factor_seconds, solver.solve_seconds, _iterations(solver)
            right.destroy()
            with Newmark(operators, settings.scheme, settings.step, exact_uplift=True, rigid_modes=rigid_modes) as method:
                history = transient(method, state, STEPS)
                solves = STEPS + operators.contacts.law.n_channels
                step = method.solver.factor_seconds, method.solver.solve_seconds / solves, _iterations(method.solver) / solves
        memory = max(_resident("VmHWM") - model, 4096.0)  # a page at least
        np.save(folder / f"{name}.npy", history.probes)
        return Solved(operators.n, model, *static, *step, memory)


def _resident(key: str) -> float:
    """Return bytes of this process: those it holds, `VmRSS`, or its peak, `VmHWM`."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return 1024.0 * next(float(line.split()[1]) for line in lines if line.startswith(key + ":"))


def _iterations(solver: LinearSolver) -> int:
    return solver.iterations if isinstance(solver, IterativeSolver) else 0


def row(pair: tuple[Solved, Solved], difference: float) -> str:
    """Return the line of the table: with the factor / without."""
    one, other = pair
    times = (f"{getattr(one, name):.3g} / {getattr(other, name):.3g}" for name in ("static_setup", "static_solve"))
    steps = (f"{getattr(one, name):.3g} / {getattr(other, name):.3g}" for name in ("step_setup", "step_solve"))
    return (
        f"| {one.dofs:,} | {one.model / 2**30:.2f} | {' | '.join(times)} | {other.static_iterations} | {' | '.join(steps)} "
        f"| {other.step_iterations:.1f} | {one.memory / 2**30:.2f} / {other.memory / 2**30:.2f} | {difference:.1e} |"
    )


def conclusion(pairs: Sequence[tuple[Solved, Solved]]) -> str:
    """Say what the largest meshes say."""
    (here, there), (one, other) = pairs[-2:]
    powers = (np.log(b.memory / a.memory) / np.log(b.dofs / a.dofs) for a, b in ((here, one), (there, other)))
    return fill(
        f"At {one.dofs:,} dofs a solve without the factor takes {other.step_solve / one.step_solve:.0f} times as long as one with it, and "
        f"its set-up {other.step_setup / one.step_setup:.2f} of a factorisation; it needs {other.memory / one.memory:.2f} of the memory. "
        "Over the last two meshes memory "
        f"grows as dofs^{next(powers):.2f} with the factor and dofs^{next(powers):.2f} without: "
        "where the former fits, it is the faster way.", 120
    )


def solver_rows(child: Callable[..., dict[str, Any]], say: Callable[[str], None], *, quick: bool) -> list[str]:
    """Measure all cases, each in processes of its own, and return the lines of the table and what it says.

    `child(*arguments)` returns what one of the processes printed.
    """
    lines, pairs = list(HEAD), []
    for line in lines:
        say(line)
    for factor in QUICK if quick else CASES:
        with tempfile.TemporaryDirectory() as folder:
            pairs.append((Solved(**child("solver", factor, NAMES[0], folder)), Solved(**child("solver", factor, NAMES[1], folder))))
            here, there = (np.load(Path(folder) / f"{name}.npy") for name in NAMES)
        lines.append(row(pairs[-1], float(np.max(np.abs(there - here)) / np.max(np.abs(here)))))
        say(lines[-1])
    return [*lines, "", conclusion(pairs)]
