"""A scene of one's own, begun from one that ships."""

from __future__ import annotations

import tomllib
from pathlib import Path

from uplift.meshes.checked import ModelError

SCENES = Path(__file__).parents[1] / "scenes"

REFERENCE = SCENES / "sdls119a.toml"
"""The reference case."""


def shipped() -> dict[str, Path]:
    """Return the scenes that ship by their names."""
    return {path.stem: path for path in sorted(SCENES.glob("*.toml"))}


def list_shipped() -> list[str]:
    """Return a line for each scene that ships, its name and its title."""
    scenes = shipped()
    width = max(len(name) for name in scenes)
    return [f"{name:<{width}}  {tomllib.loads(path.read_text(encoding='utf-8'))['title']}" for name, path in scenes.items()]


def new_scene(target: Path, source: str) -> Path:
    """Copy the shipped scene `source`, comments and all, to `target` (.toml is added) and return the path of the copy.

    Raises `ModelError` if there is no such scene, or if a file of that name is there already.
    """
    scenes = shipped()
    if source not in scenes:
        raise ModelError("--from", f"expected one of {', '.join(scenes)}, got {source!r}")
    path = target if target.suffix == ".toml" else target.with_name(target.name + ".toml")
    text = scenes[source].read_text(encoding="utf-8")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise ModelError("", f"{path} is there already; choose another name") from None
    except OSError as error:
        raise ModelError("", f"cannot write {path}: {error.strerror}") from None
    return path
