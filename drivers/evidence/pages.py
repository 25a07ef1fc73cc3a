"""Where the pages of evidence stand, and the command that makes each."""

from __future__ import annotations

from pathlib import Path

from uplift.drivers.scene.shipped import REFERENCE


def page_path(name: str) -> Path:
    """Return the place of a page of evidence: docs/ of the current folder if that is a checkout, else the current folder itself."""
    here = Path("pyproject.toml")
    checkout = here.is_file() and Path("docs").is_dir() and 'name = "uplift' in here.read_text(encoding="utf-8", errors="replace")
    return Path("docs") / name if checkout else Path(name)


def command_line(command: str, page: Path, usual: str, *flags: str, scene: Path = REFERENCE) -> str:
    """Return the command that makes a page, without what stands for itself: the place of the page `usual` and the reference scene."""
    words = ["python3 -m drivers", command]
    words += [str(scene)] if scene.resolve() != REFERENCE.resolve() else []
    words += ["--out", str(page)] if page != page_path(usual) else []
    return " ".join([*words, *flags])
