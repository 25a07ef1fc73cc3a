"""Mesh files written by hand, entry by entry."""

import numpy as np


def grid(nx, ny, size=1.0, at=(0.0, 0.0, 0.0)):
    """Nodes (n, 3) m and quadrilaterals (m, 4), from 0, of a regular mesh in a plane Z = at[2]."""
    x, y = np.meshgrid(np.arange(nx + 1) * size + at[0], np.arange(ny + 1) * size + at[1])
    points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, at[2])])
    first = (np.arange(ny)[:, None] * (nx + 1) + np.arange(nx)).ravel()
    return points, np.column_stack([first, first + 1, first + nx + 2, first + nx + 1])


def msh2(points, elements, names=()):
    """The text of an MSH 2.2 file; `elements` are (type, physical number, elementary number, nodes from 0), `names` (dimension, number,
    name)."""
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    if names:
        lines += ["$PhysicalNames", str(len(names)), *(f'{d} {n} "{name}"' for d, n, name in names), "$EndPhysicalNames"]
    lines += ["$Nodes", str(len(points)), *(f"{i} {x!r} {y!r} {z!r}" for i, (x, y, z) in enumerate(points.tolist(), start=1)), "$EndNodes"]
    rows = (f"{i} {kind} 2 {number} {entity} {' '.join(str(int(n) + 1) for n in nodes)}"
            for i, (kind, number, entity, nodes) in enumerate(elements, start=1))
    return "\n".join([*lines, "$Elements", str(len(elements)), *rows, "$EndElements", ""])


def quads(cells, number=1, entity=1):
    """Elements of quadrilaterals."""
    return [(3, number, entity, cell) for cell in cells]
