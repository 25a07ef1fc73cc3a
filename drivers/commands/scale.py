"""The command `scale`: how the sweep grows with dofs and ranks."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from uplift.drivers import process
from uplift.drivers.commands.options import add_scene
from uplift.drivers.evidence.pages import page_path
from uplift.drivers.scene.shipped import REFERENCE
from uplift.meshes.checked import ModelError


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "scale", help="how the sweep grows with dofs and ranks",
        description="Measure the direct sweep on finer and finer meshes, on one rank and on two in both ways of sharing; write a page.",
    )
    add_scene(parser, default=REFERENCE)
    parser.add_argument("--out", type=Path, metavar="FILE.md",
                        help=f"default: {page_path('scaling.md')}, with --peers {page_path('scaling-peers.md')}")
    parser.add_argument("--peers", action="store_true",
                       help="measure the reduced run beside OpenSeesPy instead, which is installed into a virtual environment in the cache")
    parser.add_argument("--quick", action="store_true", help="small meshes only")
    parser.add_argument("--measure", nargs="+", help=argparse.SUPPRESS)  # what a process of its own measures, for `evidence.scaling`
    parser.set_defaults(command=command, quiet=True, evidence="scaling")


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    from uplift.drivers.scene.scene import read_scene

    scene = read_scene(options.scene)
    if not options.measure:
        if process.launched():
            raise ModelError("scale", "starts its own ranks; run it without mpirun")
        from uplift.drivers.evidence.scaling.scaling import beside_opensees, scaling

        measuring = beside_opensees if options.peers else scaling
        out = options.out or page_path("scaling-peers.md" if options.peers else "scaling.md")
        measuring(options.scene, scene, out, quick=options.quick)
        return 0
    what, *arguments = options.measure
    process.choose_scalars("real" if what in ("reduced", "solver") else "complex")
    with process.parallel() as comm:
        import json

        from uplift.drivers.evidence.scaling.scaling import measured

        process.say(json.dumps(measured(scene, comm, what, *arguments)))
    return 0
