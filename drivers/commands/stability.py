"""The command `stability`: extreme cases against independent oracles."""

from __future__ import annotations

import argparse
from typing import Any

from uplift.drivers import process
from uplift.drivers.commands.options import add_page
from uplift.drivers.scene.shipped import REFERENCE


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "stability", help="stiff, extreme and ill-posed cases against independent oracles",
        description="Drive the reference case to extremes, compare each run with an oracle that does not come from the solvers, and write "
                    "a page and a CSV file beside it; exit code 1 if a case fails.",
    )
    add_page(parser, "stability", "stability.md")
    parser.add_argument("--quick", action="store_true", help="a dozen cases only")
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    process.choose_scalars("complex")
    process.configure_log(quiet=True)
    with process.parallel() as comm:
        from uplift.drivers.evidence.stability.table import stability

        return 0 if stability(comm, REFERENCE, options.out, quick=options.quick, quiet=options.quiet) else process.FAILED
