"""The command `benchmarks`: published benchmarks."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from uplift.drivers import process
from uplift.drivers.commands.options import add_page


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "benchmarks", help="published benchmarks of plates and shells",
        description="Run published benchmarks of plates and shells through scenes, static, modal, harmonic and transient, and write a page "
                    "of tables; exit code 1 if a value misses its limit.",
    )
    add_page(parser, "benchmarks", "benchmarks.md")
    parser.add_argument("--quick", action="store_true", help="the smaller meshes only, where a case has several")
    parser.add_argument("--meshes", type=Path, metavar="FOLDER", help="keep the mesh files there, and read those that are there already")
    parser.set_defaults(command=command, quiet=True)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    process.choose_scalars("complex")  # steady vibration needs complex numbers, and the others do as well in them
    with process.parallel() as comm:
        from uplift.drivers.evidence.benchmarks.page import benchmarks

        return 0 if benchmarks(comm, options.out, quick=options.quick, meshes=options.meshes) else process.FAILED
