"""The command `platforms`: the quick pages of evidence on one release of the libraries beside those on others."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from uplift.drivers import process
from uplift.drivers.commands.options import add_page


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "platforms", help="the quick pages of evidence on several releases of the libraries",
        description="With --record: run verify, survey, benchmarks and stability on this machine into a folder. With such folders: compare "
                    "their tables number by number and write a page; exit code 1 if a number differs.",
    )
    parser.add_argument("folders", type=Path, nargs="*", metavar="FOLDER", help="recorded platforms, the first one being the reference")
    parser.add_argument("--record", type=Path, metavar="FOLDER", help="record this platform into a new folder")
    parser.add_argument("--meshes", type=Path, metavar="FOLDER",
                        help="with --record: mesh files of the benchmarks, kept there or read from there (default: meshes in the folder)")
    add_page(parser, "platforms", "platforms.md")
    parser.set_defaults(command=command, quiet=True)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    if options.record is not None:
        process.choose_scalars("complex")  # as the commands do that are run
        with process.parallel():
            from uplift.drivers.evidence.platforms.record import record

            return 0 if record(options.record, options.meshes or options.record / "meshes") else process.FAILED
    from uplift.drivers.evidence.platforms.page import platforms

    return 0 if platforms(options.folders, options.out) else process.FAILED
