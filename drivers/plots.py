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
    from meshes.gather import WholeMesh


def _new_figure(width: float, height: float) -> Any:
    """Return an empty figure, drawn without a screen."""
    folder = os.environ.get("MPLCONFIGDIR")
    if "matplotlib" not in sys.modules and folder and os.path.isdir(folder) and not os.access(folder, os.W_OK):
        # A read-only installation: matplotlib would complain and search all fonts again without a copy of its cache.
        copy = tempfile.mkdtemp(prefix="uplift-matplotlib-")
        atexit.register(shutil.rmtree, copy, ignore_errors=True)
        shutil.copytree(folder, copy, dirs_exist_ok=True)
        os.environ["MPLCONFIGDIR"] = copy
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
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
        axis.set_ylabel(f"{component} [mm]")
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
    axes[0].set_ylabel("area with DY > 0 [%]")
    axes[0].set_ylim(bottom=0)
    figure.savefig(path, dpi=120)


def _panels(number: int, title: str) -> tuple[Any, Any]:
    """Return a figure with `number` panels over time, one above the other."""
    figure = _new_figure(9, 2.4 * number + 0.9)
    figure.suptitle(_wrapped(title, 110), fontsize=11)
    axes = figure.subplots(number, 1, sharex=True, squeeze=False)[:, 0]
    for axis in axes:
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("t [s]")
    return figure, axes


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
