"""Pictures of the plate in space: deformed, its modes, and the bed of its contacts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from uplift.drivers.report.figures import new_figure, wrapped

if TYPE_CHECKING:
    from uplift.meshes.gather import WholeMesh


class _View:
    """Where points in space are drawn: from the front if all of them lie and move in the plane XY, else from above one corner."""

    def __init__(self, points: np.ndarray, *moves: np.ndarray) -> None:
        self.flat = bool(np.ptp(points[:, 2]) == 0 and all(np.max(np.abs(move[:, 2]), initial=0.0) == 0 for move in moves))
        azimuth, elevation = np.radians(-62.0), np.radians(24.0)
        self._toward = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
        self._right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        self._up = np.cross(self._toward, self._right)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Return the coordinates (..., 2) on the picture of points (..., 3)."""
        return points[..., :2] if self.flat else np.stack([points @ self._right, points @ self._up], axis=-1)

    def far_first(self, cells: np.ndarray) -> np.ndarray:
        """Return the order in which cells (n, corners, 3) are painted."""
        return np.arange(len(cells)) if self.flat else np.argsort(cells.mean(axis=1) @ self._toward, kind="stable")

    def label(self, axis: Any, extent: float) -> None:
        """Label the axes of the picture, or draw the three of space into it."""
        if self.flat:
            axis.set_xlabel("X [m]")
            axis.set_ylabel("Y [m]")
            return
        axis.set_xticks([])
        axis.set_yticks([])
        for spine in axis.spines.values():
            spine.set_visible(False)
        low, high = np.array(axis.get_xlim()), np.array(axis.get_ylim())
        corner = np.array([low[0], high[0]]) + 0.1 * extent
        for k, name in enumerate("XYZ"):
            tip = corner + 0.12 * extent * self(np.eye(3)[k])
            axis.annotate("", xy=tip, xytext=corner, arrowprops={"arrowstyle": "->", "color": "0.3", "lw": 1.0})
            axis.text(*(corner + 1.25 * (tip - corner)), name, fontsize=9, color="0.3", ha="center", va="center")


def _paint(axis: Any, view: _View, points: np.ndarray, cells: np.ndarray, colours: np.ndarray | None, **style: Any) -> Any:
    """Paint cells (n, corners) of points (n_points, 3), filled by `colours` (n,) or as a grey net."""
    from matplotlib.collections import PolyCollection

    order = view.far_first(points[cells])
    many = len(cells) > 4000
    shown = view(points[cells[order]])
    if colours is None:
        faces = PolyCollection(shown, facecolors="none", edgecolors="0.8", linewidths=0.0 if many else 0.8, **style)
    else:
        edges = {"edgecolors": "face" if many else "white", "linewidths": 0.0 if many else 0.4}
        faces = PolyCollection(shown, array=colours[order], cmap="viridis", **edges, **style)
    axis.add_collection(faces)
    return faces


def draw_deformed(
    path: Path, mesh: WholeMesh, displacement: np.ndarray, supports: np.ndarray, open_: np.ndarray, title: str
) -> None:
    """Draw the plate as meshed and as deformed, to scale with the displacement (n, 3) m enlarged.

    `supports` (n_c, 3) m are the supports, `open_` (n_c,) tells which of them have lifted.
    """
    plain, corners = mesh.points, mesh.corners
    view = _View(plain, displacement)
    extent = float(np.max(np.ptp(plain, axis=0)))
    largest = float(np.max(np.abs(displacement), initial=0.0))
    factor = _round_down(0.08 * extent / largest) if largest > 0 else 1.0
    figure = new_figure(7.4, 7.4)
    axis = figure.add_subplot()
    if len(supports):
        below = view(supports) - np.array([0.0, 0.03 * extent])
        for mark, colour, label in ((~open_, "tab:blue", "support in contact"), (open_, "tab:red", "support lifted off")):
            if mark.any():
                size, layer = 9 if len(supports) <= 20 else 4, 1 if view.flat else 0
                axis.plot(*below[mark].T, "^", color=colour, ms=size, label=label, zorder=layer)
        axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=2, fontsize=9, frameon=False)
    _paint(axis, view, plain, corners, None)
    magnitude = 1e3 * np.linalg.norm(displacement, axis=1)[corners].mean(axis=1)
    faces = _paint(axis, view, plain + factor * displacement, corners, magnitude)
    figure.colorbar(faces, ax=axis, label="displacement relative to the base [mm]", shrink=0.8)
    axis.set_aspect("equal")
    axis.autoscale_view()
    axis.margins(0.06)
    view.label(axis, extent)
    figure.suptitle(wrapped(title, 85) + f"\ndisplacements x {factor:g}", fontsize=10)
    figure.savefig(path, dpi=120)


def draw_modes(
    path: Path, mesh: WholeMesh, labels: list[str], shapes: np.ndarray, held: dict[str, np.ndarray], title: str
) -> None:
    """Draw mode shapes (n_modes, n_nodes, 3), largest displacement 1, one panel each.

    `held` are the points (n, 3) m where supports or springs of each kind hold the plate.
    """
    plain, corners = mesh.points, mesh.corners
    view = _View(plain, *shapes)
    seen = view(plain)
    extent = float(np.max(np.ptp(plain, axis=0)))
    span_x, span_y = (float(s) for s in np.ptp(seen, axis=0) + 0.3 * extent)
    across = min(len(labels), 3)
    down = -(-len(labels) // across)
    width = min(3.4, 4.4 * span_x / span_y)
    figure = new_figure(max(across * (width + 0.15) + 1.6, 6.0), down * (width * span_y / span_x + 0.3) + 1.3)
    axes = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True)
    marks = {"support": {"marker": "^", "color": "tab:red"}, "plain spring": {"marker": "D", "color": "tab:orange", "mfc": "none"}}
    for axis in axes.flat[len(labels) :]:
        axis.set_axis_off()
    for axis, label, shape in zip(axes.flat, labels, shapes, strict=False):
        size = np.linalg.norm(shape, axis=1)[corners].mean(axis=1)
        _paint(axis, view, plain, corners, None)
        faces = _paint(axis, view, plain + 0.12 * extent * shape, corners, size, clim=(0.0, 1.0))
        for kind, points in held.items():
            if len(points):
                marked = {"ls": "none", "ms": 6 if len(points) <= 20 else 2.5, "label": kind, **marks[kind]}
                axis.plot(*view(points).T, clip_on=False, zorder=3, **marked)
        axis.set_title(label, fontsize=10)
        axis.set_aspect("equal")
        axis.set_xlim(seen[:, 0].min() - 0.15 * extent, seen[:, 0].max() + 0.15 * extent)
        axis.set_ylim(seen[:, 1].min() - 0.15 * extent, seen[:, 1].max() + 0.15 * extent)
        if not view.flat:
            axis.set_axis_off()
    for axis in axes[-1]:
        axis.set_xlabel("X [m]")
    for axis in axes[:, 0]:
        axis.set_ylabel("Y [m]")
    figure.colorbar(faces, ax=axes, label="displacement, largest = 1", shrink=0.7)
    if any(len(points) for points in held.values()):
        axes[-1, (across - 1) // 2].legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2, fontsize=9, frameon=False)
    figure.suptitle(wrapped(title, 85), fontsize=10)
    figure.savefig(path, dpi=120)


def draw_bed(path: Path, points: np.ndarray, force: np.ndarray, gap: np.ndarray, row: int, title: str) -> None:
    """Draw the bed under a plate in plan, at the instant `row` and over all instants.

    Contacts at `points` (n_c, 3) m, forces (n_c, nt) N, gaps (n_c, nt) m.
    """
    flat = points[:, np.sort(np.argsort(np.ptp(points, axis=0))[1:])]
    names = [("X [m]", "Y [m]", "Z [m]")[k] for k in np.sort(np.argsort(np.ptp(points, axis=0))[1:])]
    extent = float(np.max(np.ptp(flat, axis=0)))
    size = (330.0 / max(np.sqrt(len(points)), 4.0)) ** 2 * 0.35
    panels = (
        ("gap at this instant [mm]", 1e3 * gap[:, row], "YlOrRd"), ("force at this instant [kN]", 1e-3 * force[:, row], "viridis"),
        ("largest gap [mm]", 1e3 * gap.max(axis=1), "YlOrRd"), ("largest force [kN]", 1e-3 * force.max(axis=1), "viridis"),
    )
    figure = new_figure(10.5, 9.6)
    for axis, (label, values, colours) in zip(figure.subplots(2, 2, sharex=True, sharey=True).flat, panels, strict=True):
        lifted = gap[:, row] > 0 if "instant" in label else gap.max(axis=1) > 0
        shown = axis.scatter(*flat.T, c=values, s=size, marker="s", cmap=colours, edgecolors="0.6", linewidths=0.4)
        axis.scatter(*flat[lifted].T, s=0.12 * size, marker="o", facecolors="white", edgecolors="black", linewidths=0.6)
        figure.colorbar(shown, ax=axis, label=label, shrink=0.8)
        axis.set_aspect("equal")
        axis.set_xlim(flat[:, 0].min() - 0.08 * extent, flat[:, 0].max() + 0.08 * extent)
        axis.set_ylim(flat[:, 1].min() - 0.08 * extent, flat[:, 1].max() + 0.08 * extent)
    for axis in figure.axes[2:4]:
        axis.set_xlabel(names[0])
    for axis in (figure.axes[0], figure.axes[2]):
        axis.set_ylabel(names[1])
    figure.suptitle(wrapped(title, 100) + "\ndots: contacts that are open at the instant (above) or ever (below)", fontsize=10)
    figure.savefig(path, dpi=120)


def _round_down(value: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten below `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(m for m in (1.0, 2.0, 5.0) if m * power <= value) * power)
