"""How the sweep grows: with dofs, on one rank, on two by groups of frequencies and by splitting the domain; and where that leads."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.evidence.pages import command_line
from uplift.drivers.evidence.scaling.beside_opensees import compare_with_opensees
from uplift.drivers.evidence.scaling.cost import refined
from uplift.drivers.evidence.scaling.linear_solvers import WHAT, Solved, measure_solver, solver_rows
from uplift.drivers.evidence.scaling.reduced import CHECKED, Direct, Reduced, measure_direct, measure_reduced, reduced_rows
from uplift.drivers.process import launcher, say
from uplift.drivers.results.folder import processor, versions, writable_folder
from uplift.drivers.scene.scene import Scene
from uplift.meshes.checked import ModelError
from uplift.meshes.imported import MeshFile

BAND = 25.0
"""Hz: the frequencies of a measurement are spread over it."""

CASES = ((4, 80), (8, 40), (16, 20), (32, 8), (64, 2))
"""Refinement of the scene in both directions, and frequencies that are solved."""

QUICK = ((2, 8), (4, 8))

ROUNDS, PATIENCE = 5, 150.0
"""The layouts take turns so often, or until so many seconds are over; the shortest times count, which other work on the machine has
disturbed the least."""

LAYOUTS = {"1 rank": (1, 1), "2 ranks, 2 groups": (2, 2), "2 ranks, domain split": (2, 1)}
"""Ranks and groups."""

HEAD = [f"| dofs | frequencies | {' | '.join(f'{n} s' for n in LAYOUTS)} | 2 groups / 1 rank | domain split / 1 rank |", "|" + "---:|" * 7]

NODES, FREQUENCIES = 100, 1000
"""What is extrapolated to."""


@dataclass(frozen=True)
class Measured:
    """One sweep: wall and processor seconds, and memory."""

    dofs: int
    points: int
    seconds: float
    """Wall time of the whole sweep: dealing out the matrices, factorisations, solves, checks, gathering."""
    cpu: float
    """Processor time of the rank that took the most."""
    ready: float
    """Wall time of mesh, forms and assembly before it."""
    memory: float
    """Bytes, the largest rank's peak of the whole process."""


def measure(scene: Scene, comm: Any, factor: int, points: int, groups: int) -> Measured:
    """Sweep so many frequencies on a refined mesh (collective, complex PETSc)."""
    from mpi4py import MPI

    from uplift.solvers.frequency_domain.harmonic import harmonic_sweep
    from uplift.solvers.memory import peak_bytes

    begin = time.perf_counter()
    with prepare(refined(scene, factor), comm) as assembly:
        comm.barrier()
        ready, begin, worked = time.perf_counter() - begin, time.perf_counter(), time.process_time()
        harmonic_sweep(assembly.operators, 2 * np.pi * np.linspace(BAND / points, BAND, points), groups=groups)
        worked = comm.allreduce(time.process_time() - worked, op=MPI.MAX)
        comm.barrier()
        return Measured(assembly.operators.n, points, time.perf_counter() - begin, worked, ready, peak_bytes(comm)[0])


def in_child(path: Path, ranks: int, *arguments: object) -> dict[str, Any]:
    """Let a process of its own, or several under mpirun, measure what the `arguments` of `measured` say; return what it printed."""
    command = [*launcher(ranks), sys.executable, "-m", "drivers", "scale", str(path), "--measure", *map(str, arguments)]
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX", "PRTE"))}
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    except FileNotFoundError:
        raise ModelError("scale", "needs mpirun, which is not installed") from None
    except subprocess.CalledProcessError as error:
        raise RuntimeError(f"a measurement on {ranks} ranks failed: {error.stderr.strip()}") from error
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def measured(scene: Scene, comm: Any, what: str, factor: str, *arguments: str) -> dict[str, Any]:
    """Return what a process of its own measures (collective): a "sweep", a run that is "reduced", the "direct" sweep, or a "solver"."""
    done: Measured | Reduced | Direct | Solved
    if what == "sweep":
        points, groups = map(int, arguments)
        done = measure(scene, comm, int(factor), points, groups)
    elif what == "reduced":
        steps, checks, folder = arguments
        done = measure_reduced(scene, comm, int(factor), int(steps), int(checks), Path(folder))
    elif what == "direct":
        done = measure_direct(scene, comm, int(factor), Path(arguments[0]))
    else:
        name, folder = arguments
        done = measure_solver(scene, comm, int(factor), name, Path(folder))
    return asdict(done)


def scaling(path: Path, scene: Scene, out: Path, *, quick: bool) -> None:
    """Measure all cases and write the page. Raises `ModelError` for a scene that lacks what is measured."""
    writable_folder(out.absolute().parent)
    if scene.fourier is None or scene.transient is None:
        raise ModelError("scale", "expected a scene with the sections [fourier] and [transient]")
    if isinstance(scene.plate, MeshFile):
        raise ModelError("mesh.file", "expected a mesh that the program makes: one from a file cannot be refined")
    child = partial(in_child, path, 1)
    reduced = reduced_rows(scene, child, say, quick=quick)
    solvers = solver_rows(child, say, quick=quick)
    rows: list[dict[str, Measured]] = []
    for line in HEAD:
        say(line)
    for factor, points in QUICK if quick else CASES:
        rows.append(shortest(path, factor, points, 1 if quick else ROUNDS))
        say(_row(rows[-1]))
    command = command_line("scale", out, "scaling.md", *["--quick"] * quick, scene=path)
    out.write_text(page(rows, reduced, solvers, command, rounds=1 if quick else ROUNDS), encoding="utf-8")
    say(f"page in {out}")


def beside_opensees(path: Path, scene: Scene, out: Path, *, quick: bool) -> None:
    """Measure the reduced run beside OpenSeesPy and write the page."""
    compare_with_opensees(scene, partial(in_child, path, 1), out, quick=quick)


def shortest(path: Path, factor: int, points: int, rounds: int) -> dict[str, Measured]:
    """Return the shortest measurement of each layout."""
    best: dict[str, Measured] = {}
    end = time.monotonic() + PATIENCE
    for number in range(rounds):
        if number and time.monotonic() > end:
            break
        for name, (ranks, groups) in LAYOUTS.items():
            here = Measured(**in_child(path, ranks, "sweep", factor, points, groups))
            if name not in best or here.seconds < best[name].seconds:
                best[name] = here
    return best


def slope(dofs: Sequence[float], seconds: Sequence[float]) -> float:
    """Return the exponent p of seconds ~ dofs^p, by least squares of the logarithms."""
    return float(np.polyfit(np.log(dofs), np.log(seconds), 1)[0])


def _row(best: dict[str, Measured]) -> str:
    one, two, split = (best[name] for name in LAYOUTS)
    return (
        f"| {one.dofs:,} | {one.points} | {one.seconds:.2f} ({one.cpu:.2f}) | {two.seconds:.2f} ({two.cpu:.2f}) "
        f"| {split.seconds:.2f} ({split.cpu:.2f}) | {two.seconds / one.seconds:.2f} ({two.cpu / one.cpu:.2f}) "
        f"| {split.seconds / one.seconds:.2f} ({split.cpu / one.cpu:.2f}) |"
    )


def page(rows: list[dict[str, Measured]], reduced: Sequence[str], solvers: Sequence[str], command: str, *, rounds: int = ROUNDS) -> str:
    """Return the page in Markdown; `reduced` and `solvers` are the lines of the tables of the reduced run and of the solvers."""
    names = list(LAYOUTS)
    dofs = [row[names[0]].dofs for row in rows]
    exponents = {name: slope(dofs, [row[name].cpu / row[name].points for row in rows]) for name in names}
    large = [i for i, n in enumerate(dofs) if n > 4000]
    upper = ""
    if len(large) > 1:
        late = slope([dofs[i] for i in large], [rows[i][names[0]].cpu / rows[i][names[0]].points for i in large])
        upper = f"; {late:.2f} on one rank over the meshes of more than 4,000 dofs"
    about = versions()
    growth = ", ".join(f"{p:.2f} ({name})" for name, p in exponents.items())
    lines = "\n".join
    table = lines([*HEAD, *(_row(row) for row in rows)])
    return f"""# How the sweep grows

Seconds of the direct sweep of the reference scene on finer and finer meshes, the whole of it: dealing out the matrices, one
factorisation a frequency (complex, L D L^T by MUMPS), one solve for all loads and unit contact forces, their check, gathering. Mesh,
assembly and start-up are left out. Wall seconds, and in parentheses the processor seconds of the busier rank, which other work on the
machine disturbs less. The layouts took turns, up to {rounds} time(s) each, and the shortest time counts.

{table}

By groups, each rank holds all matrices and takes every second frequency; with the domain split, two ranks share each factor.
Two ranks can halve the time, what is below 0.5 is noise; above 1 the second rank is a loss. Both ranks run on one machine, so they share
its memory and the way to it, and no network is between them.

Growth: processor seconds a frequency grow as dofs^p with p = {growth}{upper}.
Nested dissection of a plane mesh promises p = 1.5 for the factorisation of large meshes, 1 for everything else.

## The reduced sweep

{CHECKED}

{lines(reduced)}

## Without a factor

{WHAT}

{lines(solvers)}

## {FREQUENCIES:,} frequencies on {NODES} nodes

{_extrapolation(rows)}

Made by `{command}` on {datetime.now(UTC):%Y-%m-%d} with dolfinx {about["dolfinx"]}, PETSc {about["petsc"]}, Python {about["python"]}
({platform.machine()}, {processor()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the end).
"""


def _extrapolation(rows: list[dict[str, Measured]]) -> str:
    """Say what the measured figures lead to, and where they end."""
    one, two, split = LAYOUTS
    lines = [
        "| dofs | seconds a frequency, both ranks of a machine busy | turns | seconds of the sweep | seconds on 1 rank | GiB a rank |",
        "|" + "---:|" * 6,
    ]
    turns = -(-FREQUENCIES // (2 * NODES))
    for row in rows:
        busy = row[two].seconds * 2 / row[two].points
        alone = row[one].seconds / row[one].points * FREQUENCIES
        lines.append(f"| {row[one].dofs:,} | {busy:.3f} | {turns} | {turns * busy:.1f} | {alone:,.0f} | {row[two].memory / 2**30:.2f} |")
    last, first = rows[-1], rows[0]
    best = min(row[split].seconds / row[one].seconds for row in rows)
    busiest = last[two].seconds * 2 / last[two].points
    splitting = f"the best ratio measured above is {best:.2f}"
    return f"""Measured: the time of a frequency with both ranks of a machine at work, in groups of one rank.
Assumed: {NODES} machines like this one, two ranks each, which do not slow each other down, as they have nothing to
say to each other between the first and the last frequency.

{chr(10).join(lines)}

The limit. With {2 * NODES} ranks the {FREQUENCIES:,} frequencies take {turns} turns; more than {FREQUENCIES:,} ranks find no frequency
of their own, and the sweep cannot become shorter than one frequency takes ({busiest:.2f} s at {last[one].dofs:,} dofs), unless ranks
share a factor: {splitting}. Before the sweep comes the model itself, {first[two].ready:.1f} s at {first[one].dofs:,} dofs
and {last[two].ready:.1f} s at {last[one].dofs:,} on two ranks. A rank must hold a whole factor; its memory in the table is that of the
whole process, and where it no longer fits a group takes more ranks. Not measured: a network, more than two ranks, dealing the
matrices out to many groups, and gathering the answers from them, some kilobytes a frequency.
"""
