"""The cells around a point that section forces there are recovered from: of one plate, on one side of every fold and joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from uplift.forms.assembly.compiled_forms import CompiledForms
from uplift.forms.assembly.points import in_words
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import geometry_cells
from uplift.meshes.groups import GroupNames, groups_in_words, names_in

FOLD_WITHIN, FOLD_BETWEEN = np.cos(np.radians(45.0)), np.cos(np.radians(1.0))
"""Cells whose normals turn by more are two plates: within one group, whose cells may follow a curved shell, and between groups."""

NEAR = 1e-6
"""Distances are the same within this part of a cell's size."""


@dataclass(frozen=True)
class Patch:
    """Cells around a point, the same on all ranks and in one order."""

    rank: np.ndarray
    """(n,): the rank that owns each cell."""
    cell: np.ndarray
    """(n,): its number there."""
    normal: np.ndarray
    """(3,): of the cell that holds the point."""
    along: np.ndarray
    """(3,): unit direction of its first side."""
    thickness: float
    """m, of the plate at the point."""
    part: GroupNames | None
    """The part of the model that holds it, None where its material is that of the plate."""


@dataclass
class _Near:
    """Cells near a point, gathered from all ranks in the order of their middles."""

    rank: np.ndarray
    cell: np.ndarray
    nodes: np.ndarray
    """(n, n_corners): global numbers of the corners."""
    corners: np.ndarray
    """(n, n_corners, 3) m."""
    material: np.ndarray
    """(n, 3): Young's modulus, Poisson's ratio, thickness."""
    groups: list[frozenset[str]]
    normals: np.ndarray
    """(n, 3)."""


def patch_at(compiled: CompiledForms, point: np.ndarray, part: GroupNames, what: str, parts: tuple[GroupNames, ...]) -> Patch:
    """Return the cells around `point` (3,) m (collective): the one or those that hold it and those that share a corner with them.

    `part` is what group of cells the patch keeps to, empty: any; `parts` are the groups that have a material or axes of their own.
    Raises `ModelError` where several plates meet at the point, or the group holds no cell there.
    """
    near = _near(compiled, point)
    distance = np.array([_distance(point, corners) for corners in near.corners])
    size = np.linalg.norm(np.ptp(near.corners, axis=1), axis=1)
    inside = distance <= distance.min() + NEAR * size
    if part:
        member = np.array([_belongs(groups, part) for groups in near.groups])
        if not np.any(inside & member):
            raise ModelError("part", f"{what} at {in_words(point)} lies in no cell of {groups_in_words(part)}")
        inside &= member
    holding = np.flatnonzero(inside)
    ring = np.isin(near.nodes, near.nodes[holding]).any(axis=1)
    linked = _links(near, ring, part)
    reached = _reached(int(holding[0]), linked)
    if not set(holding.tolist()) <= reached:
        raise ModelError("part", _meeting(near, holding, part, what, point))
    chosen = np.array(sorted(reached))
    side = near.corners[holding[0], 1] - near.corners[holding[0], 0]
    own = next((group for group in reversed(parts) if _belongs(near.groups[holding[0]], group)), None)
    along, thickness = side / np.linalg.norm(side), float(near.material[holding[0], 2])
    return Patch(near.rank[chosen], near.cell[chosen], near.normals[holding[0]], along, thickness, own)


def _belongs(groups: frozenset[str], part: GroupNames) -> bool:
    """Tell whether a cell of some groups is one of a part."""
    return any(name in groups for name in names_in(part))


def _meeting(near: _Near, holding: np.ndarray, part: GroupNames, what: str, point: np.ndarray) -> str:
    if part:
        return f"at {in_words(point)}, where {what} is, the forces in {groups_in_words(part)} jump at a joint or fold: move it to one side"
    groups = sorted({min(near.groups[i]) for i in holding if near.groups[i]})
    named = f" ({', '.join(groups)})" if groups else ""
    return f"several plates{named} meet at {in_words(point)}, where {what} is: name the group of cells whose forces are meant"


def _near(compiled: CompiledForms, point: np.ndarray) -> _Near:
    """Gather the cells that share a corner with one whose surrounding ball holds the point, or with the nearest (collective)."""
    tagged = compiled.tagged
    mesh, comm = tagged.mesh, tagged.mesh.comm
    owned = mesh.topology.index_map(2).size_local
    n_corners = 3 if mesh.topology.cell_name() == "triangle" else 4
    cells = geometry_cells(mesh)[:owned, :n_corners]
    at = mesh.geometry.x[cells]
    middles = at.mean(axis=1)
    radius = np.max(np.linalg.norm(at - middles[:, None], axis=2), axis=1, initial=0.0)
    outside = np.linalg.norm(middles - point, axis=1) - 1.01 * radius
    least = min(comm.allgather(float(outside.min(initial=np.inf))))
    chosen = outside <= max(least, 0.0) + NEAR * radius
    numbers = np.asarray(mesh.geometry.index_map().local_to_global(cells.ravel().astype(np.int32))).reshape(cells.shape)
    wanted = np.concatenate(comm.allgather(np.unique(numbers[chosen])))
    mine = np.flatnonzero(np.isin(numbers, wanted).any(axis=1))
    names = [name for name, (dimension, _) in tagged.groups.items() if dimension == 2]
    members = {name: np.isin(mine, tagged.cells(name)) for name in names}
    material = np.stack([np.real(getattr(compiled.material, k).x.array[mine]) for k in ("young", "poisson", "thickness")], axis=1)
    groups = [frozenset(name for name in names if members[name][i]) for i in range(len(mine))]
    all_parts = comm.allgather((np.full(len(mine), comm.rank), mine, numbers[mine], at[mine], material, groups))
    rank, cell, nodes, corners, material = (np.concatenate([p[k] for p in all_parts]) for k in range(5))
    gathered = [g for p in all_parts for g in p[5]]
    order = np.lexsort(np.round(corners.mean(axis=1) / max(float(np.ptp(corners)), np.finfo(float).tiny), 9).T)
    normals = np.array([[0.0, 0.0, 1.0]] * len(order)) if mesh.geometry.dim == 2 else _normals(corners)
    return _Near(rank[order], cell[order], nodes[order], corners[order], material[order], [gathered[i] for i in order], normals[order])


def _normals(corners: np.ndarray) -> np.ndarray:
    """Return the normals at the middles of cells (n, n_corners, 3)."""
    if corners.shape[1] == 3:
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    else:
        x0, x1, x2, x3 = np.moveaxis(corners, 1, 0)
        across = np.cross(x1 - x0 + x3 - x2, x2 - x0 + x3 - x1)
    normals: np.ndarray = across / np.linalg.norm(across, axis=1, keepdims=True)
    return normals


def _links(near: _Near, ring: np.ndarray, part: GroupNames) -> dict[int, set[int]]:
    """Return which cells of the ring go on in which: over an edge of two cells, without a fold or a change of the section."""
    sides: dict[tuple[int, int], list[int]] = {}
    around = (0, 1, 2) if near.nodes.shape[1] == 3 else (0, 1, 3, 2)
    for i, nodes in enumerate(near.nodes):
        for a, b in zip(around, (*around[1:], around[0]), strict=True):
            sides.setdefault((min(nodes[a], nodes[b]), max(nodes[a], nodes[b])), []).append(i)
    links: dict[int, set[int]] = {int(i): set() for i in np.flatnonzero(ring)}
    for cells in sides.values():
        if len(cells) != 2 or not all(ring[i] for i in cells) or (part and not all(_belongs(near.groups[i], part) for i in cells)):
            continue
        i, j = cells
        same = np.allclose(near.material[i], near.material[j], rtol=1e-9, atol=0.0)
        limit = FOLD_WITHIN if near.groups[i] == near.groups[j] else FOLD_BETWEEN
        if same and abs(near.normals[i] @ near.normals[j]) >= limit:
            links[i].add(j)
            links[j].add(i)
    return links


def _reached(start: int, links: dict[int, set[int]]) -> set[int]:
    reached, front = {start}, [start]
    while front:
        new = links[front.pop()] - reached
        reached |= new
        front += sorted(new)
    return reached


def _distance(point: np.ndarray, corners: np.ndarray) -> float:
    """Return the distance in m of a point from a cell (n_corners, 3)."""
    triangles: Any = ((0, 1, 2),) if len(corners) == 3 else ((0, 1, 2), (1, 3, 2))
    return min(_to_triangle(point, corners[list(t)]) for t in triangles)


def _to_triangle(point: np.ndarray, corners: np.ndarray) -> float:
    a, edges = corners[0], (corners[1:] - corners[0]).T
    weights = np.linalg.lstsq(edges, point - a, rcond=None)[0]
    if np.all(weights >= 0) and weights.sum() <= 1:
        return float(np.linalg.norm(a + edges @ weights - point))
    ends = [(corners[i], corners[(i + 1) % 3]) for i in range(3)]
    return min(_to_segment(point, *pair) for pair in ends)


def _to_segment(point: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    along = b - a
    share = float(np.clip((point - a) @ along / (along @ along), 0.0, 1.0))
    return float(np.linalg.norm(a + share * along - point))
