"""The command `new`: begin a scene from one that ships."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from uplift.drivers import process
from uplift.meshes.checked import ModelError


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "new", help="begin a scene of your own", description="Copy a scene that ships, with its comments, to NAME.toml."
    )
    parser.add_argument("name", type=Path, nargs="?", metavar="NAME", help="the new file, .toml is added; nothing is overwritten")
    parser.add_argument("--from", dest="source", default="sdls119a", metavar="SCENE", help="the scene to copy (default: %(default)s)")
    parser.add_argument("--list", action="store_true", help="list the scenes that ship")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    from uplift.drivers.scene.shipped import list_shipped, new_scene

    if options.list:
        process.say("\n".join(list_shipped()))
        return 0
    if options.name is None:
        raise ModelError("NAME", "expected the name of the new scene, or --list")
    path = new_scene(options.name, options.source)
    process.say(f"{path}: a copy of {options.source}; next: {process.program()} check {path}")
    return 0
