"""The command line."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from drivers import runtime
from meshes.checked import ModelError

METHODS = ("transient", "time-frequency")
BAD_INPUT, FAILED = 2, 1


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
    run.add_argument("--method", choices=METHODS, default="transient", help="default: %(default)s")
    run.add_argument("--iterations", type=_at_least_one, default=2, metavar="N",
                     help="passes over the contact forces; 1 is the linear answer, every contact bonded (default: %(default)s)")
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
    return parser


def _at_least_one(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"expected at least 1, got {number}")
    return number


def _run(options: argparse.Namespace, begin: float) -> int:
    from drivers.output import writable_folder
    from drivers.scene import read_scene, required_section

    scene = read_scene(options.scene)
    required_section(scene, options.method)
    runtime.choose_scalars("complex" if options.method == "time-frequency" else "real")
    out = options.out or Path("results") / options.scene.stem / options.method
    if runtime.launch_rank() == 0:
        writable_folder(out)
    with runtime.parallel() as comm:
        from drivers.analysis import analyse, prepare
        from drivers.report import write_run

        start_up = time.perf_counter() - begin
        with prepare(scene, comm) as plant:
            plant.clock.add("start-up", start_up)
            analysis = analyse(plant, options.method, options.iterations)
            write_run(plant, analysis, out, plots=not options.no_plots)
            if not options.quiet:
                runtime.say(f"seconds: {plant.clock.line()}\nfiles in {out}")
    return 0


def _verify(options: argparse.Namespace, begin: float) -> int:
    from drivers.output import writable_folder

    runtime.choose_scalars("complex")  # the sweep needs complex numbers, and time stepping does as well in them
    if runtime.launch_rank() == 0:
        for method in METHODS:
            writable_folder(options.out / method)
    with runtime.parallel() as comm:
        from drivers.verify import verify

        return 0 if verify(comm, options.out, plots=not options.no_plots) else FAILED


def _mesh(options: argparse.Namespace, begin: float) -> int:
    from drivers.output import writable_folder
    from drivers.scene import read_scene
    from meshes.export import write_mesh

    scene = read_scene(options.scene)
    writable_folder(options.out.absolute().parent)
    write_mesh(scene.plate, options.out)
    runtime.say(f"{options.out}: {scene.plate.nx} x {scene.plate.ny} cells")
    return 0
