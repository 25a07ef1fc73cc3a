"""Flat polygonal plates with holes, anywhere in space: their parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uplift.meshes.checked import Checked, ModelError, quantity
from uplift.meshes.outlines import TOUCHING, area_vector, check_outlines
from uplift.meshes.plate import MOST_CELLS, Point

LEAST = 1e-5
"""m; what is closer than 1e-7 m is one to the geometry kernel."""

FOLDED = 1e-6
"""Part of the area by which cells may miss the plates."""

TINY = 10 * TOUCHING
"""Of the extent: edges and cells must be longer, so that their ends can be told apart."""


@dataclass(frozen=True)
class Panel(Checked):
    """A flat polygon with holes; its edges are numbered or named in the order of its corners."""

    name: str = quantity("name of the group of its cells")
    corners: tuple[Point, ...] = quantity("corners in order around the plate", "m")
    holes: tuple[tuple[Point, ...], ...] = quantity("corners of each hole", "m", default=())
    edge_names: tuple[str, ...] = quantity("a name for each edge, the first from corner 1 to corner 2", default=())

    def check(self) -> None:
        """Refuse what is no flat polygon."""
        check_outlines(np.array(self.corners).reshape(-1, 3), [np.array(hole).reshape(-1, 3) for hole in self.holes])
        if self.edge_names and len(self.edge_names) != len(self.corners):
            raise ModelError("edges", f"expected {len(self.corners)} names, one an edge, got {len(self.edge_names)}")

    @property
    def area(self) -> float:
        """Area in m2, holes included."""
        return float(np.linalg.norm(area_vector(np.array(self.corners))))

    @property
    def sides(self) -> list[tuple[str, Point, Point]]:
        """Name of each edge and its ends in m, in the order of the corners; several edges may bear one name."""
        names = self.edge_names or tuple(f"{self.name}.{i + 1}" for i in range(len(self.corners)))
        return list(zip(names, self.corners, self.corners[1:] + self.corners[:1], strict=True))


@dataclass(frozen=True)
class Panels(Checked):
    """Plates joined where they touch; four-sided ones without holes get a regular mesh where the divisions of opposite sides agree."""

    plates: tuple[Panel, ...] = quantity("the plates")
    size: float = quantity("length of the sides of the cells", "m", above=0.0)
    cell: str = quantity("shape of the cells", default="quadrilateral", one_of=("quadrilateral", "triangle"))
    degree: int | None = quantity("polynomial degree of the displacement", default=None, at_least=1, at_most=3)
    named_points: tuple[tuple[str, Point], ...] = quantity("points that become nodes, by name", "m", default=())
    nodes: tuple[Point, ...] = quantity("further points that become nodes", "m", default=())

    def check(self) -> None:
        """Refuse an empty list, plates of one name and a mesh beyond any machine."""
        if not self.plates:
            raise ModelError("plates", "expected at least one plate")
        names = [plate.name for plate in self.plates]
        for name in names:
            if names.count(name) > 1:
                raise ModelError("plates", f"expected different names, {name!r} is there twice")
        for plate in self.plates:
            for name, _, _ in plate.sides:
                if name in names:
                    raise ModelError(f"plates[{plate.name}].edges", f"expected a name that no plate has, got {name!r}")
        if not self.cells <= MOST_CELLS:
            raise ModelError("size", f"expected at most {MOST_CELLS:.0e} cells, {self.size:g} m makes more")
        shortest = min(math.dist(start, end) for plate in self.plates for _, start, end in plate.sides)
        least = max(TINY * self.extent, LEAST)
        if not min(shortest, self.size) > least:
            raise ModelError(
                "plates", f"expected edges and cells longer than {least:g} m, where all plates together extend over {self.extent:g} m; "
                f"the shortest edge is {shortest:g} m, a cell {self.size:g} m"
            )

    @property
    def area(self) -> float:
        """Area in m2, holes included."""
        return sum(plate.area for plate in self.plates)

    @property
    def cells(self) -> float:
        """How many cells it takes, near enough; of a strip narrower than a cell as many as fit along it."""
        along = [sum(math.dist(start, end) for _, start, end in plate.sides) / 2 for plate in self.plates]
        return sum(max(p.area / self.size / self.size, length / self.size) for p, length in zip(self.plates, along, strict=True))

    @property
    def corners(self) -> dict[str, Point]:
        """Coordinates in m of the named points."""
        return dict(self.named_points)

    @property
    def edges(self) -> dict[str, tuple[Point, Point]]:
        """Ends in m of each edge of each plate; of edges of one name the first."""
        result: dict[str, tuple[Point, Point]] = {}
        for plate in self.plates:
            for name, *ends in plate.sides:
                result.setdefault(name, (ends[0], ends[1]))
        return result

    @property
    def flat(self) -> bool:
        """Whether all plates lie in a plane of one height Z."""
        heights = [corner[2] for plate in self.plates for corner in plate.corners]
        return max(heights) - min(heights) <= 1e-9 * self.extent

    @property
    def level(self) -> float:
        """The height Z in m of flat plates, 0 of others."""
        return self.plates[0].corners[0][2] if self.flat else 0.0

    @property
    def extent(self) -> float:
        """The longest side in m of the box that holds all plates."""
        return float(np.ptp(np.concatenate([np.array(plate.corners) for plate in self.plates]), axis=0).max())
