"""From the elements of a mesh file to cells of one shape, lines, and groups by name."""

from __future__ import annotations

import json

import numpy as np

from uplift.meshes.checked import ModelError
from uplift.meshes.file_reader import DIMENSIONS, VERTEX
from uplift.meshes.findings import say
from uplift.meshes.plain import LINES, ORDERS, PlainMesh

WORDS = {
    2: "triangles", 3: "quadrilaterals", 9: "triangles of 6 nodes", 10: "quadrilaterals of 9 nodes", 16: "quadrilaterals of 8 nodes",
    21: "triangles of 10 nodes", 36: "quadrilaterals of 16 nodes",
}

DIMENSION_WORDS = ("points", "lines", "surfaces")


def plain_mesh(contents: dict[str, np.ndarray]) -> PlainMesh:
    """Return the mesh of what a file holds (see `uplift.meshes.file_reader`). Raises `ModelError` where that is no surface mesh.

    Groups without a name bear their number. Of one name in several dimensions the highest is taken, which is said.
    """
    kinds = {int(key.split(".")[1]) for key in contents if key.startswith("elements.")}
    cells, numbers, kind = _cells(contents, kinds)
    names = _names(json.loads(str(contents["groups"])))
    for dimension in range(3):
        for number in _numbers(contents, kinds, dimension):
            names.setdefault((dimension, number), str(number))
    cells, of_cells = _once(cells)
    _refuse_doubled(of_cells, numbers)
    lines, line_numbers = _lines(contents, kinds, names, kind)
    lines, of_lines = _once(lines)
    groups: dict[int, dict[str, np.ndarray]] = {0: {}, 1: {}, 2: {}}
    members = {2: (numbers, of_cells), 1: (line_numbers, of_lines)}
    if VERTEX in kinds:
        members[0] = (contents[f"numbers.{VERTEX}"], contents[f"elements.{VERTEX}"][:, 0])
    for dimension, (of, at) in members.items():
        for number in np.unique(of[of > -1]):
            name = names.get((dimension, int(number)))
            if name is not None:
                before = groups[dimension].get(name, np.zeros(0, dtype=int))
                groups[dimension][name] = np.union1d(before, at[of == number]).astype(int)
    _one_dimension(groups)
    return PlainMesh(contents["points"], kind, cells, lines, groups[2], groups[1], groups[0])


def _cells(contents: dict[str, np.ndarray], kinds: set[int]) -> tuple[np.ndarray, np.ndarray, int]:
    """Return the nodes (m, n) of the cells as they stand in the file, the groups (m,) and gmsh's number of their type."""
    if any(kind not in DIMENSIONS for kind in kinds):
        raise ModelError("mesh.file", "it holds volume cells (tetrahedra, hexahedra or others); a plate is meshed by its mid-surface alone")
    flat = sorted(kind for kind in kinds if DIMENSIONS[kind] == 2)
    if not flat:
        raise ModelError("mesh.file", "it holds no triangles or quadrilaterals")
    if 16 in flat:
        raise ModelError("mesh.file", "it holds quadrilaterals of 8 nodes, which are not read; those of 4 and of 9 nodes are "
                                      "(in gmsh Mesh.SecondOrderIncomplete = 0)")
    if len(flat) > 1 or flat[0] not in ORDERS:
        words = " and ".join(WORDS[kind] for kind in flat)
        raise ModelError("mesh.file", f"it holds {words}; expected triangles alone or quadrilaterals alone, of the first or second order")
    return contents[f"elements.{flat[0]}"], contents[f"numbers.{flat[0]}"], flat[0]


def _once(elements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return elements (m, n) without those that stand there again, for each further group, in order; and where each is found (m,)."""
    _, first, index = np.unique(np.sort(elements, axis=1), axis=0, return_index=True, return_inverse=True)
    position = np.empty(len(first), dtype=int)
    position[np.argsort(first)] = np.arange(len(first))
    return elements[np.sort(first)], position[index]


def _names(groups: list[tuple[int, int, str]]) -> dict[tuple[int, int], str]:
    """Return the name of each group by dimension and number; one without a name has none here."""
    return {(dimension, number): name for dimension, number, name in groups if name.strip()}


def _numbers(contents: dict[str, np.ndarray], kinds: set[int], dimension: int) -> list[int]:
    """Return the numbers of the groups of a dimension; 0 stands for none in the older format."""
    found = [contents[f"numbers.{kind}"] for kind in kinds if DIMENSIONS[kind] == dimension]
    return [int(number) for number in np.unique(np.concatenate(found)) if number > 0] if found else []


def _refuse_doubled(index: np.ndarray, numbers: np.ndarray) -> None:
    """Refuse a cell that is there twice in one group, or in none."""
    pairs = np.column_stack([index, np.maximum(numbers, 0)])
    twice = len(pairs) - len(np.unique(pairs, axis=0))
    if twice:
        raise ModelError("mesh.file", f"{twice} cells are there twice, on the same nodes and in the same group")


def _lines(
    contents: dict[str, np.ndarray], kinds: set[int], names: dict[tuple[int, int], str], kind: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes (k, 2 or 3) and groups (k,) of the lines that belong to a group."""
    line = LINES[ORDERS[kind]]
    for other in kinds - {line}:
        if DIMENSIONS[other] == 1 and np.any(contents[f"numbers.{other}"] > 0):
            number = int(contents[f"numbers.{other}"].max())
            raise ModelError("mesh.file", f"lines of the group {names.get((1, number), str(number))!r} are not of the order of the cells")
    if line not in kinds:
        return np.zeros((0, 2), dtype=int), np.zeros(0, dtype=int)
    numbers = contents[f"numbers.{line}"]
    grouped = np.array([(1, int(number)) in names for number in numbers], dtype=bool)
    return contents[f"elements.{line}"][grouped], numbers[grouped]


def _one_dimension(groups: dict[int, dict[str, np.ndarray]]) -> None:
    """Leave each name in one dimension, the highest, and say which others there were."""
    for dimension in (1, 0):
        for name in [n for n in groups[dimension] if any(n in groups[higher] for higher in range(dimension + 1, 3))]:
            kept = next(DIMENSION_WORDS[higher] for higher in (2, 1) if name in groups[higher])
            del groups[dimension][name]
            say("groups", f"the name {name!r} is one of {kept} and of {DIMENSION_WORDS[dimension]} of the mesh file: the {kept} are taken")
