"""Outlines of flat polygons: what is none, and what lies too close to another."""

from __future__ import annotations

import numpy as np

from uplift.meshes.checked import ModelError

TOUCHING = 1e-7
"""Points closer than this part of the extent are one."""


def area_vector(corners: np.ndarray) -> np.ndarray:
    """Return the normal of a polygon (n, 3) m, of the length of its area in m2."""
    arms = corners - corners[0]
    return 0.5 * np.sum(np.cross(arms, np.roll(arms, -1, axis=0)), axis=0)


def check_outlines(corners: np.ndarray, holes: list[np.ndarray]) -> None:
    """Raise `ModelError` unless `corners` (n, 3) m go around a flat area, and each of `holes` (n, 3) m around one inside it by itself.

    Edges that meet elsewhere than at their common corner are refused as well as such that cross: gmsh does not survive them.
    """
    if len(corners) < 3:
        raise ModelError("corners", f"expected at least 3, got {len(corners)}")
    extent = float(np.ptp(corners, axis=0).max())
    tolerance, normal = TOUCHING * extent, area_vector(corners)
    if not np.linalg.norm(normal) > TOUCHING * extent**2:
        raise ModelError("corners", "expected corners around an area, these lie on a line or on a point, or their edges cross")
    normal /= np.linalg.norm(normal)
    if np.max(np.abs((corners - corners[0]) @ normal)) > tolerance:
        raise ModelError("corners", "expected corners in one plane")
    across = np.eye(3)[np.argmin(np.abs(normal))]
    axes = np.stack([np.cross(normal, across), across - (across @ normal) * normal])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    rim = (corners - corners[0]) @ axes.T
    if not _goes_around(rim, tolerance):
        raise ModelError("corners", "expected corners in order around the plate, these edges cross or meet")
    inner: list[np.ndarray] = []
    for number, hole in enumerate(holes, start=1):
        key = f"holes[{number}]"
        if len(hole) < 3:
            raise ModelError(key, f"expected at least 3 corners, got {len(hole)}")
        if np.max(np.abs((hole - corners[0]) @ normal)) > tolerance:
            raise ModelError(key, "expected corners in the plane of the plate")
        outline = (hole - corners[0]) @ axes.T
        if not _goes_around(outline, tolerance):
            raise ModelError(key, "expected corners in order around the hole, these edges cross or meet, or are a point")
        if not _inside(outline[0], rim) or _clearance(outline, rim).min() <= tolerance:
            raise ModelError(key, "expected a hole inside the plate that does not touch its edges")
        for other, before in enumerate(inner, start=1):
            if _inside(outline[0], before) or _inside(before[0], outline) or _clearance(outline, before).min() <= tolerance:
                raise ModelError(key, f"expected holes apart from each other, this one meets hole {other}")
        inner.append(outline)


def _goes_around(outline: np.ndarray, tolerance: float) -> bool:
    """Tell whether the edges of a polygon (n, 2) meet nowhere but at their common corners, and none is a point."""
    n = len(outline)
    steps = np.arange(n)
    after, beyond = (steps + 1) % n, (steps + 2) % n
    starts, ends = outline, outline[after]
    if np.linalg.norm(ends - starts, axis=1).min() <= tolerance:
        return False
    from_edges = _from_segments(outline, starts, ends)
    if min(from_edges[beyond, steps].min(), from_edges[steps, after].min()) <= tolerance:
        return False  # the next edge goes back along this one
    apart = _clearance(outline, outline)
    apart[steps, steps] = apart[steps, after] = apart[after, steps] = np.inf
    return bool(apart.min() > tolerance)


def _clearance(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the distances (n, m) in m of the edges of two polygons (n, 2) and (m, 2), zero where they cross."""
    a, b, c, d = one, np.roll(one, -1, axis=0), other, np.roll(other, -1, axis=0)
    near = [_from_segments(a, c, d), _from_segments(b, c, d), _from_segments(c, a, b).T, _from_segments(d, a, b).T]
    crossing = (_side(c, a, b) * _side(d, a, b) < 0).T & (_side(a, c, d) * _side(b, c, d) < 0)
    return np.where(crossing, 0.0, np.min(near, axis=0))


def _side(points: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the sign (n, m) that says on which side of each of the m lines each of the n points lies."""
    along, arms = ends - starts, points[:, None] - starts
    return np.sign(along[:, 0] * arms[..., 1] - along[:, 1] * arms[..., 0])


def _from_segments(points: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the distances (n, m) in m of points (n, 2) from segments between (m, 2) and (m, 2)."""
    along, arms = ends - starts, points[:, None] - starts
    squares = np.sum(along**2, axis=1)
    ratios = np.clip(np.sum(arms * along, axis=2) / np.where(squares > 0, squares, 1.0), 0.0, 1.0)
    return np.linalg.norm(arms - ratios[..., None] * along, axis=2)


def _inside(point: np.ndarray, outline: np.ndarray) -> bool:
    """Tell whether a ray from the point (2,) crosses the polygon (n, 2) an odd number of times."""
    (x0, y0), (x1, y1) = outline.T, np.roll(outline, -1, axis=0).T
    above = (y0 > point[1]) != (y1 > point[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = x0 + (point[1] - y0) / (y1 - y0) * (x1 - x0)
    return int(np.sum(above & (point[0] < crossing))) % 2 == 1
