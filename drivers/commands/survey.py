"""The command `survey`: uplift case by case, by every method."""

from __future__ import annotations

import argparse
from typing import Any

from uplift.drivers import process
from uplift.drivers.commands.options import add_page, add_scene
from uplift.drivers.scene.shipped import REFERENCE


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "survey", help="uplift case by case, by every method",
        description="Vary the scene one parameter at a time, solve uplift exactly by two methods and by the published passes, and write a "
                    "page of tables; exit code 1 if the exact methods differ.",
    )
    add_scene(parser, default=REFERENCE)
    add_page(parser, "survey", "uplift.md")
    parser.add_argument("--quick", action="store_true", help="three cases only")
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    process.choose_scalars("complex")
    process.configure_log(quiet=True)  # hundreds of passes would each say what they changed
    with process.parallel() as comm:
        from uplift.drivers.evidence.survey.survey import survey

        return 0 if survey(comm, options.scene, options.out, quick=options.quick, quiet=options.quiet) else process.FAILED
