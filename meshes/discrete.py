"""A plain mesh as a model of gmsh, each set of cells or lines that belong to the same groups an entity of its own."""

from __future__ import annotations

from typing import Any

import numpy as np

from uplift.meshes.parts import part_of_cells
from uplift.meshes.plain import LINES, ORDERS, PlainMesh

Entities = dict[str, list[tuple[int, int]]]
"""Group -> its entities (dimension, tag) in gmsh."""


def discrete_model(model: Any, mesh: PlainMesh) -> Entities:
    """Fill an empty gmsh model with the mesh; return the entities of each group. No entity reaches over two parts of the mesh."""
    model.add("imported")
    model.addDiscreteEntity(2, 1)  # all nodes live in the first entity, cells in one of their groups
    model.mesh.addNodes(2, 1, np.arange(1, len(mesh.points) + 1), mesh.points.ravel())
    groups: Entities = {}
    number = 1
    for dimension, kind, nodes, named, part in (
        (2, mesh.kind, mesh.cells, mesh.cell_groups, part_of_cells(mesh.corners)),
        (1, LINES[ORDERS[mesh.kind]], mesh.lines, mesh.line_groups, np.zeros(len(mesh.lines), dtype=int)),
    ):
        if not len(nodes):
            continue
        member = np.zeros((len(nodes), len(named)), dtype=bool)
        for column, members in enumerate(named.values()):
            member[members, column] = True
        rows, index = np.unique(np.column_stack([part, member]), axis=0, return_inverse=True)
        order = np.argsort(index, kind="stable")
        ends = np.cumsum(np.bincount(index, minlength=len(rows)))
        for row, which in zip(rows, np.split(order, ends[:-1]), strict=True):
            number += 1
            model.addDiscreteEntity(dimension, number)
            model.mesh.addElementsByType(number, kind, [], nodes[which].ravel() + 1)
            for name, inside in zip(named, row[1:], strict=True):
                if inside:
                    groups.setdefault(name, []).append((dimension, number))
    for name, nodes in mesh.point_groups.items():
        number += 1
        model.addDiscreteEntity(0, number)
        model.mesh.addElementsByType(number, 15, [], nodes + 1)
        groups.setdefault(name, []).append((0, number))
    return groups
