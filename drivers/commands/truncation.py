"""The command `truncation`: error against the number of modes."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uplift.drivers.commands.on_scene import assembled
from uplift.drivers.commands.options import add_folder, add_scene

if TYPE_CHECKING:
    from uplift.drivers.analysis.assembled_scene import AssembledScene


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "truncation", help="error against the number of modes",
        description="Compare modal runs on 5 modes to all, with and without static correction, with the run in all dofs.",
    )
    add_scene(parser)
    add_folder(parser, "truncation")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    def work(assembly: AssembledScene, out: Path) -> list[str]:
        from uplift.drivers.studies.truncation import tabulate_truncation

        return tabulate_truncation(assembly, out, plots=not options.no_plots)

    return assembled(options, begin, "truncation", work)
