"""Pictures of a run. Only this module loads a plotting library, and only when it is asked to draw."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from uplift.meshes.gather import WholeMesh


def _new_figure(width: float, height: float, layout: str | None = "constrained") -> Any:
    """Return an empty figure in inches, drawn without a screen."""
    folder = os.environ.get("MPLCONFIGDIR")
    if "matplotlib" not in sys.modules and folder and os.path.isdir(folder) and not os.access(folder, os.W_OK):
        # A read-only installation: matplotlib would complain and search all fonts again without a copy of its cache.
        copy = tempfile.mkdtemp(prefix="uplift-matplotlib-")
        atexit.register(shutil.rmtree, copy, ignore_errors=True)
        shutil.copytree(folder, copy, dirs_exist_ok=True)
        os.environ["MPLCONFIGDIR"] = copy
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def draw_history(
    path: Path, times: np.ndarray, names: tuple[str, ...], last: np.ndarray, first: np.ndarray | None, title: str
) -> None:
    """Draw every probe (nt, n) m against time, one panel a component; `first` is the first of several passes."""
    components = sorted({name.split(".")[-1] for name in names})
    figure, axes = _panels(len(components), title)
    for axis, component in zip(axes, components, strict=True):
        for column, name in enumerate(names):
            if not name.endswith("." + component):
                continue
            axis.plot(times, 1e3 * last[:, column], lw=1.6, label=name if first is None else f"{name}, last pass")
            if first is not None:
                axis.plot(times, 1e3 * first[:, column], color="0.2", lw=0.7, ls="--", label=f"{name}, pass 1")
        axis.set_ylabel(f"{component} [{'mrad' if component.startswith('DR') else 'mm'}]")
        axis.legend(loc="upper right", fontsize=8)
    figure.savefig(path, dpi=120)


def draw_contacts(
    path: Path, times: np.ndarray, names: tuple[str, ...], force: np.ndarray, gap: np.ndarray, title: str
) -> None:
    """Draw contact forces (n_c, nt) N and gaps (n_c, nt) m: as lines, or as maps over time where there are many."""
    figure, axes = _panels(2, title)
    for axis, values, label in zip(axes, (1e-3 * force, 1e3 * gap), ("contact force [kN]", "gap [mm]"), strict=True):
        if len(names) > 8:
            extent = (times[0], times[-1], 0.5, len(names) + 0.5)
            image = axis.imshow(values, aspect="auto", origin="lower", extent=extent, cmap="viridis", interpolation="nearest")
            figure.colorbar(image, ax=axis, label=label)
            axis.set_ylabel("support, in order")
            axis.grid(visible=False)
            continue
        for name, line in zip(names, values, strict=True):
            axis.plot(times, line, lw=1.1, label=name)
        axis.set_ylabel(label)
    if len(names) <= 8:
        axes[0].legend(loc="upper right", fontsize=8, ncols=2)
    figure.savefig(path, dpi=120)


def draw_overlays(path: Path, panels: list[tuple[str, np.ndarray, np.ndarray, np.ndarray]], labels: tuple[str, str], title: str) -> None:
    """Draw two runs over each other; a panel has a label, times (nt,) s and the values (nt,) of the first and the second run."""
    figure, axes = _panels(len(panels), title)
    for axis, (label, times, first, second) in zip(axes, panels, strict=True):
        axis.plot(times, first, lw=1.8, color="#0072B2", label=labels[0])
        axis.plot(times, second, lw=1.1, ls="--", color="#D55E00", label=labels[1])
        axis.set_ylabel(label)
    axes[0].legend(loc="upper right", fontsize=8)
    figure.savefig(path, dpi=120)


def draw_reactions(path: Path, times: np.ndarray, columns: dict[str, np.ndarray], title: str) -> None:
    """Draw each resultant (nt,) of the ground's forces, and the share of open contacts, in a panel of its own."""
    figure, axes = _panels(len(columns), title)
    for axis, (name, values) in zip(axes, columns.items(), strict=True):
        thousand = name.endswith(("[N]", "[N m]"))
        axis.plot(times, 1e-3 * values if thousand else values, lw=1.3)
        axis.set_ylabel(name.replace("[N", "[kN").replace(" [", "\n["))
    figure.savefig(path, dpi=120)


def draw_energy(path: Path, times: np.ndarray, columns: dict[str, np.ndarray], title: str) -> None:
    """Draw the ledger of energies (nt,) J, the numerical residual apart."""
    figure, axes = _panels(2, title)
    for name, values in columns.items():
        residual = name.startswith("numerical")
        shown = values if residual or name.startswith(("damped", "work")) else values - values[0]
        change = "" if residual or name.startswith(("damped", "work")) else ", change"
        axes[int(residual)].plot(times, 1e-3 * shown, lw=1.3, label=name.split(" [")[0] + change)
    axes[0].set_ylabel("energy [kJ]")
    axes[0].legend(loc="upper right", fontsize=8)
    axes[1].set_ylabel("residual of the\nledger [kJ]")
    figure.savefig(path, dpi=120)


def draw_uplift(path: Path, times: np.ndarray, lifted: np.ndarray, title: str) -> None:
    """Draw the lifted share of the plate's area (nt,) in percent at the instants where it is known."""
    figure, axes = _panels(1, title)
    known = np.isfinite(lifted)
    axes[0].plot(times[known], lifted[known], lw=1.2, marker="." if known.sum() < 100 else None)
    axes[0].set_ylabel("area that has risen [%]")
    axes[0].set_ylim(bottom=0)
    figure.savefig(path, dpi=120)


def _panels(number: int, title: str) -> tuple[Any, Any]:
    """Return a figure with `number` panels over time, one above the other."""
    height = 2.4 * number + 1.1
    figure = _new_figure(9, height, layout=None)  # fixed margins take half the time of a layout that is solved for
    figure.suptitle(_wrapped(title, 110), fontsize=11)
    axes = figure.subplots(number, 1, sharex=True, squeeze=False)[:, 0]
    figure.subplots_adjust(left=0.125, right=0.98, bottom=0.5 / height, top=1 - 0.75 / height, hspace=0.1)
    figure.align_ylabels(axes)
    for axis in axes:
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("t [s]")
    return figure, axes


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
    figure = _new_figure(7.4, 7.4)
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
    figure.suptitle(_wrapped(title, 85) + f"\ndisplacements x {factor:g}", fontsize=10)
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
    figure = _new_figure(10.5, 9.6)
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
    figure.suptitle(_wrapped(title, 100) + "\ndots: contacts that are open at the instant (above) or ever (below)", fontsize=10)
    figure.savefig(path, dpi=120)


def draw_response(path: Path, frequencies: np.ndarray, names: tuple[str, ...], values: np.ndarray, title: str) -> None:
    """Draw modulus and phase of complex answers (n_f, n) over frequencies (n_f,) in Hz."""
    figure, axes = _panels(2, title)
    for name, column in zip(names, values.T, strict=True):
        axes[0].semilogy(frequencies, np.maximum(np.abs(column), 1e-300), lw=1.3, label=name)
        axes[1].plot(frequencies, np.degrees(np.angle(column)), lw=1.0, label=name)
    axes[0].set_ylabel("modulus [m or rad]")
    axes[1].set_ylabel("phase [degrees]")
    axes[1].set_yticks([-180, -90, 0, 90, 180])
    axes[1].set_xlabel("f [Hz]")
    axes[0].legend(loc="upper right", fontsize=8, ncols=2)
    figure.savefig(path, dpi=120)


def _wrapped(title: str, width: int) -> str:
    return "\n".join(textwrap.fill(line, width) for line in title.splitlines())


def _round_down(value: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten below `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(m for m in (1.0, 2.0, 5.0) if m * power <= value) * power)


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
    figure = _new_figure(max(across * (width + 0.15) + 1.6, 6.0), down * (width * span_y / span_x + 0.3) + 1.3)
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
    figure.suptitle(_wrapped(title, 85), fontsize=10)
    figure.savefig(path, dpi=120)


def draw_truncation(path: Path, counts: np.ndarray, panels: dict[str, dict[str, np.ndarray]], title: str) -> None:
    """Draw relative errors (n,) against numbers of modes (n,), one panel for each quantity, one line for each way."""
    figure = _new_figure(5.4 * len(panels), 4.8)
    figure.suptitle(_wrapped(title, 110), fontsize=11)
    for axis, (quantity, lines) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels.items(), strict=True):
        for (name, errors), style in zip(lines.items(), ("o--", "s-"), strict=True):
            axis.loglog(counts, errors, style, lw=1.4, ms=5, label=name)
        axis.set_xticks(counts, [str(n) for n in counts], fontsize=8)
        axis.set_xticks([], minor=True)
        axis.set_xlabel("modes")
        axis.set_ylabel("relative error")
        axis.set_title(quantity, fontsize=10)
        axis.grid(alpha=0.3)
        axis.legend(fontsize=9)
    figure.savefig(path, dpi=120)


def draw_study(path: Path, columns: list[str], rows: np.ndarray, varied: int, title: str) -> None:
    """Draw the results (n_cases, n_columns) of a parameter study against the first varied value, a line for each set of the others.

    The first `varied` columns are the varied values, the last one is the seconds.
    """
    results = range(varied, len(columns) - 1)
    figure = _new_figure(8.0, 1.0 + 1.9 * len(results))
    axes = np.atleast_1d(figure.subplots(len(results), 1, sharex=True))
    figure.suptitle("\n".join(textwrap.wrap(title, 80)), fontsize=11)
    sets = np.unique(rows[:, 1:varied], axis=0) if varied > 1 else np.zeros((1, 0))
    shown = sets[np.unique(np.linspace(0, len(sets) - 1, min(len(sets), 8)).round().astype(int))]
    for axis, column in zip(axes, results, strict=True):
        for others in shown:
            line = rows[np.all(rows[:, 1:varied] == others, axis=1)]
            label = ", ".join(f"{name} = {value:g}" for name, value in zip(columns[1:varied], others, strict=True))
            axis.plot(line[:, 0], line[:, column], marker="o", ms=3, lw=1.2, label=label)
        axis.set_ylabel(columns[column], fontsize=8)
        axis.grid(visible=True, lw=0.3)
    if varied > 1:
        axes[0].legend(fontsize=7, ncols=2)
    axes[-1].set_xlabel(columns[0])
    figure.savefig(path, dpi=120)
