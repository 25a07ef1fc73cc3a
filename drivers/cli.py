"""The command line."""

from __future__ import annotations

import argparse
import logging
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from drivers import runtime
from drivers.request import IN_A_BASIS, Request
from drivers.scene import METHODS
from drivers.scene_commands import add_scene_commands
from meshes.checked import ModelError
from solvers.errors import SolverError, Stopped

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.analysis import Plant
    from drivers.scene import Scene
    from solvers.passes import Passes

log = logging.getLogger(__name__)

BAD_INPUT, FAILED = 2, 1

REFERENCE = Path(__file__).parent / "scenes" / "sdls119a.toml"

MANY = 500
"""Published passes at most, where only a tolerance is given."""


def main(arguments: list[str]) -> int:
    """Run one command; return the exit code: 0 done, 1 failed, 2 bad input, 130 interrupted, 143 terminated."""
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
    except Stopped as stopped:
        _complain(f"{options.scene}: {stopped}")
        return 128 + stopped.number
    except ImportError as error:
        if not error.path or "libffcx" not in error.path:
            raise
        _complain(f"the form cache is broken: {error}; remove {Path(error.path).parent}, which is made again")
        return FAILED
    except TimeoutError as error:
        if "JIT" not in str(error):
            raise
        _complain("another program compiles the same forms, or was killed while it did; run again in a minute")
        return FAILED
    except KeyboardInterrupt:
        _complain("interrupted; nothing was written")
        return 130
    except OSError as error:
        if error.errno is None:
            raise
        _complain(f"{error.filename or getattr(options, 'out', '')}: {error.strerror}; nothing was written there")
        return FAILED


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
    run.add_argument("--basis", type=_basis, metavar="TOL",
                     help="run in a Krylov basis grown to the relative residual TOL instead of in all dofs; 'none' overrules the scene "
                          "(default: what its section [basis] says, else all dofs)")
    run.add_argument("--basis-file", type=Path, metavar="FILE",
                     help="with --basis: read the basis from this HDF5 file, or write it there if it is not there yet")
    run.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: results/SCENE/METHOD)")
    run.add_argument("--solver", choices=("direct", "iterative"), default="direct",
                     help="how a transient run solves its systems: by a factor, or by conjugate gradients where a factor does not fit "
                          "(default: %(default)s)")
    run.add_argument("--groups", type=int, metavar="N",
                     help="split the ranks into N groups that share the frequencies of a sweep (default: chosen from sizes and memory)")
    run.add_argument("--checkpoint", type=_seconds, default=60.0, metavar="SECONDS",
                     help="seconds of work between two checkpoints in DIR/checkpoint, 0: none (default: %(default)g)")
    run.add_argument("--resume", action="store_true", help="go on from the checkpoint in DIR/checkpoint")
    run.add_argument("--memory", type=_gibibytes, metavar="GiB",
                     help="memory that the run may take on each machine (default: what is available); one that will need more is refused")
    run.add_argument("--overwrite", action="store_true", help="write over the results that the folder holds")
    run.add_argument("--no-plots", action="store_true", help="draw no pictures")
    run.add_argument("--quiet", action="store_true", help="print errors only")
    run.set_defaults(command=_run)

    add_scene_commands(commands)

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
    modes.add_argument("--overwrite", action="store_true", help="write over the results that the folder holds")
    modes.add_argument("--no-plots", action="store_true", help="draw no pictures")
    modes.add_argument("--quiet", action="store_true", help="print errors only")
    modes.set_defaults(command=_modes)

    truncation = commands.add_parser(
        "truncation", help="error against the number of modes",
        description="Compare modal runs on 5 modes to all, with and without static correction, with the run in all dofs.",
    )
    truncation.add_argument("scene", type=Path, metavar="SCENE.toml", help="the scene file")
    truncation.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: results/SCENE/truncation)")
    truncation.add_argument("--overwrite", action="store_true", help="write over the results that the folder holds")
    truncation.add_argument("--no-plots", action="store_true", help="draw no pictures")
    truncation.add_argument("--quiet", action="store_true", help="print errors only")
    truncation.set_defaults(command=_truncation)
    report = commands.add_parser(
        "report", help="make the report of a run again",
        description="Make the page of a run from its results file alone, in place of the page beside the results or as another file.",
    )
    report.add_argument("results", type=Path, metavar="RESULTS", help="a results file, or the folder of a run")
    report.add_argument("--out", type=Path, metavar="FILE.html",
                        help="default: report.html beside the results, whose older page is replaced; no other file is, if it is there")
    report.add_argument("--overwrite", action="store_true", help="write over FILE.html, whatever it is")
    report.add_argument("--damping", type=_percent, nargs="+", metavar="PERCENT", help="damping of the floor spectra (default: 2 5 10)")
    report.set_defaults(command=_report)

    compare = commands.add_parser(
        "compare", help="compare two runs",
        description="Tabulate the differences of two runs, B against A, and write a page with both over each other, into a folder that "
                    "holds no other comparison.",
    )
    compare.add_argument("first", type=Path, metavar="A", help="a results file, or the folder of a run")
    compare.add_argument("second", type=Path, metavar="B", help="another one")
    compare.add_argument("--out", type=Path, default=Path("results/compare"), metavar="DIR", help="default: %(default)s")
    compare.add_argument("--tolerance", type=_positive, metavar="TOL",
                         help="exit code 1 if a probe's displacement differs by more, relative to its largest value")
    compare.add_argument("--overwrite", action="store_true", help="write over the comparison that the folder holds")
    compare.add_argument("--no-plots", action="store_true", help="draw no picture")
    compare.set_defaults(command=_compare)

    study = commands.add_parser(
        "study", help="a scene with values varied, in one basis",
        description="Run a scene with exact uplift for every combination of varied values, in a Krylov basis that is made once, and write "
                    "a table and a picture of the extremes. Signals, gravity, gaps, preloads and time steps cost seconds a case; what "
                    "changes stiffness, mass or contacts costs a basis for each case.",
    )
    study.add_argument("scene", type=Path, metavar="SCENE.toml", help="the scene file")
    study.add_argument("--vary", action="append", required=True, metavar="KEY=FIRST:LAST:NUMBER",
                       help="a value of the scene by its path, as load.amplitude=0.5:8:16 or supports.RESS.gap=0,0.001; may be repeated")
    study.add_argument("--basis", type=_positive, default=1e-6, metavar="TOL", help="tolerance of the basis (default: %(default)s)")
    study.add_argument("--basis-file", type=Path, metavar="FILE",
                       help="read the basis from this HDF5 file, or write it there if it is not there yet")
    study.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: results/SCENE/study)")
    study.add_argument("--overwrite", action="store_true", help="write over the results that the folder holds")
    study.add_argument("--no-plots", action="store_true", help="draw no picture")
    study.add_argument("--quiet", action="store_true", help="print errors only")
    study.set_defaults(command=_vary)
    cost = commands.add_parser(
        "cost", help="what exact uplift costs beside a linear run",
        description="Measure exact uplift against linear runs, bare solves and sweeps on finer and finer meshes; write a page.",
    )
    cost.add_argument("scene", type=Path, nargs="?", default=REFERENCE, metavar="SCENE.toml", help="default: sdls119a.toml")
    cost.add_argument("--out", type=Path, default=Path("docs/cost.md"), metavar="FILE", help="default: %(default)s")
    cost.add_argument("--quick", action="store_true", help="small meshes only")
    cost.add_argument("--sweeps-only", action="store_true", help=argparse.SUPPRESS)
    cost.set_defaults(command=_cost, quiet=True)
    scale = commands.add_parser(
        "scale", help="how the sweep grows with dofs and ranks",
        description="Measure the direct sweep on finer and finer meshes, on one rank and on two in both ways of sharing; write a page.",
    )
    scale.add_argument("scene", type=Path, nargs="?", default=REFERENCE, metavar="SCENE.toml", help="default: sdls119a.toml")
    scale.add_argument("--out", type=Path, metavar="FILE.md", help="default: docs/scaling.md, with --peers docs/scaling-peers.md")
    scale.add_argument("--peers", action="store_true",
                       help="measure the reduced run beside OpenSeesPy instead, which is installed into a virtual environment in the cache")
    scale.add_argument("--quick", action="store_true", help="small meshes only")
    scale.add_argument("--measure", nargs="+", help=argparse.SUPPRESS)  # what a process of its own measures, for `drivers.scaling`
    scale.set_defaults(command=_scale, quiet=True)
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
    stability = commands.add_parser(
        "stability", help="stiff, extreme and ill-posed cases against independent oracles",
        description="Drive the reference case to extremes, compare each run with an oracle that does not come from the solvers, and write "
                    "a page and a CSV file beside it; exit code 1 if a case fails.",
    )
    stability.add_argument("--out", type=Path, default=Path("docs/stability.md"), metavar="FILE.md", help="default: %(default)s")
    stability.add_argument("--quick", action="store_true", help="a dozen cases only")
    stability.add_argument("--quiet", action="store_true", help="print errors only")
    stability.set_defaults(command=_stability)
    benchmarks = commands.add_parser(
        "benchmarks", help="published benchmarks of plates and shells",
        description="Run published benchmarks of plates and shells through scenes, static, modal, harmonic and transient, and write a page "
                    "of tables; exit code 1 if a value misses its limit.",
    )
    benchmarks.add_argument("--out", type=Path, default=Path("docs/benchmarks.md"), metavar="FILE.md", help="default: %(default)s")
    benchmarks.add_argument("--quick", action="store_true", help="the smaller meshes only, where a case has several")
    benchmarks.set_defaults(command=_benchmarks, quiet=True)
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


def _percent(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not 0 <= number < 100:
        raise argparse.ArgumentTypeError(f"expected a number of percent from 0 to below 100, got {text!r}")
    return number / 100


def _positive(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number < 1:
        raise argparse.ArgumentTypeError(f"expected a number between 0 and 1, got {text!r}")
    return number


def _basis(text: str) -> float:
    """Return the tolerance, 0 for no basis."""
    return 0.0 if text == "none" else _positive(text)


def _seconds(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not 0 <= number < float("inf"):
        raise argparse.ArgumentTypeError(f"expected seconds >= 0, got {text!r}")
    return number


def _gibibytes(text: str) -> float:
    """Return bytes."""
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not number > 0:
        raise argparse.ArgumentTypeError(f"expected GiB > 0, got {text!r}")
    return 2**30 * number


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


def _run(options: argparse.Namespace, begin: float) -> int:
    from drivers.longrun import Signals, identity, watched
    from drivers.memory import check_memory, memory_facts
    from drivers.output import claimed_folder
    from drivers.scene import read_scene
    from drivers.scene_warnings import scene_warnings

    scene = read_scene(options.scene)
    text = options.scene.read_text(encoding="utf-8")
    request = _request(options, scene)
    if options.groups is not None and request.method != "time-frequency":
        raise ModelError("--groups", f"shares the points of a sweep, and the method {request.method} has none")
    if options.solver == "iterative" and request.method != "transient":
        raise ModelError("--solver", f"iterative belongs to the method transient; {request.method} needs a factor")
    runtime.choose_scalars(request.scalars)
    out = options.out or Path("results") / options.scene.stem / request.method
    overwrite = options.overwrite or options.resume
    with claimed_folder(out, overwrite=overwrite), Signals() as signals, runtime.parallel() as comm:
        from drivers.analysis import prepare
        from drivers.film import Film
        from drivers.methods import analyse
        from drivers.report import printed_values, write_run

        for words in scene_warnings(scene, request.method):
            log.warning(words)
        start_up = time.perf_counter() - begin
        run = identity(scene, options.scene.parent, request, options.solver)
        need = check_memory(scene, request, comm, groups=options.groups, limit=options.memory)
        with prepare(scene, comm) as plant:
            plant.clock.add("start-up", start_up)
            if request.method == "harmonic":
                return _respond(plant, out, options)
            with watched(
                plant, run, out / "checkpoint", signals, seconds=options.checkpoint, resume=options.resume, quiet=options.quiet
            ) as watch:
                film = Film(plant)
                iterative = options.solver == "iterative"
                analysis = analyse(plant, request, film, groups=options.groups, watch=watch, iterative=iterative)
                analysis.notes["memory_MiB"] = memory_facts(need, comm)
                write_run(plant, analysis, out, plots=not options.no_plots, film=film, scene_text=text)
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


def _report(options: argparse.Namespace, begin: float) -> int:
    from drivers.output import all_or_nothing, replaceable_file
    from drivers.report_html import NAME, write_report
    from drivers.results_file import find_results, read_results

    results = read_results(options.results)
    if options.damping:
        results = results.with_spectra(tuple(options.damping))
    usual = find_results(options.results).with_name(NAME)
    out = options.out or usual
    replaceable_file(out, overwrite=options.overwrite or out.absolute() == usual.absolute())
    with all_or_nothing(out.absolute().parent) as staging:
        write_report(staging / out.name, results)
    runtime.say(str(out))
    return 0


def _compare(options: argparse.Namespace, begin: float) -> int:
    from drivers.compare import PAGE, compare, write_comparison
    from drivers.output import claimed_folder
    from drivers.results_file import read_results

    comparison = compare(read_results(options.first), read_results(options.second), (str(options.first), str(options.second)))
    with claimed_folder(options.out, overwrite=options.overwrite, mark=PAGE, held="another comparison"):
        write_comparison(options.out, comparison, plots=not options.no_plots)
    runtime.say("\n".join(comparison.lines()) + f"\nfiles in {options.out}")
    return FAILED if options.tolerance is not None and comparison.worst() > options.tolerance else 0


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
    from drivers.output import claimed_folder

    runtime.choose_scalars("complex")  # the sweep needs complex numbers, and time stepping does as well in them
    with (
        claimed_folder(options.out / "transient", overwrite=True),
        claimed_folder(options.out / "time-frequency", overwrite=True),
        runtime.parallel() as comm,
    ):
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


def _scale(options: argparse.Namespace, begin: float) -> int:
    from drivers.scene import read_scene

    scene = read_scene(options.scene)
    if not options.measure:
        if runtime.launched():
            raise ModelError("scale", "starts its own ranks; run it without mpirun")
        from drivers.scaling import beside_opensees, scaling

        measuring = beside_opensees if options.peers else scaling
        out = options.out or Path("docs") / ("scaling-peers.md" if options.peers else "scaling.md")
        measuring(options.scene, scene, out, quick=options.quick)
        return 0
    what, *arguments = options.measure
    runtime.choose_scalars("real" if what in ("reduced", "solver") else "complex")
    with runtime.parallel() as comm:
        import json

        from drivers.scaling import measured

        runtime.say(json.dumps(measured(scene, comm, what, *arguments)))
    return 0


def _vary(options: argparse.Namespace, begin: float) -> int:
    from drivers.output import claimed_folder
    from drivers.scene import read_scene

    scene = read_scene(options.scene)
    runtime.choose_scalars("real")
    out = options.out or Path("results") / options.scene.stem / "study"
    with claimed_folder(out, overwrite=options.overwrite), runtime.parallel() as comm:
        from drivers.study import run_study, table_lines, variation, write_study

        variations = [variation(text) for text in options.vary]
        columns, rows, facts = run_study(scene, options.scene.parent, variations, options.basis, options.basis_file, comm)
        if comm.rank == 0:
            write_study(out, columns, rows, facts, len(variations), scene.title, draw=not options.no_plots)
        if not options.quiet:
            runtime.say("\n".join(table_lines(columns, rows)))
            runtime.say(f"{facts['cases']} cases on {len(facts['bases'])} bases in {facts['seconds']:.1f} s\nfiles in {out}")
        return FAILED if facts["failed"] else 0


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


def _stability(options: argparse.Namespace, begin: float) -> int:
    runtime.choose_scalars("complex")
    runtime.configure_log(quiet=True)
    with runtime.parallel() as comm:
        from drivers.stability import stability

        return 0 if stability(comm, REFERENCE, options.out, quick=options.quick, quiet=options.quiet) else FAILED


def _benchmarks(options: argparse.Namespace, begin: float) -> int:
    runtime.choose_scalars("complex")  # steady vibration needs complex numbers, and the others do as well in them
    with runtime.parallel() as comm:
        from drivers.benchmarks import benchmarks

        return 0 if benchmarks(comm, options.out, quick=options.quick) else FAILED


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
    from drivers.output import claimed_folder
    from drivers.scene import read_scene

    scene = read_scene(options.scene)
    runtime.choose_scalars("real")
    out = options.out or Path("results") / options.scene.stem / name
    with claimed_folder(out, overwrite=options.overwrite), runtime.parallel() as comm:
        from drivers.analysis import prepare

        start_up = time.perf_counter() - begin
        with prepare(scene, comm) as plant:
            plant.clock.add("start-up", start_up)
            lines = study(plant, out)
            if not options.quiet:
                runtime.say("\n".join(lines))
                runtime.say(f"\nseconds: {plant.clock.line()}\nfiles in {out}")
    return 0
