"""The command `pareto`: error against run time."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from uplift.drivers import process
from uplift.drivers.commands.options import add_page, add_scene
from uplift.drivers.scene.shipped import REFERENCE


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "pareto", help="error against run time, by every method",
        description="Run every method on meshes, steps, bands and basis sizes, on the scene's supports and on spread ones, compare with "
                    "refined references, and write a page, a picture and tables.",
    )
    add_scene(parser, default=REFERENCE)
    add_page(parser, "pareto", "pareto.md")
    parser.add_argument("--quick", action="store_true", help="fewer and smaller meshes, in three minutes")
    parser.add_argument("--peers", action="store_true",
                        help="measure OpenSeesPy too, installed on request into a virtual environment in the cache, and a scipy loop")
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    parser.add_argument("--into", type=Path, help=argparse.SUPPRESS)  # the parts that run in a process of their own
    parser.add_argument("--peer-mesh", type=int, help=argparse.SUPPRESS)
    parser.set_defaults(command=command)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    sweeping = options.into is not None and options.peer_mesh is None
    process.choose_scalars("complex" if sweeping else "real")
    process.configure_log(quiet=True)
    with process.parallel() as comm:
        from uplift.drivers.evidence.pareto import pareto

        if sweeping:
            pareto.sweeps(comm, options.scene, options.into, quick=options.quick)
        elif options.peer_mesh is not None:
            pareto.peer_mesh(comm, options.scene, options.into, options.peer_mesh)
        else:
            pareto.pareto(comm, pareto.Options(options.scene, options.out, options.quick, options.peers, options.quiet))
    return 0
