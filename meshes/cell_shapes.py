"""Cells that no element can live on, and cells that lie on each other."""

from __future__ import annotations

import numpy as np

from uplift.meshes.checked import ModelError
from uplift.meshes.findings import say
from uplift.meshes.plain import PlainMesh, pairs_in_reach, place_in_words
from uplift.meshes.plate import LARGEST

STRAIGHT = 1e-9
"""Sine of the angle up to which two sides lie on a line: round-off of coordinates written with ten digits."""

LONG = 1000.0
"""Of the median side: a longer one belongs to a node that lies where it was not meant to be."""


def check_places(mesh: PlainMesh, key: str) -> None:
    """Raise `ModelError` (of `key`) for nodes that lie nowhere, or farther than `LARGEST` from the origin."""
    if not np.all(np.abs(mesh.points) <= LARGEST):
        raise ModelError(key, f"a node lies farther than {LARGEST:g} m from the origin, or nowhere")


def check_shapes(mesh: PlainMesh, key: str) -> None:
    """Raise `ModelError` (of `key`) for cells without area, with crossing sides or with a corner that is no corner or turns inward."""
    at = mesh.points[mesh.corners]
    arms = np.roll(at, -1, axis=1) - at
    length = np.linalg.norm(arms, axis=2)
    longest = length.max(axis=1)
    turns = np.cross(np.roll(arms, 1, axis=1), arms)
    area = 0.5 * np.cross(at[:, 1] - at[:, -1], at[:, -2] - at[:, 0])
    size = np.linalg.norm(area, axis=1)
    _refuse(mesh, key, (length <= 0).any(axis=1), "has a side without length")
    beside = np.roll(length, 1, axis=1) * length
    _refuse(mesh, key, np.all(np.linalg.norm(turns, axis=2) <= STRAIGHT * beside, axis=1), "has no area")
    _refuse(mesh, key, size <= STRAIGHT * beside.min(axis=1), "has sides that cross")
    sine = np.einsum("ijk,ik->ij", turns, area) / (beside * size[:, None])
    _refuse(mesh, key, np.sum(sine < -STRAIGHT, axis=1) == 2, "has sides that cross")
    _refuse(mesh, key, np.any(sine < -STRAIGHT, axis=1), "is not convex")
    _refuse(mesh, key, np.any(sine <= STRAIGHT, axis=1), "has three corners on a line")
    median = float(np.median(length))
    if longest.max(initial=0.0) > LONG * median:
        worst = int(np.argmax(longest))
        say("mesh", f"a side of a cell{_of(mesh, worst)} is {longest[worst]:.3g} m long, where half of all sides are shorter than "
                    f"{median:.3g} m: a node at {place_in_words(at[worst, int(np.argmax(length[worst]))])} may lie far outside")


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
    other, one = pairs_in_reach(centre, centre, radius * 0.999)
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
