"""Pictures of a run. Only this module loads a plotting library, and only when it is asked to draw."""

from __future__ import annotations

import os
import shutil
import tempfile
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from meshes.gather import WholeMesh


def _new_figure(width: float, height: float) -> Any:
    """Return an empty figure, drawn without a screen."""
    folder = os.environ.get("MPLCONFIGDIR")
    if folder and not os.access(folder, os.W_OK):
        # A read-only installation: matplotlib would complain and search all fonts again without a copy of its cache.
        copy = Path(tempfile.mkdtemp(prefix="uplift-matplotlib-"))
        shutil.copytree(folder, copy, dirs_exist_ok=True)
        os.environ["MPLCONFIGDIR"] = str(copy)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def draw_history(path: Path, times: np.ndarray, names: tuple[str, ...], passes: list[np.ndarray], title: str) -> None:
    """Draw every probe against time, one panel a component; the last of several passes in full colour."""
    components = sorted({name.split(".")[1] for name in names})
    figure = _new_figure(9, 2.8 * len(components) + 0.6)
    figure.suptitle(_wrapped(title, 110), fontsize=11)
    axes = figure.subplots(len(components), 1, sharex=True, squeeze=False)[:, 0]
    for axis, component in zip(axes, components, strict=True):
        for column, name in enumerate(names):
            if not name.endswith("." + component):
                continue
            label = name if len(passes) == 1 else f"{name}, pass {len(passes)}"
            axis.plot(times, 1e3 * passes[-1][:, column], lw=1.6, label=label)
            if len(passes) > 1:
                axis.plot(times, 1e3 * passes[0][:, column], color="0.2", lw=0.7, ls="--", label=f"{name}, pass 1")
        axis.set_ylabel(f"{component} [mm]")
        axis.grid(alpha=0.3)
        axis.legend(loc="upper right", fontsize=8)
    axes[-1].set_xlabel("t [s]")
    figure.savefig(path, dpi=120)


def draw_deformed(
    path: Path, mesh: WholeMesh, displacement: np.ndarray, supports: np.ndarray, open_: np.ndarray, title: str
) -> None:
    """Draw the plate as meshed and as deformed, to scale with the displacement (n, 2) m enlarged.

    `supports` (n_c, 2) m are the supports, `open_` (n_c,) tells which of them have lifted.
    """
    from matplotlib.collections import PolyCollection

    plain = mesh.points[:, :2]
    extent = float(np.max(np.ptp(plain, axis=0)))
    largest = float(np.max(np.abs(displacement), initial=0.0))
    factor = _round_down(0.08 * extent / largest) if largest > 0 else 1.0
    moved = plain + factor * displacement
    figure = _new_figure(7.4, 7.4)
    axis = figure.add_subplot()
    corners = mesh.corners
    many = len(corners) > 4000
    axis.add_collection(PolyCollection(plain[corners], facecolors="none", edgecolors="0.8", linewidths=0.0 if many else 0.8))
    magnitude = 1e3 * np.linalg.norm(displacement, axis=1)[corners].mean(axis=1)
    faces = PolyCollection(
        moved[corners], array=magnitude, cmap="viridis", edgecolors="face" if many else "white", linewidths=0.0 if many else 0.4
    )
    axis.add_collection(faces)
    if len(supports):
        size = 0.03 * extent
        for mark, colour, label in ((~open_, "tab:blue", "support in contact"), (open_, "tab:red", "support lifted off")):
            if mark.any():
                axis.plot(supports[mark, 0], supports[mark, 1] - size, "^", color=colour, ms=9, label=label)
        axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=2, fontsize=9, frameon=False)
    figure.colorbar(faces, ax=axis, label="displacement relative to the base [mm]", shrink=0.8)
    axis.set_aspect("equal")
    axis.autoscale_view()
    axis.margins(0.06)
    axis.set_xlabel("X [m]")
    axis.set_ylabel("Y [m]")
    figure.suptitle(_wrapped(title, 85) + f"\ndisplacements x {factor:g}", fontsize=10)
    figure.savefig(path, dpi=120)


def _wrapped(title: str, width: int) -> str:
    return "\n".join(textwrap.fill(line, width) for line in title.splitlines())


def _round_down(value: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten below `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(m for m in (1.0, 2.0, 5.0) if m * power <= value) * power)
