"""A mesh file for tests: a strip of distorted cells."""

import numpy as np

from uplift.meshes.gmsh_session import gmsh_session


def distorted(comm, folder, cell):
    """The name of a file in `folder` with a strip of 2 m x 1 m whose inner nodes are moved about.

    Groups: surface STRIP, edges LEFT (x = 0), RIGHT (x = 2), point CORNER at the origin.
    """
    if comm.rank == 0:
        _write(str(folder / "strip.msh"), cell)
    comm.barrier()
    return str(comm.bcast(folder / "strip.msh"))


def _write(path, cell, nx=6, ny=4):
    rng = np.random.default_rng(11)
    with gmsh_session() as gmsh:
        model, geo = gmsh.model, gmsh.model.geo
        model.add("strip")
        corners = [geo.addPoint(x, y, 0) for x, y in ((0, 0), (2, 0), (2, 1), (0, 1))]
        lines = [geo.addLine(corners[i], corners[(i + 1) % 4]) for i in range(4)]
        surface = geo.addPlaneSurface([geo.addCurveLoop(lines)])
        geo.synchronize()
        for line, n in zip(lines, (nx, ny, nx, ny), strict=True):
            model.mesh.setTransfiniteCurve(line, n + 1)
        model.mesh.setTransfiniteSurface(surface)
        if cell == "quadrilateral":
            model.mesh.setRecombine(2, surface)
        for number, (name, dimension, tag) in enumerate(
            (("STRIP", 2, surface), ("LEFT", 1, lines[3]), ("RIGHT", 1, lines[1]), ("CORNER", 0, corners[0])), start=1
        ):
            model.addPhysicalGroup(dimension, [tag], number)
            model.setPhysicalName(dimension, number, name)
        model.mesh.generate(2)
        tags, points, _ = model.mesh.getNodes(2, surface)
        for tag, point in zip(tags, points.reshape(-1, 3), strict=True):
            model.mesh.setNode(tag, point + [*rng.uniform(-0.06, 0.06, 2), 0.0], [])
        gmsh.write(path)
