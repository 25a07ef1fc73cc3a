"""The rectangular plate of SDLS119 as a structured gmsh mesh with named groups."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from uplift.meshes.checked import Checked, ModelError, quantity
from uplift.meshes.gmsh_session import gmsh_session

Point = tuple[float, float, float]
"""Coordinates in m."""

EDGES = ("DBAS", "DDRO", "DHAU", "DGAU")
"""Bottom, right, top and left edge, in the order of the boundary."""

LARGEST = 1e9
"""m: no coordinate is farther from the origin."""

MOST_CELLS = 1e8
"""No mesh has more."""


@dataclass(frozen=True)
class Plate(Checked):
    """A plate of width x height in the plane XY, its corner P1 at the origin, Y upwards."""

    width: float = quantity("extent along X", "m", above=0.0, at_most=LARGEST)
    height: float = quantity("extent along Y", "m", above=0.0, at_most=LARGEST)
    nx: int = quantity("cells along X", at_least=1, at_most=1_000_000)
    ny: int = quantity("cells along Y", at_least=1, at_most=1_000_000)
    cell: str = quantity("shape of the cells", default="quadrilateral", one_of=("quadrilateral", "triangle"))
    degree: int | None = quantity(
        "polynomial degree of the displacement; where it is not given, 1 for plane stress and what bending needs for plates and shells",
        default=None, at_least=1, at_most=3,
    )

    def check(self) -> None:
        """Refuse a mesh beyond any machine."""
        if self.nx * self.ny > MOST_CELLS:
            raise ModelError("nx", f"expected at most {MOST_CELLS:.0e} cells, got {self.nx} x {self.ny}")

    @property
    def corners(self) -> dict[str, Point]:
        """Coordinates in m of P1 (origin), P2, P3 and P4, counter-clockwise."""
        w, h = self.width, self.height
        return {"P1": (0.0, 0.0, 0.0), "P2": (w, 0.0, 0.0), "P3": (w, h, 0.0), "P4": (0.0, h, 0.0)}

    @property
    def edges(self) -> dict[str, tuple[Point, Point]]:
        """Ends in m of the four edges."""
        corners = list(self.corners.values())
        return {name: (corners[i], corners[(i + 1) % 4]) for i, name in enumerate(EDGES)}

    @property
    def extent(self) -> float:
        """The longer side in m."""
        return max(self.width, self.height)


@contextmanager
def gmsh_model(plate: Plate, order: int = 1) -> Iterator[Any]:
    """Give the gmsh model of the plate, meshed with cells of `order` (call on one rank only); gmsh is closed on leaving.

    Groups: surface DAL1, edges DBAS (y = 0), DDRO (x = width), DHAU (y = height), DGAU (x = 0), points P1 to P4.
    """
    with gmsh_session() as gmsh:
        model = gmsh.model
        model.add("plate")
        corners = {name: model.geo.addPoint(*at) for name, at in plate.corners.items()}
        tags = list(corners.values())
        edges = {name: model.geo.addLine(tags[i], tags[(i + 1) % 4]) for i, name in enumerate(EDGES)}
        surface = model.geo.addPlaneSurface([model.geo.addCurveLoop(list(edges.values()))])
        for name, tag in edges.items():
            cells = plate.nx if name in ("DBAS", "DHAU") else plate.ny
            model.geo.mesh.setTransfiniteCurve(tag, cells + 1)
        model.geo.mesh.setTransfiniteSurface(surface, cornerTags=tags)
        if plate.cell == "quadrilateral":
            model.geo.mesh.setRecombine(2, surface)
        model.geo.synchronize()
        groups = [(2, "DAL1", surface), *((1, n, t) for n, t in edges.items()), *((0, n, t) for n, t in corners.items())]
        for number, (dimension, name, tag) in enumerate(groups, start=1):
            model.addPhysicalGroup(dimension, [tag], number)
            model.setPhysicalName(dimension, number, name)
        model.mesh.generate(2)
        if order > 1:
            model.mesh.setOrder(order)
        yield model
