"""What a parsed scene file may hold at all, before its keys are read."""

from __future__ import annotations

import unicodedata
from typing import Any

from uplift.meshes.checked import ModelError

DEEPEST = 20
"""Tables and arrays within each other; a scene needs six."""

LONGEST = 1000
"""Characters of a text, such as the path of a file."""

LONGEST_NAME = 100
"""Characters of a name, which stands in headings of tables and beside pictures."""

NAMES = ("name", "group", "uplift_group", "edges", "side", "part", "edge")
"""Keys whose texts are names."""


def see_texts(table: dict[str, Any]) -> None:
    """Raise `ModelError` naming the key of a text with control characters, of one that is too long, and of what is nested too deeply."""
    left: list[tuple[str, str, Any, int]] = [("", "", table, 0)]
    while left:
        path, name, value, depth = left.pop()
        if depth > DEEPEST:
            raise ModelError(path[:LONGEST_NAME], f"expected at most {DEEPEST} tables and arrays within each other")
        if isinstance(value, dict):
            for key, part in value.items():
                _see_text(path, key, LONGEST_NAME, "a key")
                left.append((f"{path}.{key}" if path else key, key, part, depth + 1))
        elif isinstance(value, list):
            left += [(path, name, part, depth + 1) for part in value]
        elif isinstance(value, str):
            _see_text(path, value, LONGEST_NAME if name in NAMES else LONGEST, "a text", title=path == "title")


def _see_text(path: str, text: str, most: int, what: str, *, title: bool = False) -> None:
    if len(text) > most:
        raise ModelError(path, f"expected {what} of at most {most} characters, got {len(text)}: {text!r:.60}")
    if any(unicodedata.category(c) in ("Cc", "Cs") and not (title and c in "\n\t") for c in text):
        raise ModelError(path, f"expected {what} without control characters, got {text!r:.60}")
