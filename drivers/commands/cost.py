"""The command `cost`: what exact uplift costs beside a linear run."""

from __future__ import annotations

import argparse
from typing import Any

from uplift.drivers import process
from uplift.drivers.commands.options import add_page, add_scene
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.shipped import REFERENCE


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "cost", help="what exact uplift costs beside a linear run",
        description="Measure exact uplift against linear runs, bare solves and sweeps on finer and finer meshes; write a page.",
    )
    add_scene(parser, default=REFERENCE)
    add_page(parser, "scaling", "cost.md")
    parser.add_argument("--quick", action="store_true", help="small meshes only")
    parser.add_argument("--sweeps-only", action="store_true", help=argparse.SUPPRESS)
    parser.set_defaults(command=command, quiet=True)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    from uplift.drivers.scene.scene import read_scene

    scene = read_scene(options.scene)
    Request("transient").check(scene)
    process.choose_scalars("complex" if options.sweeps_only else "real")
    with process.parallel() as comm:
        from uplift.drivers.evidence.scaling import cost

        if options.sweeps_only:
            import json

            process.say(json.dumps(cost.sweeps(scene, comm, quick=options.quick)))
            return 0
        sweep = cost.sweep_in_child(options.scene, options.quick) if comm.size == 1 else ()
        cost.cost(scene, comm, options.out, quick=options.quick, sweep=sweep)
    return 0
