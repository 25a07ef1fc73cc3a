"""Mesh files of the benchmarks that no rectangle or polygon fits: a part of a cylinder, and a disc, as .msh with named groups."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from uplift.meshes.gmsh_session import gmsh_session


def write_cylinder(path: Path, radius: float, angle: float, length: float, cells: int, cell: str = "quadrilateral") -> None:
    """Write a part of a cylinder about the axis Y, from its crown on Z (0) to `angle` in degrees, `cells` along either side, in m.

    Groups: surface SHELL; edges CROWN and SIDE along Y, MIDDLE at y = 0 and END at y = length; points TOP (crown, y = 0) and
    CORNER (`angle`, y = 0). Call on one rank only.
    """
    with gmsh_session() as gmsh:
        model, occ = gmsh.model, gmsh.model.occ
        model.add("cylinder")
        turn, axis = math.radians(angle), occ.addPoint(0, 0, 0)
        top = occ.addPoint(0, 0, radius)
        corner = occ.addPoint(radius * math.sin(turn), 0, radius * math.cos(turn))
        arc = occ.addCircleArc(top, axis, corner)
        swept = occ.extrude([(1, arc)], 0, length, 0)
        occ.remove([(0, axis)])
        occ.synchronize()
        shell = next(tag for dimension, tag in swept if dimension == 2)
        names = {arc: "MIDDLE", next(tag for dimension, tag in swept if dimension == 1): "END"}
        for _, tag in model.getBoundary([(2, shell)], oriented=False):
            names.setdefault(tag, "CROWN" if (0, top) in model.getBoundary([(1, tag)], oriented=False) else "SIDE")
            model.mesh.setTransfiniteCurve(tag, cells + 1)
        model.mesh.setTransfiniteSurface(shell)
        groups = {"SHELL": (2, shell), **{name: (1, tag) for tag, name in names.items()}, "TOP": (0, top), "CORNER": (0, corner)}
        _write(gmsh, path, groups, cell)


def write_disc(path: Path, radius: float, size: float, cell: str = "quadrilateral") -> None:
    """Write a disc about the origin in the plane XY, cells with sides of `size` m and its edge a polygon of their sides.

    Groups: surface DISC, edge RIM. Call on one rank only.
    """
    with gmsh_session() as gmsh:
        model = gmsh.model
        model.add("disc")
        disc = model.occ.addDisk(0, 0, 0, radius, radius)
        model.occ.synchronize()
        (_, rim), *_ = model.getBoundary([(2, disc)], oriented=False)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        if cell == "quadrilateral":  # splitting larger cells leaves no triangle
            gmsh.option.setNumber("Mesh.MeshSizeMax", 2 * size)
            gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", 1)
        _write(gmsh, path, {"DISC": (2, disc), "RIM": (1, rim)}, cell)


def _write(gmsh: Any, path: Path, groups: dict[str, tuple[int, int]], cell: str) -> None:
    model = gmsh.model
    for number, (name, (dimension, tag)) in enumerate(groups.items(), start=1):
        model.addPhysicalGroup(dimension, [tag], number)
        model.setPhysicalName(dimension, number, name)
        if dimension == 2 and cell == "quadrilateral":
            model.mesh.setRecombine(2, tag)
    model.mesh.generate(2)
    gmsh.write(str(path))
