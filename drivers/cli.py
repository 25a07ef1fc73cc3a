"""The command line."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from drivers import runtime
from drivers.request import Request
from drivers.scene import METHODS
from meshes.checked import ModelError
from solvers.errors import SolverError

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.analysis import Plant
    from drivers.scene import Scene
    from solvers.passes import Passes

BAD_INPUT, FAILED = 2, 1

REFERENCE = Path(__file__).parent / "scenes" / "sdls119a.toml"

MANY = 500
"""Published passes at most, where only a tolerance is given."""


def main(arguments: list[str]) -> int:
    """Run one command; return the exit code: 0 done, 1 failed, 2 bad input, 130 interrupted."""
    begin = time.perf_counter()
    options = _parser().parse_args(arguments)
    runtime.configure_log(quiet=getattr(options, "quiet", False))
    try:
        return int(options.command(options, begin))
    except ModelError as error:
        where = getattr(options, "scene", None)
        _complain(f"{where}: {error}" if where and not error.key.startswith("--") else str(error))
        return BAD_INPUT
    except SolverError as error:
        _complain(f"{getattr(options, 'scene', options.command.__name__)}: {error}")
        return FAILED
    except KeyboardInterrupt:
        _complain("interrupted; nothing was written")
        return 130


def _complain(text: str) -> None:
    if runtime.launch_rank() == 0:
        print(f"uplift: {text}", file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python3 -m drivers", description="Plates that stand on springs which push and cannot pull, under earthquakes."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="analyse a scene", description="Analyse a scene and write its results into a folder.")
    run.add_argument("scene", type=Path, metavar="SCENE.toml", help="the scene file")
    run.add_argument("--method", choices=METHODS, help="default: what the scene says, else transient")
    run.add_argument("--iterations", type=_passes, metavar="N",
                     help="published passes over the contact forces, for comparison with the source; 1 is the linear answer, every contact "
                          "bonded; 'exact' overrules the scene. Default: what the scene says, else uplift is solved exactly")
    run.add_argument("--tolerance", type=_positive, metavar="TOL",
                     help=f"end the published passes when change and law are met to TOL; exit code 1 if N (default {MANY}) do not do")
    run.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: results/SCENE/METHOD)")
    run.add_argument("--no-plots", action="store_true", help="draw no pictures")
    run.add_argument("--quiet", action="store_true", help="print errors only")
    run.set_defaults(command=_run)

    verify = commands.add_parser(
        "verify", help="rerun SDLS119 and compare the published values",
        description="Run both variants of SDLS119 modelisation A, compare the eight published values; exit code 1 if one misses.",
    )
    verify.add_argument("--out", type=Path, default=Path("results/verify"), metavar="DIR", help="default: %(default)s")
    verify.add_argument("--no-plots", action="store_true", help="draw no pictures")
    verify.set_defaults(command=_verify, quiet=True)

    mesh = commands.add_parser("mesh", help="write the mesh of a scene", description="Write the mesh of a scene with its named groups.")
    mesh.add_argument("scene", type=Path, metavar="SCENE.toml", help="the scene file")
    mesh.add_argument("--out", type=Path, required=True, metavar="FILE", help="ends in .msh, .vtu, .xdmf or .med")
    mesh.set_defaults(command=_mesh)

    modes = commands.add_parser(
        "modes", help="table, pictures and a ParaView file of the modes",
        description="Find the modes of a scene, every contact bonded, with their damping ratios and effective masses.",
    )
    modes.add_argument("scene", type=Path, metavar="SCENE.toml", help="the scene file")
    which = modes.add_mutually_exclusive_group()
    which.add_argument("--number", type=int, metavar="N", help="the N lowest modes (default: what the section [modal] says, else 20)")
    which.add_argument("--band", type=float, nargs=2, metavar=("LOW", "HIGH"), help="all modes between two frequencies in Hz")
    modes.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: results/SCENE/modes)")
    modes.add_argument("--no-plots", action="store_true", help="draw no pictures")
    modes.add_argument("--quiet", action="store_true", help="print errors only")
    modes.set_defaults(command=_modes)

    truncation = commands.add_parser(
        "truncation", help="error against the number of modes",
        description="Compare modal runs on 5 modes to all, with and without static correction, with the run in all dofs.",
    )
    truncation.add_argument("scene", type=Path, metavar="SCENE.toml", help="the scene file")
    truncation.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: results/SCENE/truncation)")
    truncation.add_argument("--no-plots", action="store_true", help="draw no pictures")
    truncation.add_argument("--quiet", action="store_true", help="print errors only")
    truncation.set_defaults(command=_truncation)
    cost = commands.add_parser(
        "cost", help="what exact uplift costs beside a linear run",
        description="Measure exact uplift against linear runs, bare solves and sweeps on finer and finer meshes; write a page.",
    )
    cost.add_argument("scene", type=Path, nargs="?", default=REFERENCE, metavar="SCENE.toml", help="default: sdls119a.toml")
    cost.add_argument("--out", type=Path, default=Path("docs/cost.md"), metavar="FILE", help="default: %(default)s")
    cost.add_argument("--quick", action="store_true", help="small meshes only")
    cost.add_argument("--sweeps-only", action="store_true", help=argparse.SUPPRESS)
    cost.set_defaults(command=_cost, quiet=True)
    pareto = commands.add_parser(
        "pareto", help="error against run time, by every method",
        description="Run every method on meshes, steps, bands and basis sizes, on the scene's supports and on spread ones, compare with "
                    "refined references, and write a page, a picture and tables.",
    )
    pareto.add_argument("scene", type=Path, nargs="?", default=REFERENCE, metavar="SCENE.toml", help="default: sdls119a.toml")
    pareto.add_argument("--out", type=Path, default=Path("docs/pareto.md"), metavar="FILE.md", help="default: %(default)s")
    pareto.add_argument("--quick", action="store_true", help="fewer and smaller meshes, in three minutes")
    pareto.add_argument("--peers", action="store_true",
                        help="measure OpenSeesPy too, installed on request into a virtual environment in the cache, and a scipy loop")
    pareto.add_argument("--quiet", action="store_true", help="print errors only")
    pareto.add_argument("--into", type=Path, help=argparse.SUPPRESS)  # the parts that run in a process of their own
    pareto.add_argument("--peer-mesh", type=int, help=argparse.SUPPRESS)
    pareto.set_defaults(command=_pareto)
    survey = commands.add_parser(
        "survey", help="uplift case by case, by every method",
        description="Vary the scene one parameter at a time, solve uplift exactly by two methods and by the published passes, and write a "
                    "page of tables; exit code 1 if the exact methods differ.",
    )
    survey.add_argument("scene", type=Path, nargs="?", default=REFERENCE, metavar="SCENE.toml", help="default: sdls119a.toml")
    survey.add_argument("--out", type=Path, default=Path("docs/uplift.md"), metavar="FILE.md", help="default: %(default)s")
    survey.add_argument("--quick", action="store_true", help="three cases only")
    survey.add_argument("--quiet", action="store_true", help="print errors only")
    survey.set_defaults(command=_survey)
    return parser


def _passes(text: str) -> int:
    """Return the number of passes, 0 for exact uplift."""
    if text == "exact":
        return 0
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number >= 1 or 'exact', got {text!r}")
    return number


def _positive(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number < 1:
        raise argparse.ArgumentTypeError(f"expected a number between 0 and 1, got {text!r}")
    return number


def _request(options: argparse.Namespace, scene: Scene) -> Request:
    passes = options.iterations if options.iterations is not None else scene.run.iterations
    if options.tolerance is not None and not passes:
        if options.iterations == 0:
            raise ModelError("--tolerance", "ends the published passes; exact uplift needs none")
        passes = MANY
    request = Request(options.method or scene.run.method, passes or None, options.tolerance)
    request.check(scene)
    return request


def _run(options: argparse.Namespace, begin: float) -> int:
    from drivers.output import writable_folder
    from drivers.scene import read_scene

    scene = read_scene(options.scene)
    request = _request(options, scene)
    runtime.choose_scalars(request.scalars)
    out = options.out or Path("results") / options.scene.stem / request.method
    if runtime.launch_rank() == 0:
        writable_folder(out)
    with runtime.parallel() as comm:
        from drivers.analysis import prepare
        from drivers.methods import analyse
        from drivers.report import printed_values, write_run

        start_up = time.perf_counter() - begin
        with prepare(scene, comm) as plant:
            plant.clock.add("start-up", start_up)
            if request.method == "harmonic":
                return _respond(plant, out, options)
            analysis = analyse(plant, request)
            write_run(plant, analysis, out, plots=not options.no_plots)
            if not options.quiet:
                for line in printed_values(plant, analysis):
                    runtime.say(line)
                runtime.say(f"seconds: {plant.clock.line()}\nfiles in {out}")
            if analysis.failed:
                _complain(_failure(analysis.passes, options.scene))
                return FAILED
    return 0


def _respond(plant: Plant, out: Path, options: argparse.Namespace) -> int:
    from drivers.harmonic import respond

    lines = respond(plant, out, plots=not options.no_plots)
    if not options.quiet:
        runtime.say("\n".join([*lines, f"seconds: {plant.clock.line()}", f"files in {out}"]))
    return 0


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


def _verify(options: argparse.Namespace, begin: float) -> int:
    from drivers.output import writable_folder

    runtime.choose_scalars("complex")  # the sweep needs complex numbers, and time stepping does as well in them
    if runtime.launch_rank() == 0:
        for method in ("transient", "time-frequency"):
            writable_folder(options.out / method)
    with runtime.parallel() as comm:
        from drivers.verify import verify

        return 0 if verify(comm, options.out, plots=not options.no_plots) else FAILED


def _cost(options: argparse.Namespace, begin: float) -> int:
    from drivers.scene import read_scene

    scene = read_scene(options.scene)
    Request("transient").check(scene)
    runtime.choose_scalars("complex" if options.sweeps_only else "real")
    with runtime.parallel() as comm:
        from drivers import cost

        if options.sweeps_only:
            import json

            runtime.say(json.dumps(cost.sweeps(scene, comm, quick=options.quick)))
            return 0
        sweep = cost.sweep_in_child(options.scene, options.quick) if comm.size == 1 else ()
        cost.cost(scene, comm, options.out, quick=options.quick, sweep=sweep)
    return 0


def _pareto(options: argparse.Namespace, begin: float) -> int:
    sweeping = options.into is not None and options.peer_mesh is None
    runtime.choose_scalars("complex" if sweeping else "real")
    runtime.configure_log(quiet=True)
    with runtime.parallel() as comm:
        from drivers import pareto

        if sweeping:
            pareto.sweeps(comm, options.scene, options.into, quick=options.quick)
        elif options.peer_mesh is not None:
            pareto.peer_mesh(comm, options.scene, options.into, options.peer_mesh)
        else:
            pareto.pareto(comm, pareto.Options(options.scene, options.out, options.quick, options.peers, options.quiet))
    return 0


def _survey(options: argparse.Namespace, begin: float) -> int:
    runtime.choose_scalars("complex")
    runtime.configure_log(quiet=True)  # hundreds of passes would each say what they changed
    with runtime.parallel() as comm:
        from drivers.survey import survey

        return 0 if survey(comm, options.scene, options.out, quick=options.quick, quiet=options.quiet) else FAILED


def _mesh(options: argparse.Namespace, begin: float) -> int:
    from drivers.output import writable_folder
    from drivers.scene import read_scene
    from meshes.export import write_mesh

    scene = read_scene(options.scene)
    writable_folder(options.out.absolute().parent)
    cells = write_mesh(scene.plate, options.out)
    runtime.say(f"{options.out}: {cells} cells")
    return 0


def _modes(options: argparse.Namespace, begin: float) -> int:
    def study(plant: Plant, out: Path) -> list[str]:
        from drivers.modes import tabulate_modes, wanted_modes

        wanted = wanted_modes(plant.scene, options.number, options.band)
        return tabulate_modes(plant, wanted, out, plots=not options.no_plots)

    return _study(options, begin, "modes", study)


def _truncation(options: argparse.Namespace, begin: float) -> int:
    def study(plant: Plant, out: Path) -> list[str]:
        from drivers.truncation import tabulate_truncation

        return tabulate_truncation(plant, out, plots=not options.no_plots)

    return _study(options, begin, "truncation", study)


def _study(options: argparse.Namespace, begin: float, name: str, study: Callable[[Plant, Path], list[str]]) -> int:
    """Assemble the scene, let `study` write its files into a folder, and print the lines that it returns."""
    from drivers.output import writable_folder
    from drivers.scene import read_scene

    scene = read_scene(options.scene)
    runtime.choose_scalars("real")
    out = options.out or Path("results") / options.scene.stem / name
    if runtime.launch_rank() == 0:
        writable_folder(out)
    with runtime.parallel() as comm:
        from drivers.analysis import prepare

        start_up = time.perf_counter() - begin
        with prepare(scene, comm) as plant:
            plant.clock.add("start-up", start_up)
            lines = study(plant, out)
            if not options.quiet:
                runtime.say("\n".join(lines))
                runtime.say(f"\nseconds: {plant.clock.line()}\nfiles in {out}")
    return 0
