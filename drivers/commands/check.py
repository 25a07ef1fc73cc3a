"""The command `check`: read and check a scene."""

from __future__ import annotations

import argparse
from typing import Any

from uplift.drivers import process
from uplift.drivers.commands.options import add_scene
from uplift.drivers.scene.analysis import METHODS


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "check", help="read and check a scene",
        description="Read and check a scene: its mesh, dofs, supports, the methods that can run it, the memory they take, and what is "
                    "doubtful about it. Exit code 2 and one line if it cannot be run.",
    )
    add_scene(parser)
    parser.add_argument("--method", choices=METHODS, help="as for run; default: what the scene says, else transient")
    parser.add_argument("--no-mesh", action="store_true", help="neither mesh nor assemble; otherwise done where it is quick")
    parser.set_defaults(command=command, quiet=True)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    from uplift.drivers.scene.scene import read_scene

    scene = read_scene(options.scene)
    process.choose_scalars("real")
    with process.parallel() as comm:
        from uplift.drivers.analysis.check import check_scene

        process.say("\n".join(check_scene(scene, comm, mesh=not options.no_mesh, method=options.method or "")))
    return 0
