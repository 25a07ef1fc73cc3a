"""Flat polygonal plates with holes, anywhere in space, joined where they touch, as a gmsh mesh with named groups."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uplift.meshes.checked import ModelError
from uplift.meshes.findings import say
from uplift.meshes.gmsh_session import gmsh_session
from uplift.meshes.joining import check_hanging, check_joined
from uplift.meshes.outlines import TOUCHING, area_vector
from uplift.meshes.panels import FOLDED, Panel, Panels
from uplift.meshes.plain import mesh_of_model, place_in_words
from uplift.meshes.plate import Point

INNER_NODES = {1: (), 2: (0.5,), 3: (0.5 - 0.2236067977499790, 0.5 + 0.2236067977499790)}
"""Places of the inner nodes of an edge by degree: the Gauss-Lobatto points."""


def on_segment(points: np.ndarray, start: Point | np.ndarray, end: Point | np.ndarray, tolerance: float) -> np.ndarray:
    """Tell which of `points` (n, 3) lie on the segment, within `tolerance` m."""
    a, along = np.array(start), np.array(end) - np.array(start)
    ratio = np.clip((points - a) @ along / (along @ along), 0.0, 1.0)
    near: np.ndarray = np.linalg.norm(points - a - ratio[:, None] * along, axis=1) <= tolerance
    return near


ALGORITHMS = ((6, 1), (6, 0), (5, 0), (8, 0), (1, 0))
"""gmsh's numbers of algorithms in the plane (frontal, Delaunay, frontal for quadrilaterals, mesh adaptation) and to make quadrilaterals."""


@contextmanager
def panels_model(panels: Panels) -> Iterator[tuple[Any, dict[str, list[tuple[int, int]]]]]:
    """Give the gmsh model of the meshed plates and the entities (dimension, tag) of each group; gmsh is closed on leaving.

    Call on one rank only. Groups: the cells of each plate and its edges. Named points and further nodes become nodes of the mesh.
    """
    wanted = np.array([*dict(panels.named_points).values(), *panels.nodes]).reshape(-1, 3)
    wanted = np.unique(np.round(wanted, 12), axis=0)
    with gmsh_session() as gmsh:
        try:
            groups = _meshed(gmsh, panels, wanted, TOUCHING * panels.extent)
        except Exception as error:
            if type(error) is not Exception:
                raise
            # What gmsh raises is of no class of its own.
            raise ModelError("mesh.plates", f"gmsh cannot mesh these plates: {' '.join(str(error).split())}") from None
        yield gmsh.model, groups


def _meshed(gmsh: Any, panels: Panels, wanted: np.ndarray, tolerance: float) -> dict[str, list[tuple[int, int]]]:
    """Mesh the plates with nodes at the points `wanted` (n, 3) m; return the groups."""
    # Where the points on the edges are nodes of the regular divisions they need not cut them into pieces.
    on_curve = np.zeros(len(wanted), dtype=bool)
    for cut in (False, True):
        groups = _geometry(gmsh, panels, wanted[on_curve] if cut else wanted[:0], tolerance)
        if not cut:
            for _, curve in gmsh.model.getEntities(1):
                start, end = _ends(gmsh.model, curve)
                on_curve |= on_segment(wanted, start, end, tolerance)
        plan = _plan(gmsh.model, panels, wanted[~on_curve], tolerance)
        if cut or (plan.coarser == 1 and _all_stations(gmsh.model, plan.divisions, wanted[on_curve], panels.degree or 1, tolerance)):
            break
        gmsh.model.remove()
    _warn_of_overlaps([plate.name for plate in panels.plates], groups)
    _mesh(gmsh, panels, plan, tolerance)
    check_plates_joined(gmsh.model, groups)
    return groups


def _warn_of_overlaps(names: list[str], groups: dict[str, list[tuple[int, int]]]) -> None:
    for i, one in enumerate(names):
        for other in names[:i]:
            if not set(groups[one]).isdisjoint(groups[other]):
                say("overlap", f"the plates {other!r} and {one!r} lie on each other, in part or whole; what both cover is there once")


def _geometry(gmsh: Any, panels: Panels, splitting: np.ndarray, tolerance: float) -> dict[str, list[tuple[int, int]]]:
    """Make the plates, joined where they touch and their edges cut at the points `splitting` (n, 3) m; return their groups."""
    model, occ = gmsh.model, gmsh.model.occ
    model.add("plates")
    surfaces = [(2, occ.addPlaneSurface([_loop(occ, outline) for outline in _outlines(plate)])) for plate in panels.plates]
    tools = surfaces[1:] + [(0, occ.addPoint(*point)) for point in splitting]
    pieces = occ.fragment(surfaces[:1], tools)[1] if tools else [surfaces]
    occ.synchronize()
    groups: dict[str, list[tuple[int, int]]] = {}
    for plate, made in zip(panels.plates, pieces, strict=False):
        groups.setdefault(plate.name, []).extend(made)
        _name_edges(model, plate, made, groups, tolerance)
    return groups


def _outlines(plate: Panel) -> Iterator[tuple[Point, ...]]:
    """Give the corners and those of the holes, all turning the same way, which gmsh counts on."""
    normal = area_vector(np.array(plate.corners))
    for outline in (plate.corners, *plate.holes):
        yield outline if area_vector(np.array(outline)) @ normal > 0 else outline[::-1]


def _loop(occ: Any, corners: tuple[Point, ...]) -> int:
    tags = [occ.addPoint(*corner) for corner in corners]
    return int(occ.addCurveLoop([occ.addLine(a, b) for a, b in zip(tags, tags[1:] + tags[:1], strict=True)]))


def _ends(model: Any, curve: int) -> np.ndarray:
    """Return the ends (2, 3) m of a straight curve."""
    low, high = model.getParametrizationBounds(1, curve)
    return np.array(model.getValue(1, curve, [low[0], high[0]])).reshape(2, 3)


def _name_edges(
    model: Any, plate: Panel, surfaces: list[tuple[int, int]], groups: dict[str, list[tuple[int, int]]], tolerance: float
) -> None:
    rim = {abs(tag) for _, tag in model.getBoundary(surfaces, combined=False)}
    for name, start, end in plate.sides:
        curves = groups.setdefault(name, [])
        for tag in sorted(rim):
            if np.all(on_segment(_ends(model, tag), start, end, tolerance)) and (1, tag) not in curves:
                curves.append((1, tag))


@dataclass
class _Plan:
    """How the plates are to be meshed."""

    divisions: dict[int, int]
    """Of each curve."""
    regular: dict[int, list[int]]
    """Corner points of each surface with a regular mesh."""
    unrestrained: dict[int, np.ndarray]
    """Points (n, 3) m that become nodes of each other surface."""
    coarser: int
    """2 where each cell of a mesh twice as coarse is split into three or four quadrilaterals, which fit any outline; else 1."""


def _plan(model: Any, panels: Panels, inside: np.ndarray, tolerance: float) -> _Plan:
    for coarser in (1, 2):
        lengths = {tag: float(np.linalg.norm(np.diff(_ends(model, tag), axis=0))) for _, tag in model.getEntities(1)}
        divisions = {tag: coarser * max(1, round(length / (coarser * panels.size))) for tag, length in lengths.items()}
        regular, unrestrained = {}, {}
        for _, surface in model.getEntities(2):
            # A regular mesh passes over the lines and points at which other plates touch this one.
            touched = len(model.mesh.getEmbedded(2, surface)) > 0
            corners = None if touched else _regular_corners(model, surface, divisions)
            here = inside[_within(model, surface, inside, tolerance)]
            if corners is not None and _on_grid(model, surface, corners, divisions, here, panels.degree or 1, tolerance):
                regular[surface] = corners
            else:
                unrestrained[surface] = here
        if not unrestrained or panels.cell == "triangle":
            break
    return _Plan(divisions, regular, unrestrained, coarser if unrestrained else 1)


def _mesh(gmsh: Any, panels: Panels, plan: _Plan, tolerance: float) -> None:
    """Mesh the plates as planned, by the first of `ALGORITHMS` that makes cells that fit. Raises `ModelError` if none does."""
    model = gmsh.model
    gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", plan.coarser - 1)
    gmsh.option.setNumber("Mesh.MeshSizeMax", plan.coarser * panels.size)
    gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
    for tag, number in plan.divisions.items():
        model.mesh.setTransfiniteCurve(tag, number // plan.coarser + 1)
    for surface, corners in plan.regular.items():
        model.mesh.setTransfiniteSurface(surface, cornerTags=corners)
    kept = False
    for surface, points in plan.unrestrained.items():
        tags = [model.occ.addPoint(*point) for point in points]
        model.occ.synchronize()
        if tags:
            model.mesh.embed(0, tags, 2, surface)
        kept = kept or len(model.mesh.getEmbedded(2, surface)) > 0
    if panels.cell == "quadrilateral":
        for _, surface in model.getEntities(2):
            model.mesh.setRecombine(2, surface)
    # The usual recombination, Blossom, folds cells around nodes that it has to keep.
    for last, (plane, recombination) in enumerate(ALGORITHMS[1:] if kept else ALGORITHMS, start=2 if kept else 1):
        gmsh.option.setNumber("Mesh.Algorithm", plane)
        gmsh.option.setNumber("Mesh.RecombinationAlgorithm", recombination)
        model.mesh.clear()
        try:
            model.mesh.generate(2)
            return check_cells(model, tolerance)
        except Exception as error:  # gmsh raises plain exceptions
            if last == len(ALGORITHMS) or type(error) not in (Exception, ModelError):
                raise


def check_cells(model: Any, tolerance: float) -> None:
    """Raise `ModelError` unless the cells are convex, all of one shape, and cover the plates once."""
    tags, coordinates, _ = model.mesh.getNodes()
    place = np.zeros(int(tags.max()) + 1, dtype=int)
    place[tags.astype(int)] = np.arange(len(tags))
    covered, convex, centres = 0.0, len(model.mesh.getElementTypes(2)) == 1, {}
    for _, surface in model.getEntities(2):
        for numbers, nodes in zip(*model.mesh.getElements(2, surface)[1:], strict=True):
            corners = coordinates.reshape(-1, 3)[place[nodes.astype(int)]].reshape(len(numbers), -1, 3)
            arms = np.roll(corners, -1, axis=1) - corners
            turns = np.cross(np.roll(arms, 1, axis=1), arms)
            areas = 0.5 * np.cross(corners[:, 1] - corners[:, -1], corners[:, -2] - corners[:, 0])
            convex = convex and bool(np.all(np.sum(turns * areas[:, None], axis=2) > 0))
            covered += float(np.sum(np.linalg.norm(areas, axis=1)))
            centres[surface] = corners.mean(axis=1)
    whole = sum(model.occ.getMass(2, surface) for _, surface in model.getEntities(2))
    if not convex or abs(covered - whole) > FOLDED * whole:
        raise ModelError("mesh.plates", "gmsh makes cells that are folded or of several shapes; another size, or cell = 'triangle'")
    for surface in centres if len(centres) > 1 else ():
        if np.any(_within(model, surface, np.concatenate([own for other, own in centres.items() if other != surface]), tolerance)):
            raise ModelError("mesh.plates", "some plates lie on each other, and gmsh cannot join them; let none cover another")


def check_plates_joined(model: Any, groups: dict[str, list[tuple[int, int]]]) -> None:
    """Raise `ModelError` unless plates that touch share the nodes there: on lines and points of the geometry, and node by node."""
    names = {tag: name for name, entities in groups.items() for dimension, tag in entities if dimension == 2}
    for _, surface in model.getEntities(2):
        own = np.concatenate([np.zeros(0, dtype=int), *model.mesh.getElements(2, surface)[2]])
        touching = [*model.getBoundary([(2, surface)], combined=False, oriented=False), *model.mesh.getEmbedded(2, surface)]
        for dimension, tag in touching:
            nodes = model.mesh.getNodes(dimension, abs(tag), includeBoundary=True)[0]
            if not np.isin(nodes, own).all():
                at = place_in_words(model.mesh.getNode(nodes[~np.isin(nodes, own)][0])[0])
                name = names.get(surface, "")
                raise ModelError("mesh.plates", f"the plate {name!r} is not joined at {at} to the one that touches it there")
    mesh, surfaces = mesh_of_model(model)
    plates = {name: [tag for dimension, tag in entities if dimension == 2] for name, entities in groups.items()}
    mesh = replace(mesh, cell_groups={n: np.flatnonzero(np.isin(surfaces, tags)) for n, tags in plates.items() if tags})
    check_joined(mesh, (), "mesh.plates", "give both the same coordinates there")
    check_hanging(mesh, (), "mesh.plates")


def _stations(start: float, end: float, divisions: int, degree: int) -> np.ndarray:
    """Return the nodes of `divisions` cells of `degree` between two coordinates."""
    cells = np.linspace(start, end, divisions + 1)
    return np.concatenate([cells] + [cells[:-1] + x * np.diff(cells) for x in INNER_NODES[degree]])


def _all_stations(model: Any, divisions: dict[int, int], points: np.ndarray, degree: int, tolerance: float) -> bool:
    """Tell whether each of `points` (n, 3) m is a node of a curve as it is divided."""
    found = np.zeros(len(points), dtype=bool)
    for tag, number in divisions.items():
        start, end = _ends(model, tag)
        nodes = start + _stations(0.0, 1.0, number, degree)[:, None] * (end - start)
        found |= np.min(np.linalg.norm(points[:, None] - nodes, axis=2), axis=1, initial=np.inf) <= tolerance
    return bool(np.all(found))


def _sides(model: Any, surface: int) -> list[list[tuple[int, int, int]]] | None:
    """Return the curves (curve, first point, last point) of each of the four straight sides in order; None for other shapes."""
    curves = {}
    for _, signed in model.getBoundary([(2, surface)], combined=False, oriented=True):
        first, last = (tag for _, tag in model.getBoundary([(1, abs(signed))], combined=False))
        if signed < 0:
            first, last = last, first
        curves[first] = (abs(signed), first, last)
    start = next(iter(curves))
    chain = [curves[start]]
    while chain[-1][2] != start:
        if chain[-1][2] not in curves or len(chain) > len(curves):
            return None
        chain.append(curves[chain[-1][2]])
    if len(chain) != len(curves):
        return None  # a hole
    at = {first: np.array(model.getValue(0, first, [])) for _, first, _ in chain}
    directions = [(at[last] - at[first]) / math.dist(at[last], at[first]) for _, first, last in chain]
    turns = [i for i in range(len(chain)) if np.linalg.norm(np.cross(directions[i - 1], directions[i])) > 1e-6]
    if len(turns) != 4:
        return None
    chain = chain[turns[0] :] + chain[: turns[0]]
    cuts = [t - turns[0] for t in turns] + [len(chain)]
    return [chain[a:b] for a, b in zip(cuts[:-1], cuts[1:], strict=True)]


def _regular_corners(model: Any, surface: int, divisions: dict[int, int]) -> list[int] | None:
    """Return the four corner points of a surface that a regular mesh fits on, or None."""
    sides = _sides(model, surface)
    if sides is None:
        return None
    counts = [[divisions[curve] for curve, _, _ in side] for side in sides]
    if sum(counts[0]) != sum(counts[2]) or sum(counts[1]) != sum(counts[3]):
        return None
    return [side[0][1] for side in sides]


def _within(model: Any, surface: int, points: np.ndarray, tolerance: float) -> np.ndarray:
    """Tell which of `points` (n, 3) m lie in the surface: a ray from there crosses its boundary an odd number of times."""
    segments = np.array([_ends(model, tag) for _, tag in model.getBoundary([(2, surface)], combined=False, oriented=False)])
    frame = np.linalg.svd(segments.reshape(-1, 3) - segments[0, 0])[2]
    arms = points - segments[0, 0]
    flat = np.abs(arms @ frame[2]) <= tolerance
    (px, py), ends = frame[:2] @ arms.T, (segments - segments[0, 0]) @ frame[:2].T
    (x0, y0), (x1, y1) = ends[:, 0].T, ends[:, 1].T
    above = (y0[None] > py[:, None]) != (y1[None] > py[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = x0 + (py[:, None] - y0) / (y1 - y0) * (x1 - x0)
    inside: np.ndarray = flat & (np.sum(above & (px[:, None] < crossing), axis=1) % 2 == 1)
    return inside


def _on_grid(
    model: Any, surface: int, corners: list[int], divisions: dict[int, int], points: np.ndarray, degree: int, tolerance: float
) -> bool:
    """Tell whether all `points` (n, 3) m are nodes of the regular mesh of a parallelogram with cells of `degree`."""
    if not len(points):
        return True
    sides = _sides(model, surface)
    assert sides is not None
    a, b, c, d = (np.array(model.getValue(0, tag, [])) for tag in corners)
    if np.linalg.norm(a + c - b - d) > tolerance:
        return False
    stations = []
    for side, start, along in ((sides[0], a, b - a), (sides[3], a, d - a)):
        ratios = [0.0, 1.0]
        for curve, first, last in side:
            ends = [float((np.array(model.getValue(0, tag, [])) - start) @ along / (along @ along)) for tag in (first, last)]
            ratios += list(_stations(ends[0], ends[1], divisions[curve], degree))
        stations.append(np.array(ratios))
    frame = np.stack([b - a, d - a], axis=1)
    local = np.linalg.lstsq(frame, (points - a).T, rcond=None)[0]
    return all(
        np.min(np.abs(ratio - station)) * np.linalg.norm(frame[:, k]) <= tolerance
        for k, station in enumerate(stations) for ratio in local[k]
    )
