"""Types of command-line values, and options that several commands share."""

from __future__ import annotations

import argparse
import importlib.util
from pathlib import Path
from typing import Any

from uplift.drivers.evidence.pages import page_path


def pass_count(text: str) -> int:
    """Return the number of passes, 0 for exact uplift."""
    if text == "exact":
        return 0
    try:
        number = int(text)
    except ValueError:
        number = 0
    if not 1 <= number <= 1_000_000:
        raise argparse.ArgumentTypeError(f"expected a whole number from 1 to 1e6 or 'exact', got {text!r:.60}")
    return number


def percent(text: str) -> float:
    """Return a share from a number of percent."""
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not 0 <= number < 100:
        raise argparse.ArgumentTypeError(f"expected a number of percent from 0 to below 100, got {text!r}")
    return number / 100


def fraction(text: str) -> float:
    """Return a number between 0 and 1."""
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number < 1:
        raise argparse.ArgumentTypeError(f"expected a number between 0 and 1, got {text!r}")
    return number


def basis_tolerance(text: str) -> float:
    """Return the tolerance, 0 for no basis."""
    return 0.0 if text == "none" else fraction(text)


def seconds(text: str) -> float:
    """Return seconds, 0 or more."""
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not 0 <= number < float("inf"):
        raise argparse.ArgumentTypeError(f"expected seconds >= 0, got {text!r}")
    return number


def gibibytes(text: str) -> float:
    """Return bytes."""
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not number > 0:
        raise argparse.ArgumentTypeError(f"expected GiB > 0, got {text!r}")
    return 2**30 * number


def add_scene(parser: Any, *, default: Path | None = None) -> None:
    """Add the scene file, needed unless there is a `default`."""
    if default is None:
        parser.add_argument("scene", type=Path, metavar="SCENE.toml", help="the scene file")
    else:
        parser.add_argument("scene", type=Path, nargs="?", default=default, metavar="SCENE.toml", help=f"default: {default.name}")


def add_folder(parser: Any, name: str, *, plots: str = "draw no pictures") -> None:
    """Add the options of a command that writes a folder, results/SCENE/`name` by default."""
    parser.add_argument("--out", type=Path, metavar="DIR", help=f"folder of the results (default: results/SCENE/{name})")
    parser.add_argument("--overwrite", action="store_true", help="write over the results that the folder holds")
    parser.add_argument("--no-plots", action="store_true", help=plots)
    parser.add_argument("--quiet", action="store_true", help="print errors only")


def add_page(parser: Any, package: str, usual: str) -> None:
    """Add the file of a page that a package of `uplift.drivers.evidence` makes, by default the page `usual` in its place."""
    parser.add_argument("--out", type=Path, default=page_path(usual), metavar="FILE.md", help="default: %(default)s")
    parser.set_defaults(evidence=package)


def missing_evidence(options: argparse.Namespace) -> bool:
    """Tell whether the command needs a package of evidence that is not here: an installation has only that of `verify`."""
    package = getattr(options, "evidence", "")
    return bool(package) and importlib.util.find_spec(f"uplift.drivers.evidence.{package}") is None
