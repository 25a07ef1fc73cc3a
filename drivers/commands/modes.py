"""The command `modes`: table, pictures and a ParaView file of the modes."""

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
        "modes", help="table, pictures and a ParaView file of the modes",
        description="Find the modes of a scene, every contact bonded, with their damping ratios and effective masses.",
    )
    add_scene(parser)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--number", type=int, metavar="N", help="the N lowest modes (default: what the section [modal] says, else 20)")
    which.add_argument("--band", type=float, nargs=2, metavar=("LOW", "HIGH"), help="all modes between two frequencies in Hz")
    add_folder(parser, "modes")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    def work(assembly: AssembledScene, out: Path) -> list[str]:
        from uplift.drivers.analysis.modes import wanted_modes
        from uplift.drivers.studies.mode_table import tabulate_modes

        wanted = wanted_modes(assembly.scene, options.number, options.band)
        return tabulate_modes(assembly, wanted, out, plots=not options.no_plots)

    return assembled(options, begin, "modes", work)
