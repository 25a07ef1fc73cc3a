"""Names of groups of a mesh: one, or several that count as one."""

from __future__ import annotations

GroupNames = str | tuple[str, ...]
"""A group of the mesh, or several that count as one."""


def names_in(groups: GroupNames) -> tuple[str, ...]:
    """Return the names of the groups, one or several."""
    return (groups,) if isinstance(groups, str) else groups


def groups_in_words(groups: GroupNames) -> str:
    """Return the names of the groups as text."""
    return ", ".join(names_in(groups))
