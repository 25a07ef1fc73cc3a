"""Error against run time: every method on meshes, steps, bands and basis sizes, beside references that state their own error."""

from __future__ import annotations

import pickle
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.evidence.pages import command_line
from uplift.drivers.evidence.pareto.cases import AS_PUBLISHED, MESH_STEP, Mesh, Run, foot, rectangle, reference_runs, runs
from uplift.drivers.evidence.pareto.errors import Reference, Trace, errors, extrapolated, extrapolated_twice
from uplift.drivers.evidence.pareto.orders import observed
from uplift.drivers.evidence.pareto.page import Study, page
from uplift.drivers.evidence.pareto.plot import draw
from uplift.drivers.evidence.pareto.runs import Outcome, assemble, check, run_all
from uplift.drivers.evidence.pareto.tables import tables
from uplift.drivers.evidence.peers import peers
from uplift.drivers.process import say
from uplift.drivers.results.folder import all_or_nothing, writable_folder
from uplift.drivers.scene.scene import Scene, read_scene
from uplift.meshes.checked import ModelError
from uplift.solvers.bases.modes import modes
from uplift.solvers.errors import SolverError


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    scene: Path
    out: Path
    """The page; the picture and the tables go beside it."""
    quick: bool
    peers: bool
    quiet: bool

    @property
    def command(self) -> str:
        """The command that this is."""
        return command_line("pareto", self.out, "pareto.md", *["--quick"] * self.quick, *["--peers"] * self.peers, scene=self.scene)


def pareto(comm: Any, options: Options) -> None:
    """Make all runs and write page, picture and tables."""
    begin = time.perf_counter()
    if comm.size > 1:
        raise ModelError("mpirun", "expected one rank: the study times single processes")
    if options.out.is_dir():
        raise ModelError("--out", f"{options.out} is a folder; expected the name of a file")
    scene = read_scene(options.scene)
    check(scene)
    writable_folder(options.out.absolute().parent)
    why_not = _no_spread(scene)
    table = runs(options.quick, spread_too=not why_not)
    progress: Callable[[str], None] = (lambda text: None) if options.quiet else say
    if why_not:
        progress(f"no spread supports: {why_not}")
    decay = _decay(scene, comm)
    outcomes, _ = _sweeps_in_child(options)
    for outcome in outcomes:
        progress(_line(scene, outcome))
    here, units = run_all(scene, [run for run in table if not run.by_sweep], comm, lambda outcome: progress(_line(scene, outcome)))
    outcomes += here
    traces = {o.run: o.trace for o in outcomes if o.trace is not None}
    references = {}
    for case in dict.fromkeys(run.case for run in table):
        traces |= _reference_traces(scene, case, options.quick, traces, comm, lambda outcome: progress(_line(scene, outcome)))
        references[case] = reference(case, options.quick, traces)
    scored = np.array([_scores(o, references[o.run.case]) for o in outcomes])
    orders = observed(outcomes, traces, decay)
    measured, remarks = _peers(scene, options, progress) if options.peers and not why_not else ([], [])
    study = Study(
        scene, outcomes, scored, units, references, orders, measured, remarks, why_not, options.command, options.out.stem,
        time.perf_counter() - begin,
    )
    with all_or_nothing(options.out.absolute().parent) as staging:
        draw(staging / f"{options.out.stem}.png", outcomes, references, scored, scene.model.probes[0].name)
        (staging / options.out.name).write_text(page(study), encoding="utf-8")
        for name, text in tables(study).items():
            (staging / name).write_text(text, encoding="utf-8")
    progress(f"page in {options.out}, {time.perf_counter() - begin:.0f} s")


def _no_spread(scene: Scene) -> str:
    try:
        foot(scene)
    except ModelError as error:
        return str(error)
    return ""


def _line(scene: Scene, outcome: Outcome) -> str:
    run = outcome.run
    ended = f" ({outcome.ended})" if outcome.ended else ""
    return f"{run.case}, {run.mesh.name(scene)}, {run.method}, {run.setting}: {outcome.total:.3f} s{ended}"


def _scores(outcome: Outcome, against: Reference) -> np.ndarray:
    return np.full(3, np.nan) if outcome.trace is None else errors(outcome.trace, against.trace)


def _reference_traces(
    scene: Scene, case: str, quick: bool, known: Mapping[Run, Trace], comm: Any, progress: Callable[[Outcome], None]
) -> dict[Run, Trace]:
    """Return the traces of a reference's runs, made where they are not known."""
    wanted = dict.fromkeys(run for group in reference_runs(case, quick) for run in group)
    made, _ = run_all(scene, [run for run in wanted if run not in known], comm, progress)
    return {run: known[run] for run in wanted if run in known} | {o.run: o.trace for o in made if o.trace is not None}


def reference(case: str, quick: bool, traces: Mapping[Run, Trace]) -> Reference:
    """Extrapolate the reference of a case from its runs."""
    in_step, in_mesh, coarser = ([traces[run] for run in group] for group in reference_runs(case, quick))
    step_runs, mesh_runs, _ = reference_runs(case, quick)
    finest = f"Newmark, steps {step_runs[0].step:g}, {step_runs[1].step:g} and {step_runs[2].step:g} s"
    if not in_mesh:
        return extrapolated(in_step, finest)
    factors = [str(run.mesh.factor) for run in mesh_runs]
    on_cells = f"on biquadratic cells {step_runs[0].mesh.factor} times finer"
    words = f"{finest} {on_cells}; cells {', '.join(factors)} times finer, step {mesh_runs[0].step:g} s"
    return extrapolated_twice(in_step, in_mesh, coarser, words)


def _decay(scene: Scene, comm: Any) -> float:
    """Return the rate zeta omega in 1/s at which the first mode of the case as published decays, every contact bonded."""
    with assemble(scene, AS_PUBLISHED, Mesh(), comm) as model:
        first = modes(model.operators, number=1)
    return float(first.damping[0] * first.omega[0])


def _sweeps_in_child(options: Options) -> tuple[list[Outcome], dict[tuple[str, Mesh], float]]:
    """Make the runs that need complex PETSc in a process that has it."""
    with tempfile.TemporaryDirectory(prefix="uplift-pareto-") as folder:
        into = Path(folder) / "sweeps"
        command = [sys.executable, "-m", "drivers", "pareto", str(options.scene), "--into", str(into)]
        command += ["--quick"] * options.quick
        done = subprocess.run(command, stderr=subprocess.PIPE, text=True)
        if done.returncode:
            raise SolverError(f"the process of the sweeps failed: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
        found: tuple[list[Outcome], dict[tuple[str, Mesh], float]] = pickle.loads(into.read_bytes())
        return found


def sweeps(comm: Any, path: Path, into: Path, *, quick: bool) -> None:
    """Make the runs that need complex PETSc and pickle them into a file: the child's part."""
    scene = read_scene(path)
    table = runs(quick, spread_too=not _no_spread(scene))
    into.write_bytes(pickle.dumps(run_all(scene, [run for run in table if run.by_sweep], comm)))


def peer_mesh(comm: Any, path: Path, into: Path, factor: int) -> None:
    """Measure this project's Newmark run on one mesh of the peers and pickle it into a file: the child's part."""
    into.write_bytes(pickle.dumps(peers.measure_own(peers.without_joint_mass(read_scene(path)), Mesh(factor), comm)))


def _peers(scene: Scene, options: Options, progress: Callable[[str], None]) -> tuple[list[peers.Measured], list[str]]:
    """Run the peers beside this project; remarks say what is left out and why."""
    odd = peers.misfit(scene)
    if odd:
        return [], [f"The peers are left out: the scene has {odd}."]
    python, version = peers.opensees()
    remarks = [f"OpenSeesPy {version}." if python else f"OpenSeesPy could not be installed: {version}"]
    assert scene.transient is not None
    steps = round(scene.transient.duration / MESH_STEP)
    measured: list[peers.Measured] = []
    for factor in (1, 4) if options.quick else (1, 4, 16, 32):
        mesh = Mesh(factor)
        few = steps if _dofs(scene, mesh) <= peers.FULL else min(steps, peers.PART)
        attempts: dict[str, Callable[[], peers.Measured]] = {
            peers.OWN: partial(peers.run_own, options.scene, mesh),
            peers.SCIPY: partial(peers.run_peer, peers.SCIPY, sys.executable, scene, mesh, steps, steps),
        }
        if python:
            attempts[peers.OPENSEES] = partial(peers.run_peer, peers.OPENSEES, python, scene, mesh, steps, few)
        for name, attempt in attempts.items():
            try:
                measured.append(attempt())
                progress(f"peers: {name}, {measured[-1].dofs} dofs: {measured[-1].preparation + measured[-1].march:.2f} s")
            except subprocess.CalledProcessError as error:
                last = (error.stderr or "").strip().splitlines()
                remarks.append(f"{name} failed on {mesh.name(scene)}: {last[-1] if last else 'no message'}")
    return measured, remarks


def _dofs(scene: Scene, mesh: Mesh) -> int:
    plate = rectangle(scene)
    return 2 * (plate.nx * mesh.factor + 1) * (plate.ny * mesh.factor + 1)

