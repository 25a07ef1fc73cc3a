"""Cells that no element can live on, and cells that lie on each other."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from uplift.meshes.checked import ModelError
from uplift.meshes.findings import say
from uplift.meshes.plain import PlainMesh, place_in_words
from uplift.meshes.plate import LARGEST

FLAT = 1e-9
"""Of the square of the longest side: a cell of less area has none."""

LONG = 1000.0
"""Of the median side: a longer one belongs to a node that lies where it was not meant to be."""


def check_shapes(mesh: PlainMesh, key: str) -> None:
    """Raise `ModelError` (of `key`) for cells without area, with crossing sides or with a corner that is no corner or turns inward."""
    if not np.all(np.abs(mesh.points) <= LARGEST):
        raise ModelError(key, f"a node lies farther than {LARGEST:g} m from the origin, or nowhere")
    at = mesh.points[mesh.corners]
    arms = np.roll(at, -1, axis=1) - at
    length = np.linalg.norm(arms, axis=2)
    longest = length.max(axis=1)
    turns = np.cross(np.roll(arms, 1, axis=1), arms)
    area = 0.5 * np.cross(at[:, 1] - at[:, -1], at[:, -2] - at[:, 0])
    size = np.linalg.norm(area, axis=1)
    _refuse(mesh, key, (size <= FLAT * longest**2) & _lies_on_a_line(turns, longest), "has no area")
    straight = np.einsum("ijk,ik->ij", turns, area)
    inward = straight < -FLAT * (longest**2 * np.where(size > 0, size, longest**2))[:, None]
    _refuse(mesh, key, (inward.sum(axis=1) == 2) | ((size <= FLAT * longest**2) & (mesh.corners.shape[1] == 4)), "has sides that cross")
    _refuse(mesh, key, inward.any(axis=1), "is not convex")
    _refuse(mesh, key, (straight <= FLAT * (longest**2 * size)[:, None]).any(axis=1), "has three corners on a line")
    median = float(np.median(length))
    if longest.max(initial=0.0) > LONG * median:
        worst = int(np.argmax(longest))
        say("mesh", f"a side of a cell{_of(mesh, worst)} is {longest[worst]:.3g} m long, where half of all sides are shorter than "
                    f"{median:.3g} m: a node at {place_in_words(at[worst, int(np.argmax(length[worst]))])} may lie far outside")


def _lies_on_a_line(turns: np.ndarray, longest: np.ndarray) -> np.ndarray:
    """Tell which cells have all corners on a line: those with crossing sides have turns of two signs instead."""
    flat: np.ndarray = np.linalg.norm(turns, axis=2).max(axis=1) <= FLAT * longest**2
    return flat


def _refuse(mesh: PlainMesh, key: str, wrong: np.ndarray, words: str) -> None:
    if wrong.any():
        first = int(np.argmax(wrong))
        place = place_in_words(mesh.points[mesh.corners[first]].mean(axis=0))
        more = f" ({int(wrong.sum())} such cells)" if wrong.sum() > 1 else ""
        raise ModelError(key, f"a cell{_of(mesh, first)} around {place} {words}{more}")


def _of(mesh: PlainMesh, cell: int) -> str:
    names = mesh.groups_of_cells(np.array([cell]))
    return f" of {names}" if names else ""


def say_overlaps(mesh: PlainMesh) -> None:
    """Say where the middle of a cell lies in another cell: both are there, with their mass and stiffness."""
    at = mesh.points[mesh.corners]
    centre = at.mean(axis=1)
    radius = np.linalg.norm(at - centre[:, None], axis=2).max(axis=1)
    tree = cKDTree(centre)
    # Of two cells that overlap the middle of the smaller one lies in reach of the larger.
    near = tree.query_ball_point(centre, radius * 0.999, return_sorted=False)
    counts = np.array([len(cells) for cells in near])
    one, other = np.repeat(np.arange(len(centre)), counts), np.concatenate([np.array(cells, dtype=int) for cells in near])
    different = one != other
    one, other = one[different], other[different]
    if not len(one):
        return
    arms, corner = np.roll(at[one], -1, axis=1) - at[one], centre[other][:, None] - at[one]
    area = np.cross(at[one, 1] - at[one, -1], at[one, -2] - at[one, 0])
    normal = area / np.linalg.norm(area, axis=1, keepdims=True)
    inside = np.all(np.einsum("ijk,ik->ij", np.cross(arms, corner), normal) > 0, axis=1)
    off = np.abs(np.einsum("ij,ij->i", centre[other] - at[one, 0], normal))
    on_each_other = inside & (off <= 1e-6 * radius[one])
    if on_each_other.any():
        first = int(np.argmax(on_each_other))
        names = mesh.groups_of_cells(np.array([one[first], other[first]]))
        say("overlap", f"cells{f' of {names}' if names else ''} lie on each other around {place_in_words(centre[other[first]])}: "
                       "both count, with their mass and stiffness")
