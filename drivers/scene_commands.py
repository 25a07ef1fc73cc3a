"""The commands that deal with a scene file and run nothing: check, new, schema."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from drivers import runtime
from meshes.checked import ModelError


def add_scene_commands(commands: Any) -> None:
    """Add the commands to those of the command line."""
    check = commands.add_parser(
        "check", help="read and check a scene",
        description="Read and check a scene: its mesh, dofs, supports, the methods that can run it, the memory they take, and what is "
                    "doubtful about it. Exit code 2 and one line if it cannot be run.",
    )
    check.add_argument("scene", type=Path, metavar="SCENE.toml", help="the scene file")
    check.add_argument("--no-mesh", action="store_true", help="neither mesh nor assemble; otherwise done where it is quick")
    check.set_defaults(command=_check, quiet=True)

    new = commands.add_parser(
        "new", help="begin a scene of your own", description="Copy a scene that ships, with its comments, to NAME.toml."
    )
    new.add_argument("name", type=Path, nargs="?", metavar="NAME", help="the new file, .toml is added; nothing is overwritten")
    new.add_argument("--from", dest="source", default="sdls119a", metavar="SCENE", help="the scene to copy (default: %(default)s)")
    new.add_argument("--list", action="store_true", help="list the scenes that ship")
    new.set_defaults(command=_new)

    schema = commands.add_parser(
        "schema", help="all keys of a scene file", description="Print all keys of a scene file with their units, defaults and ranges."
    )
    schema.add_argument("--out", type=Path, metavar="FILE.md", help="write them there instead")
    schema.set_defaults(command=_schema)


def _check(options: argparse.Namespace, begin: float) -> int:
    from drivers.scene import read_scene

    scene = read_scene(options.scene)
    runtime.choose_scalars("real")
    with runtime.parallel() as comm:
        from drivers.check import check_scene

        runtime.say("\n".join(check_scene(scene, comm, mesh=not options.no_mesh)))
    return 0


def _new(options: argparse.Namespace, begin: float) -> int:
    from drivers.new import list_shipped, new_scene

    if options.list:
        runtime.say("\n".join(list_shipped()))
        return 0
    if options.name is None:
        raise ModelError("NAME", "expected the name of the new scene, or --list")
    path = new_scene(options.name, options.source)
    runtime.say(f"{path}: a copy of {options.source}; next: python3 -m drivers check {path}")
    return 0


def _schema(options: argparse.Namespace, begin: float) -> int:
    from drivers.schema import page

    if options.out is None:
        runtime.say(page())
        return 0
    options.out.write_text(page(), encoding="utf-8")
    runtime.say(str(options.out))
    return 0
