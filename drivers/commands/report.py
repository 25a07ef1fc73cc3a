"""The command `report`: make the report of a run again."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from uplift.drivers import process
from uplift.drivers.commands.options import percent


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "report", help="make the report of a run again",
        description="Make the page of a run from its results file alone, in place of the page beside the results or as another file.",
    )
    parser.add_argument("results", type=Path, metavar="RESULTS", help="a results file, or the folder of a run")
    parser.add_argument("--out", type=Path, metavar="FILE.html",
                        help="default: report.html beside the results, whose older page is replaced; no other file is, if it is there")
    parser.add_argument("--overwrite", action="store_true", help="write over FILE.html, whatever it is")
    parser.add_argument("--damping", type=percent, nargs="+", metavar="PERCENT", help="damping of the floor spectra (default: 2 5 10)")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    from uplift.drivers.report.page import NAME, write_report
    from uplift.drivers.results.folder import all_or_nothing, replaceable_file
    from uplift.drivers.results.hdf5 import damage_named, find_results, read_results

    results = read_results(options.results)
    if options.damping:
        with damage_named(options.results):
            results = results.with_spectra(tuple(options.damping))
    usual = find_results(options.results).with_name(NAME)
    out = options.out or usual
    replaceable_file(out, overwrite=options.overwrite or out.absolute() == usual.absolute())
    with all_or_nothing(out.absolute().parent) as staging, damage_named(options.results):
        write_report(staging / out.name, results)
    process.say(str(out))
    return 0
