"""What exact uplift costs, as ratios within one run: against the linear march, the bare solves, and the sweep."""

from __future__ import annotations

import platform
import time
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene, prepare
from uplift.drivers.evidence.pages import command_line
from uplift.drivers.process import say
from uplift.drivers.results.folder import processor, versions, writable_folder
from uplift.drivers.scene.refinement import finer
from uplift.drivers.scene.scene import Scene
from uplift.meshes.checked import ModelError
from uplift.meshes.plate import Plate
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import State

DURATION = 5.0
"""s: all marches cover the whole reference case, however many steps they take."""


@dataclass(frozen=True)
class Row:
    """Costs on one mesh, wall seconds."""

    dofs: int
    supports: int
    steps: int
    factor: float
    solves: float
    """Of as many bare solves as steps."""
    linear: float
    """Linear march without its factorisation."""
    exact: float
    compliance: float
    """Extra solves for the compliance of the contacts."""

    over_solves: float
    """Linear run over one factorisation and the bare solves."""
    over_linear: float
    """Run with exact uplift over the linear run, everything counted."""


def refined(scene: Scene, factor: int) -> Scene:
    """Return the scene on a mesh refined by `factor` in both directions. Raises `ModelError` for a mesh from a file."""
    return replace(scene, plate=finer(scene.plate, factor))


def on_a_line(scene: Scene, supports: int) -> Scene:
    """Return the scene on a line of so many supports that share the stiffness of its own, one under each bottom node.

    Raises `ModelError` for a scene that is no rectangle on supports.
    """
    if not (isinstance(scene.plate, Plate) and scene.model.supports):
        raise ModelError("mesh", "expected a rectangle on supports")
    own = scene.model.supports[0]
    nx, width = supports - 1, scene.plate.width
    share = own.stiffness[own.axis] * len(own.points) / supports
    stiffness = (own.stiffness[0], share) if own.axis == 1 else (share, own.stiffness[1])
    line = replace(own, points=tuple((width * i / nx, 0.0) for i in range(supports)), stiffness=stiffness)
    return replace(scene, plate=replace(scene.plate, nx=nx, ny=20), model=replace(scene.model, supports=(line,)))


def measure(scene: Scene, comm: Any, steps: int, rounds: int) -> Row:
    """Measure one mesh: bare solves, linear and exact march in turn, round by round; medians of times and of ratios."""
    with prepare(scene, comm) as assembly, static_state(assembly.operators, exact_uplift=True) as start:
        operators, step = assembly.operators, DURATION / steps
        begin = time.perf_counter()
        bonded = Newmark(operators, Scheme(), step)
        factor = time.perf_counter() - begin
        begin = time.perf_counter()
        lifting = Newmark(operators, Scheme(), step, exact_uplift=True)
        compliance = max(time.perf_counter() - begin - factor, 0.0)
        with bonded, lifting:
            times = np.array([
                (_bare_solves(assembly, bonded, steps), _seconds(bonded, start, steps), _seconds(lifting, start, steps))
                for _ in range(rounds)
            ])
        solves, linear, exact = times.T
        return Row(
            dofs=operators.n,
            supports=len(operators.contacts.names),
            steps=steps,
            factor=factor,
            solves=float(np.median(solves)),
            linear=float(np.median(linear)),
            exact=float(np.median(exact)),
            compliance=compliance,
            over_solves=float(np.median((factor + linear) / (factor + solves))),
            over_linear=float(np.median((factor + compliance + exact) / (factor + linear))),
        )


def _seconds(method: Newmark, start: State, steps: int) -> float:
    begin = time.perf_counter()
    transient(method, start, steps)
    return time.perf_counter() - begin


def _bare_solves(assembly: AssembledScene, method: Newmark, steps: int) -> float:
    right, solution = assembly.operators.new_vector(), assembly.operators.new_vector()
    right.set(1.0)
    begin = time.perf_counter()
    for _ in range(steps):
        method.solver.solve(right, solution)
    seconds = time.perf_counter() - begin
    right.destroy()
    solution.destroy()
    return seconds


def measure_sweep(scene: Scene, comm: Any, steps: int) -> tuple[int, float, float]:
    """Return dofs, seconds of the sweep and seconds of the march of a time-frequency run (complex PETSc)."""
    from uplift.solvers.frequency_domain.laplace import laplace_run

    with prepare(scene, comm) as assembly, static_state(assembly.operators, exact_uplift=True) as start:
        run = laplace_run(assembly.operators, Scheme(), DURATION / steps, steps, start)
        return assembly.operators.n, run.sweep_seconds, run.march_seconds


def cost(scene: Scene, comm: Any, out: Path, *, quick: bool, sweep: tuple[tuple[int, float, float], ...]) -> None:
    """Measure the meshes, print the table and write it as a page (collective)."""
    cases = [(refined(scene, 1), 1000), (refined(scene, 4), 1000)]
    if not quick:
        cases += [(refined(scene, 16), 300), (refined(scene, 32), 150), (on_a_line(scene, 400), 5000)]
    head = (
        "| dofs | supports | steps | factorisation s | bare solves s | linear march s | exact march s "
        "| linear run / (factorisation + solves) | exact / linear run |"
    )
    lines = [head, "|" + "---:|" * 9]
    for line in lines:
        say(line)
    for case, steps in cases:
        row = measure(case, comm, steps, rounds=5 if steps < 5000 else 1)
        lines.append(
            f"| {row.dofs:,} | {row.supports} | {row.steps:,} | {row.factor:.3f} | {row.solves:.3f} | {row.linear:.3f} | {row.exact:.3f} "
            f"| {row.over_solves:.2f} | {row.over_linear:.2f} |"
        )
        say(lines[-1])
    lines += ["", "| dofs | steps | sweep s | march s | march / sweep |", "|" + "---:|" * 5]
    for dofs, swept, marched in sweep:
        lines.append(f"| {dofs:,} | {SWEEP_STEPS:,} | {swept:.3f} | {marched:.3f} | {marched / swept:.2f} |")
        say(lines[-1])
    if comm.rank == 0:
        writable_folder(out.absolute().parent)
        out.write_text(_page(lines, command_line("cost", out, "cost.md", *["--quick"] * quick)), encoding="utf-8")
        say(f"page in {out}")


SWEEP_STEPS = 1000
"""Steps of the sweeps that are measured."""


def _page(lines: list[str], command: str) -> str:
    about = versions()
    return f"""# What exact uplift costs

Every number is wall seconds in one run on one core; only the ratios mean anything on another machine. The linear march keeps every
contact bonded; the exact one finds the open contacts at every step. Both cover the {DURATION:g} s of the reference case on finer
and finer meshes; bare solves, linear and exact march take turns, and the table has the medians of their times and of their ratios.
The last row of the first table has 400 supports on a line. At a hundred dofs a solve takes some four microseconds, and a linear run
several times as long as its solves, because a step is some twenty calls from Python. On the finer meshes what a linear step costs
beside its solve is two products of matrix and vector, whose matrices the factors have driven out of the cache.

{chr(10).join(lines)}

Made by `{command}` on {datetime.now(UTC):%Y-%m-%d} with dolfinx {about["dolfinx"]}, PETSc {about["petsc"]}, Python {about["python"]}
({platform.machine()}, {processor()}).
"""


def sweep_in_child(scene: Path, quick: bool) -> tuple[tuple[int, float, float], ...]:
    """Measure the sweeps in a process with complex PETSc and return (dofs, sweep seconds, march seconds) of each."""
    import json
    import subprocess
    import sys

    command = [sys.executable, "-m", "drivers", "cost", str(scene), "--sweeps-only", *(["--quick"] if quick else [])]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return tuple(tuple(row) for row in json.loads(done.stdout.splitlines()[-1]))


def sweeps(scene: Scene, comm: Any, *, quick: bool) -> list[tuple[int, float, float]]:
    """Measure the sweeps here: reference mesh, and four times finer unless `quick`."""
    return [measure_sweep(refined(scene, factor), comm, SWEEP_STEPS) for factor in ((1,) if quick else (1, 4))]
