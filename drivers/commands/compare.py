"""The command `compare`: compare two runs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from uplift.drivers import process
from uplift.drivers.commands.options import fraction


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "compare", help="compare two runs",
        description="Tabulate the differences of two runs, B against A, and write a page with both over each other, into a folder that "
                    "holds no other comparison.",
    )
    parser.add_argument("first", type=Path, metavar="A", help="a results file, or the folder of a run")
    parser.add_argument("second", type=Path, metavar="B", help="another one")
    parser.add_argument("--out", type=Path, default=Path("results/compare"), metavar="DIR", help="default: %(default)s")
    parser.add_argument("--tolerance", type=fraction, metavar="TOL",
                         help="exit code 1 if a probe's displacement differs by more, relative to its largest value")
    parser.add_argument("--overwrite", action="store_true", help="write over the comparison that the folder holds")
    parser.add_argument("--no-plots", action="store_true", help="draw no picture")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    from uplift.drivers.results.folder import claimed_folder
    from uplift.drivers.results.hdf5 import read_results
    from uplift.drivers.studies.comparison import PAGE, compare, write_comparison

    comparison = compare(read_results(options.first), read_results(options.second), (str(options.first), str(options.second)))
    with claimed_folder(options.out, overwrite=options.overwrite, mark=PAGE, held="another comparison"):
        write_comparison(options.out, comparison, plots=not options.no_plots)
    process.say("\n".join(comparison.lines()) + f"\nfiles in {options.out}")
    return process.FAILED if options.tolerance is not None and comparison.worst() > options.tolerance else 0
