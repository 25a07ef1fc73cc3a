"""The command `verify`: rerun SDLS119 and compare the published values."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from uplift.drivers import process


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "verify", help="rerun SDLS119 and compare the published values",
        description="Run both variants of SDLS119 modelisation A, compare the eight published values; exit code 1 if one misses.",
    )
    parser.add_argument("--out", type=Path, default=Path("results/verify"), metavar="DIR", help="default: %(default)s")
    parser.add_argument("--no-plots", action="store_true", help="draw no pictures")
    parser.set_defaults(command=command, quiet=True)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    from uplift.drivers.results.folder import claimed_folder

    process.choose_scalars("complex")  # the sweep needs complex numbers, and time stepping does as well in them
    with (
        claimed_folder(options.out / "transient", overwrite=True),
        claimed_folder(options.out / "time-frequency", overwrite=True),
        process.parallel() as comm,
    ):
        from uplift.drivers.evidence.verify import verify

        return 0 if verify(comm, options.out, plots=not options.no_plots) else process.FAILED
