"""The command `schema`: all keys of a scene file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from uplift.drivers import process


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "schema", help="all keys of a scene file", description="Print all keys of a scene file with their units, defaults and ranges."
    )
    parser.add_argument("--out", type=Path, metavar="FILE.md", help="write them there instead")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    from uplift.drivers.scene.schema import page

    text = page(process.program())
    if options.out is None:
        process.say(text)
        return 0
    options.out.write_text(text, encoding="utf-8")
    process.say(str(options.out))
    return 0
