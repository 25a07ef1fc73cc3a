"""Components that are held at zero on groups of the mesh, relative to the moving base."""

from __future__ import annotations

from typing import Any

import numpy as np

from uplift.forms.assembly.nodes import nodes_of
from uplift.forms.parameters import Condition
from uplift.forms.shells.kinematics import AXES_OF
from uplift.forms.shells.shell import edge_components
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import Space, geometry_cells
from uplift.meshes.groups import GroupNames, groups_in_words
from uplift.meshes.tagged import SIDES, TaggedMesh

STRAIGHT = 1e-6
"""Largest sine of the angle between an edge and an axis that it runs along."""


def held_by_group(
    conditions: tuple[Condition, ...], tagged: TaggedMesh, space: Space, components: tuple[str, ...], kind: str
) -> dict[str, np.ndarray]:
    """Return the owned scalar dofs that the conditions of each group hold, sorted (collective).

    Raises `ModelError` for a group that the mesh does not have, and for an edge condition by name that means nothing there.
    """
    held: dict[str, np.ndarray] = {}
    for condition in conditions:
        key = f"conditions[{groups_in_words(condition.group)}]"
        try:
            nodes = nodes_of(tagged, space, condition.group)
            names = condition.zero or _names_of_edge(condition, tagged, kind)
        except ModelError as error:
            raise ModelError(f"{key}.{error.key}" if error.key else key, error.message) from None
        columns = [components.index(name) for name in names if name in components]
        name, dofs = groups_in_words(condition.group), (len(components) * nodes[:, None] + np.array(columns, dtype=np.int64)).ravel()
        held[name] = np.unique(np.concatenate([held.get(name, dofs), dofs]))
    return held


def _names_of_edge(condition: Condition, tagged: TaggedMesh, kind: str) -> tuple[str, ...]:
    if tagged.dimension(condition.group) != 1:
        raise ModelError("edge", f"{groups_in_words(condition.group)!r} is no edge")
    if condition.edge == "clamped":
        return tuple(f"D{axis}" for axis in AXES_OF[kind])
    if kind == "plane stress":
        raise ModelError("edge", f"expected 'clamped' or components in plane stress, got {condition.edge!r}")
    along, normal = _axes_of_edge(condition.group, tagged)
    if normal < 0 or (along < 0 and condition.edge != "soft"):
        raise ModelError(
            "edge", f"{condition.edge!r} has a meaning only where edge and plate lie along the axes; give the components that are zero"
        )
    return edge_components(condition.edge, normal, along) if along >= 0 else (("DX", "DY", "DZ")[normal],)


def _axes_of_edge(group: GroupNames, tagged: TaggedMesh) -> tuple[int, int]:
    """Return the axis that the edge runs along and that of the normal of its plates, -1 for none (collective)."""
    mesh = tagged.mesh
    cells, x = geometry_cells(mesh), mesh.geometry.x
    ends_of = SIDES[mesh.topology.cell_type.name]
    along, normals = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for _, cell, side in tagged.sides(group):
        corners = x[cells[cell]]
        along.append(np.diff(corners[list(ends_of[side])], axis=0))
        normals.append(np.cross(corners[1] - corners[0], corners[2] - corners[0])[None])
    return _common_axis(along, mesh.comm), _common_axis(normals, mesh.comm)


def _common_axis(vectors: list[np.ndarray], comm: Any) -> int:
    """Return the axis (0 to 2) that all vectors (n, 3) of all ranks lie along, or -1 (collective)."""
    all_ = np.concatenate(comm.allgather(np.concatenate(vectors)))
    if not len(all_):
        return -1
    unit = np.abs(all_ / np.linalg.norm(all_, axis=1, keepdims=True))
    axis = int(np.argmax(unit[0]))
    return axis if np.all(unit[:, axis] >= np.sqrt(1 - STRAIGHT**2)) else -1
