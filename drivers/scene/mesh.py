"""The mesh of a scene file: a rectangle, plates joined along edges, or a file; and points on it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.scene.toml_table import Table, convert
from uplift.forms.assembly.level import in_plane
from uplift.forms.contact.supports import PlacedPoint, in_space
from uplift.forms.loads.text_columns import read_columns
from uplift.forms.parameters import PlateModel
from uplift.meshes.checked import ModelError
from uplift.meshes.groups import GroupNames
from uplift.meshes.imported import MeshFile
from uplift.meshes.panels import Panel, Panels
from uplift.meshes.plate import LARGEST, Plate, Point
from uplift.meshes.sources import MeshSource

MOST_DOFS = 1_000_000_000
"""No mesh is refined to more."""


def read_mesh(scene: Table, folder: Path) -> tuple[MeshSource, int]:
    """Read the section [mesh]: with `file` a mesh file, with `plates` joined plates, else a rectangle; and the dofs to refine it to."""
    given = scene.take("mesh", dict)
    table = Table(given, "mesh")
    table.note("file", "plates", "dofs")
    if "file" in given:
        return table.whole(MeshFile, path=folder / table.take("file", str)), 0
    dofs = table.take("dofs", int, default=0)
    if not 0 <= dofs <= MOST_DOFS:
        raise ModelError(table.key("dofs"), f"expected a whole number from 0 to {MOST_DOFS:g}, got {dofs}")
    return _panels(table) if "plates" in given else table.whole(Plate), dofs


def _panels(table: Table) -> Panels:
    plates = []
    for entry in table.entries("plates"):
        corners = _outline(entry, "corners", entry.take("corners", list))
        holes = [_outline(entry, f"holes[{i}]", hole) for i, hole in enumerate(entry.take("holes", list, default=[]), start=1)]
        names = entry.take("edges", tuple[str, ...], default=())
        plates.append(entry.whole(Panel, corners=corners, holes=tuple(holes), edge_names=names))
    points = Table(table.take("points", dict, default={}), "mesh.points")
    named = [(name, point_of(points.take(name, list), points.key(name))) for name in list(points.rest)]
    panels: Panels = table.whole(Panels, plates=tuple(plates), named_points=tuple(named), nodes=())
    return panels


def _outline(table: Table, name: str, given: Any) -> tuple[Point, ...]:
    key = table.key(name)
    if not isinstance(given, list):
        raise ModelError(key, f"expected an array of points, got {given!r:.60}")
    return tuple(point_of(p, f"{key}[{i}]") for i, p in enumerate(given, start=1))


def point_of(value: Any, key: str) -> Point:
    """Return a point [x, y] or [x, y, z] of the file in space."""
    if not isinstance(value, list) or len(value) not in (2, 3):
        raise ModelError(key, f"expected a point [x, y] or [x, y, z] in m or the name of one, got {value!r:.60}")
    x, y, *z = (convert(v, float, key) for v in value)
    point = (x, y, z[0] if z else 0.0)
    if not np.all(np.abs(point) <= LARGEST):
        raise ModelError(key, f"expected finite coordinates of at most {LARGEST:g} m, got {value!r:.60}")
    return point


def one_point(value: Any, mesh: MeshSource, key: str) -> PlacedPoint:
    """Return the coordinates of a point that is given by them or by its name; a name in a mesh file as it is, to be found there.

    Raises `ModelError` for a point off a rectangle and for an unknown name.
    """
    if isinstance(value, str) and value and isinstance(mesh, MeshFile):
        return value
    if isinstance(value, str):
        if value not in mesh.corners:
            known = ", ".join(mesh.corners)
            raise ModelError(key, f"expected {f'a point of the mesh ({known})' if known else 'a point'} or [x, y], got {value!r}")
        return mesh.corners[value]
    point = point_of(value, key)
    if isinstance(mesh, Plate) and not (0 <= point[0] <= mesh.width and 0 <= point[1] <= mesh.height and point[2] == 0):
        raise ModelError(key, f"({point[0]:g}, {point[1]:g}) m lies outside the plate of {mesh.width:g} m x {mesh.height:g} m")
    return point


WAYS = ("points", "edge", "grid", "file", "group")
"""Keys that say where something stands, of which one is there."""


def places(table: Table, mesh: MeshSource, folder: Path) -> dict[str, Any]:
    """Read where something stands: `points`, `edge` and `count`, `grid`, a CSV `file`, or `group` with what its numbers are `per`."""
    ways = [name for name in WAYS if name in table.rest]
    table.note(*WAYS)
    if len(ways) > 1:
        raise ModelError(table.key(next(w for w in ways if w != "points")), f"expected one of {', '.join(WAYS)}, not {' and '.join(ways)}")
    nowhere: dict[str, Any] = {"points": (), "shares": (), "group": "", "per": "points"}
    if "group" in ways:
        return nowhere | {"group": table.take("group", GroupNames), "per": table.take("per", str, default="node")}
    if "edge" in ways:
        return nowhere | {"points": _on_edge(table, mesh)}
    if "grid" in ways:
        return nowhere | {"points": _on_grid(table)}
    if "file" in ways:
        return nowhere | _in_file(table, mesh, folder)
    given = table.take("points", list)
    if not given:
        raise ModelError(table.key("points"), "expected at least one point")
    return nowhere | {"points": tuple(one_point(p, mesh, f"{table.key('points')}[{i}]") for i, p in enumerate(given, start=1))}


COLUMNS = ("x", "y", "z", "share")
"""Of a file of points; z is 0 and the share 1 where there is no such column."""


def _in_file(table: Table, mesh: MeshSource, folder: Path) -> dict[str, Any]:
    """Read points and their shares from a CSV file whose columns are in the order of `COLUMNS`, or as its headings say."""
    path, key = folder / table.take("file", str), table.key("file")
    expected = "expected x, y, and perhaps z and a share"
    try:
        columns = read_columns(path, expected)
        rows = list(columns.rows())
    except ModelError as error:
        raise ModelError(key, error.message) from None
    if not rows or len(rows) > 1_000_000:
        raise ModelError(key, f"{path}: expected at least one line of x and y, and at most 1e6")
    names = tuple(name.lower() for name in columns.headings[0]) if columns.headings else COLUMNS[: columns.width]
    if len(set(names)) < len(names) or not {"x", "y"} <= set(names) <= set(COLUMNS):
        raise ModelError(key, f"{path}: {expected}, got the columns {', '.join(names):.60}")
    points, shares = [], []
    for row in rows:
        at = dict(zip(names, row.values, strict=True))
        points.append(one_point([at["x"], at["y"], at.get("z", 0.0)], mesh, f"{key}, line {row.number}"))
        shares.append(at.get("share", 1.0))
        if not shares[-1] > 0:
            raise ModelError(key, f"{path}, line {row.number}: expected a share > 0, got {shares[-1]:g}")
    return {"points": tuple(points), "shares": tuple(shares) if "share" in names else ()}


def _on_edge(table: Table, mesh: MeshSource) -> tuple[Point, ...]:
    edge = table.take("edge", str)
    if edge not in mesh.edges:
        known = ", ".join(mesh.edges) or "none that is known before the file is read: use group"
        raise ModelError(table.key("edge"), f"expected one of {known}, got {edge!r}")
    count = table.take("count", int)
    if not 2 <= count <= 1_000_000:
        raise ModelError(table.key("count"), f"expected at least 2 points on an edge, and at most 1e6, got {count}")
    start, end = (np.array(p) for p in mesh.edges[edge])
    ratios = [i / (count - 1) for i in range(count)]
    return tuple((float(p[0]), float(p[1]), float(p[2])) for p in (start + (end - start) * s for s in ratios))


def _on_grid(table: Table) -> tuple[Point, ...]:
    """Read `grid = { from = [x, y, z], to = [x, y, z], count = [nx, ny, nz] }`: row by row, x fastest."""
    grid = Table(table.take("grid", dict), table.key("grid"))
    ends = [point_of(grid.take(name, list), grid.key(name)) for name in ("from", "to")]
    counts = [convert(n, int, grid.key("count")) for n in grid.take("count", list)]
    grid.finish()
    counts += [1] * (3 - len(counts))
    if len(counts) != 3 or min(counts) < 1 or np.prod(counts) > 1_000_000:
        raise ModelError(grid.key("count"), f"expected two or three numbers >= 1 and at most 1e6 points, got {counts}")
    for axis, count in enumerate(counts):
        if count == 1 and ends[0][axis] != ends[1][axis]:
            raise ModelError(grid.key("count"), f"expected at least 2 points along {'XYZ'[axis]}, where the grid has an extent")
    xs, ys, zs = (np.linspace(ends[0][k], ends[1][k], counts[k]).tolist() for k in range(3))
    return tuple((x, y, z) for z in zs for y in ys for x in xs)


def with_nodes(mesh: MeshSource, model: PlateModel) -> MeshSource:
    """Return joined plates with a node at every point of the model that something stands on; other meshes as they are."""
    if not isinstance(mesh, Panels):
        return mesh
    model = in_plane(model, mesh.level)
    groups = (*model.supports, *model.springs, *model.masses, *model.forces)
    return replace(mesh, nodes=tuple(dict.fromkeys(in_space(p) for group in groups for p in group.points if not isinstance(p, str))))
