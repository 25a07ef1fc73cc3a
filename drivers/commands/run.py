"""The command `run`: analyse a scene and write its results."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uplift.drivers import process
from uplift.drivers.commands.options import add_scene, basis_tolerance, fraction, gibibytes, pass_count, seconds
from uplift.drivers.scene.analysis import METHODS
from uplift.drivers.scene.request import IN_A_BASIS, Request
from uplift.meshes.checked import ModelError
from uplift.meshes.findings import tell

if TYPE_CHECKING:
    from uplift.drivers.analysis.assembled_scene import AssembledScene
    from uplift.drivers.scene.scene import Scene
    from uplift.solvers.contact.published_passes import Passes

MANY = 500
"""Published passes at most, where only a tolerance is given."""


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser("run", help="analyse a scene", description="Analyse a scene and write its results into a folder.")
    add_scene(parser)
    parser.add_argument("--method", choices=METHODS, help="default: what the scene says, else transient")
    parser.add_argument("--iterations", type=pass_count, metavar="N",
                     help="published passes over the contact forces, for comparison with the source; 1 is the linear answer, every contact "
                          "bonded; 'exact' overrules the scene. Default: what the scene says, else uplift is solved exactly")
    parser.add_argument("--tolerance", type=fraction, metavar="TOL",
                     help=f"end the published passes when change and law are met to TOL; exit code 1 if N (default {MANY}) do not do")
    parser.add_argument("--basis", type=basis_tolerance, metavar="TOL",
                     help="run in a Krylov basis grown to the relative residual TOL instead of in all dofs; 'none' overrules the scene "
                          "(default: what its section [basis] says, else all dofs)")
    parser.add_argument("--basis-file", type=Path, metavar="FILE",
                     help="with --basis: read the basis from this HDF5 file, or write it there if it is not there yet")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: results/SCENE/METHOD)")
    parser.add_argument("--solver", choices=("direct", "iterative"), default="direct",
                     help="how a transient run solves its systems: by a factor, or by conjugate gradients where a factor does not fit "
                          "(default: %(default)s)")
    parser.add_argument("--groups", type=int, metavar="N",
                     help="split the ranks into N groups that share the frequencies of a sweep (default: chosen from sizes and memory)")
    parser.add_argument("--checkpoint", type=seconds, default=60.0, metavar="SECONDS",
                     help="seconds of work between two checkpoints in DIR/checkpoint, 0: none (default: %(default)g)")
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoint in DIR/checkpoint")
    parser.add_argument("--memory", type=gibibytes, metavar="GiB",
                     help="memory that the run may take on each machine (default: what is available); one that will need more is refused")
    parser.add_argument("--overwrite", action="store_true", help="write over the results that the folder holds")
    parser.add_argument("--strict", action="store_true", help="exit code 1 where a finding is grave; the files are written all the same")
    parser.add_argument("--no-plots", action="store_true", help="draw no pictures")
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    from uplift.drivers.analysis.long_runs import Signals, identity, watched
    from uplift.drivers.analysis.memory import check_memory, memory_facts
    from uplift.drivers.results.folder import claimed_folder
    from uplift.drivers.scene.cautions import scene_cautions
    from uplift.drivers.scene.scene import read_scene

    scene = read_scene(options.scene)
    text = options.scene.read_text(encoding="utf-8")
    request = _request(options, scene)
    if options.groups is not None and request.method != "time-frequency":
        raise ModelError("--groups", f"shares the points of a sweep, and the method {request.method} has none")
    if options.solver == "iterative" and request.method != "transient":
        raise ModelError("--solver", f"iterative belongs to the method transient; {request.method} needs a factor")
    process.choose_scalars(request.scalars)
    out = options.out or Path("results") / options.scene.stem / request.method
    overwrite = options.overwrite or options.resume
    with claimed_folder(out, overwrite=overwrite), Signals() as signals, process.parallel() as comm:
        from uplift.drivers.analysis.analyse import analyse
        from uplift.drivers.analysis.assembled_scene import prepare
        from uplift.drivers.analysis.snapshots import Snapshots
        from uplift.drivers.report.files import printed_values, write_run

        for found in scene_cautions(scene, request.method):
            tell(found)
        start_up = time.perf_counter() - begin
        run = identity(scene, options.scene.parent, request, options.solver)
        need = check_memory(scene, request, comm, groups=options.groups, limit=options.memory)
        with prepare(scene, comm) as assembly:
            assembly.clock.add("start-up", start_up)
            if request.method == "harmonic":
                _respond(assembly, out, options)
                return _strict_code(options, comm)
            with watched(
                assembly, run, out / "checkpoint", signals, seconds=options.checkpoint, resume=options.resume, quiet=options.quiet
            ) as watch:
                snapshots = Snapshots(assembly)
                iterative = options.solver == "iterative"
                analysis = analyse(assembly, request, snapshots, groups=options.groups, watch=watch, iterative=iterative)
                analysis.notes["memory_MiB"] = memory_facts(need, comm)
                write_run(assembly, analysis, out, plots=not options.no_plots, snapshots=snapshots, scene_text=text)
            if not options.quiet:
                for line in printed_values(assembly, analysis):
                    process.say(line)
                process.say(f"seconds: {assembly.clock.line()}\nfiles in {out}")
            if analysis.failed:
                process.complain(_failure(analysis.passes, options.scene))
                return process.FAILED
            return _strict_code(options, comm)


def _strict_code(options: argparse.Namespace, comm: Any) -> int:
    """Return the exit code that the findings ask for with --strict, and say why (collective)."""
    grave = comm.bcast([found.text for found in process.heard_findings() if found.severity == "grave"])
    if not (options.strict and grave):
        return 0
    process.complain(f"{options.scene}: {len(grave)} grave finding{'s' * (len(grave) > 1)}, and --strict is given: {grave[0]}")
    return process.FAILED


def _request(options: argparse.Namespace, scene: Scene) -> Request:
    passes = options.iterations if options.iterations is not None else scene.run.iterations
    if options.tolerance is not None and not passes:
        if options.iterations == 0:
            raise ModelError("--tolerance", "ends the published passes; exact uplift needs none")
        passes = MANY
    method, basis, file = options.method or scene.run.method, options.basis, options.basis_file
    if basis is None and scene.basis is not None and method in IN_A_BASIS:
        basis = scene.basis.tolerance
    if basis and file is None and scene.basis is not None and scene.basis.file:
        file = options.scene.parent / scene.basis.file
    request = Request(method, passes or None, options.tolerance, basis or None, file)
    request.check(scene)
    return request


def _respond(assembly: AssembledScene, out: Path, options: argparse.Namespace) -> None:
    from uplift.drivers.studies.harmonic_files import respond

    lines = respond(assembly, out, plots=not options.no_plots)
    if not options.quiet:
        process.say("\n".join([*lines, f"seconds: {assembly.clock.line()}", f"files in {out}"]))


def _failure(passes: Passes, scene: Path) -> str:
    change = f"{passes.change[-1]:.1e}" if passes.change else "unknown"
    if passes.ended == "diverged":
        what = f"the published passes diverge after pass {passes.number}"
    else:
        what = f"the published passes have not converged in {passes.number} passes"
    return (
        f"{scene}: {what} (change of the displacements {change}, tension left {passes.pull[-1]:.1e} of the largest compression); "
        "the files hold the last pass; leave out --iterations and --tolerance to have uplift solved exactly"
    )
