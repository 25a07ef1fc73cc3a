"""The scene as a drawing to scale: plate, supports, springs, probes and the direction of the ground's motion, as SVG."""

from __future__ import annotations

from html import escape

import numpy as np

from uplift.drivers.report.charts import is_flat, loops, outline, up_axis
from uplift.drivers.results.results import Results

WIDTH = 460
"""Of the drawing in px; its height follows from the plate."""

MARGIN = 74

YAW, PITCH = np.radians(32.0), np.radians(22.0)

APART = 15.0
"""px between two supports at least: where they stand closer only every so-manieth is drawn."""


def projection(up: int, *, flat: bool) -> np.ndarray:
    """Return the matrix (2, 3) that takes a point to the drawing, right and upwards; lengths keep their scale in a flat one."""
    if flat:
        return np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    first, second = (up + 1) % 3, (up + 2) % 3
    matrix = np.zeros((2, 3))
    matrix[0, first], matrix[0, second] = np.cos(YAW), np.sin(YAW)
    matrix[1, first], matrix[1, second] = -np.sin(PITCH) * np.sin(YAW), np.sin(PITCH) * np.cos(YAW)
    matrix[1, up] = np.cos(PITCH)
    return matrix


class _Drawing:
    """Takes points in m to px."""

    def __init__(self, matrix: np.ndarray, points: np.ndarray) -> None:
        self.matrix = matrix
        seen = points @ matrix.T
        self.low, span = seen.min(axis=0), np.ptp(seen, axis=0)
        self.scale = (WIDTH - 2 * MARGIN) / max(span[0], 1e-12)
        tallest = 1.25 * WIDTH
        if self.scale * span[1] > tallest - 2 * MARGIN:
            self.scale = (tallest - 2 * MARGIN) / span[1]
        self.size = self.scale * span
        self.left = (WIDTH - self.size[0]) / 2
        self.height = float(self.size[1] + 2 * MARGIN)

    def at(self, points: np.ndarray) -> np.ndarray:
        """Return px (n, 2) of points (n, 3) m."""
        seen = (np.atleast_2d(points) @ self.matrix.T - self.low) * self.scale
        return np.column_stack([self.left + seen[:, 0], self.height - MARGIN - seen[:, 1]])

    def along(self, direction: np.ndarray) -> np.ndarray:
        """Return the unit vector (2,) in px of a direction (3,); upwards where it is seen end-on."""
        seen = self.matrix @ direction * [1.0, -1.0]
        length = float(np.linalg.norm(seen))
        return seen / length if length > 1e-6 else np.array([0.0, -1.0])


def scene_svg(results: Results) -> str:
    """Return the drawing, empty where the results hold no mesh."""
    plate = results.plate
    if plate is None:
        return ""
    drawing = _Drawing(projection(up_axis(results), flat=is_flat(plate)), plate.points)
    corners = plate.corners
    px = drawing.at(plate.points)
    around = "".join(f"M{'L'.join(_xy(p) for p in px[loop])}Z" for loop in loops(outline(corners)))
    parts = []
    if len(corners) <= 1500:
        parts += [f'<polygon class="cell" points="{_path(cell)}"/>' for cell in px[corners]]
    else:
        parts.append(f'<path class="cell" fill-rule="evenodd" d="{around}"/>')
    parts.append(f'<path class="outline" d="{around}"/>')
    contacts, directions = results.points.get("contacts", np.zeros((0, 3))), results.points.get("directions", np.zeros((0, 3)))
    every = _every(drawing.at(contacts)) if len(contacts) else 1
    for point, direction in zip(contacts[::every], directions[::every], strict=True):
        parts.append(_support(drawing.at(point)[0], drawing.along(direction)))
    down = np.array([0.0, 1.0])
    for points, kind in ((results.points.get("bonded"), "bonded"), (results.points.get("springs"), "spring")):
        if points is not None and len(points):
            for point in points[:: _every(drawing.at(points))]:
                away = -down if _high(point, plate.points, up_axis(results)) else down
                parts.append(_spring(drawing.at(point)[0], away, kind))
    for name, px in zip(results.probe_names, drawing.at(results.points["probes"]), strict=True):
        parts.append(f'<circle class="probe" cx="{px[0]:.1f}" cy="{px[1]:.1f}" r="4.5"/>')
        right = px[0] < WIDTH - 60
        parts.append(f'<text class="name" x="{px[0] + (9 if right else -9):.1f}" y="{px[1] - 8:.1f}" '
                     f'text-anchor="{"start" if right else "end"}">{escape(name)}</text>')
    parts += _dimensions(results, drawing)
    title = f"The scene to scale: {len(plate.cells)} cells, {len(contacts)} contacts"
    return (f'<svg class="scene" viewBox="0 0 {WIDTH} {drawing.height:.0f}" role="img" aria-label="{escape(title)}">'
            f'{"".join(parts)}</svg>')


def _high(point: np.ndarray, points: np.ndarray, up: int) -> bool:
    """Whether a spring stands nearer to the top than to the foot."""
    return bool(point[up] > points[:, up].mean())


def _every(px: np.ndarray) -> int:
    """Return of how many points in px one is drawn, so that they keep their distance along the longer side of their box."""
    room = float(np.ptp(px, axis=0).max()) / APART
    return max(1, int(np.ceil((len(px) - 1) / max(room, 1.0))))


def _path(points: np.ndarray) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def _support(px: np.ndarray, push: np.ndarray) -> str:
    """Draw a spring that pushes along `push` (px), its plate not fastened, on hatched ground."""
    side = np.array([-push[1], push[0]])
    top, foot = px - 3 * push, px - 30 * push
    zigzag = [top - 6 * push]
    zigzag += [top - (9 + 4 * i) * push + (5 if i % 2 else -5) * side for i in range(4)]
    zigzag += [foot + 2 * push, foot]
    plate = f"M{_xy(top + 7 * side)}L{_xy(top - 7 * side)}M{_xy(top)}L{_xy(zigzag[0])}"
    spring = "M" + "L".join(_xy(p) for p in zigzag)
    ground = f"M{_xy(foot + 9 * side)}L{_xy(foot - 9 * side)}"
    hatch = "".join(f"M{_xy(foot + k * side)}l{_xy(-5 * push + 3 * side)}" for k in (-8, -3, 2, 7))
    return f'<path class="support" d="{plate}{spring}{ground}"/><path class="hatch" d="{hatch}"/>'


def _spring(px: np.ndarray, away: np.ndarray, kind: str) -> str:
    side = np.array([-away[1], away[0]])
    foot = px + 26 * away
    zigzag = [px, px + 4 * away, *(px + (7 + 4 * i) * away + (4 if i % 2 else -4) * side for i in range(4)), px + 22 * away, foot]
    return f'<path class="{kind}" d="M{"L".join(_xy(p) for p in zigzag)}M{_xy(foot + 7 * side)}L{_xy(foot - 7 * side)}"/>'


def _xy(point: np.ndarray) -> str:
    return f"{point[0]:.1f} {point[1]:.1f}"


def _dimensions(results: Results, drawing: _Drawing) -> list[str]:
    """Return lengths, axes and the arrow of the ground's motion."""
    assert results.plate is not None
    points, flat = results.plate.points, is_flat(results.plate)
    span = np.ptp(points, axis=0)
    bottom, left = drawing.height - MARGIN, drawing.left
    parts = []
    if flat:
        right, y = left + drawing.size[0], drawing.height - 22
        parts.append(f'<path class="dimension" d="M{left:.1f} {y}H{right:.1f}M{left:.1f} {y - 4}v8M{right:.1f} {y - 4}v8"/>')
        parts.append(f'<text class="length" x="{(left + right) / 2:.1f}" y="{y + 15}" text-anchor="middle">{span[0]:.4g} m</text>')
        x, top = left - 26, bottom - drawing.size[1]
        parts.append(f'<path class="dimension" d="M{x:.1f} {top:.1f}V{bottom:.1f}M{x - 4:.1f} {top:.1f}h8M{x - 4:.1f} {bottom:.1f}h8"/>')
        middle = (top + bottom) / 2
        parts.append(f'<text class="length" transform="translate({x - 6:.1f} {middle:.1f}) rotate(-90)" text-anchor="middle">'
                     f"{span[1]:.4g} m</text>")
    else:
        words = " × ".join(f"{length:.4g}" for length in span if length > 1e-9 * span.max())
        parts.append(f'<text class="length" x="{WIDTH / 2}" y="{drawing.height - 8:.0f}" text-anchor="middle">{words} m</text>')
    origin = np.array([26.0, 46.0])
    for axis, label in enumerate("XYZ"):
        if flat and axis == 2:
            continue
        seen = drawing.matrix[:, axis] * [1.0, -1.0]
        tip = origin + 26 * seen
        parts.append(f'<path class="axis" d="M{_xy(origin)}L{_xy(tip)}"/>')
        name = origin + 37 * seen
        parts.append(f'<text class="axisname" x="{name[0]:.1f}" y="{name[1] + 4:.1f}" text-anchor="middle">{label}</text>')
    ground = results.series.get("ground/acceleration")
    if ground is not None:
        for axis in np.flatnonzero(np.abs(ground.values).max(axis=0) > 0):
            along = drawing.along(np.eye(3)[axis])
            middle = np.array([WIDTH - 38.0, 16.0 if abs(along[1]) < 0.1 else 36.0])
            a, b = middle - 30 * along, middle + 30 * along
            side = np.array([-along[1], along[0]])
            barbs = ((tip, tip - sense * 7 * along) for tip, sense in ((a, -1), (b, 1)))
            heads = "".join(f"M{_xy(back + 4 * side)}L{_xy(tip)}L{_xy(back - 4 * side)}" for tip, back in barbs)
            parts.append(f'<path class="motion" d="M{_xy(a)}L{_xy(b)}{heads}"/>')
        if np.any(ground.values):
            parts.append(f'<text class="motionname" x="{WIDTH - 78}" y="20" text-anchor="end">ground motion</text>')
    return parts
