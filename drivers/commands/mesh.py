"""The command `mesh`: write the mesh of a scene."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from uplift.drivers import process
from uplift.drivers.commands.options import add_scene


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser("mesh", help="write the mesh of a scene", description="Write the mesh of a scene with its named groups.")
    add_scene(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="ends in .msh, .vtu, .xdmf or .med")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    from uplift.drivers.analysis.assembled_scene import source_of
    from uplift.drivers.results.folder import writable_folder
    from uplift.drivers.scene.scene import read_scene
    from uplift.meshes.export import write_mesh

    scene = read_scene(options.scene)
    writable_folder(options.out.absolute().parent)
    cells = write_mesh(source_of(scene), options.out)
    process.say(f"{options.out}: {cells} cells")
    return 0
