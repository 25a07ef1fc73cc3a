"""Pictures of histories over time, and of answers over frequency."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uplift.drivers.report.figures import panels_over_time


def draw_history(
    path: Path, times: np.ndarray, names: tuple[str, ...], last: np.ndarray, first: np.ndarray | None, title: str
) -> None:
    """Draw every probe (nt, n) m against time, one panel a component; `first` is the first of several passes."""
    components = sorted({name.split(".")[-1] for name in names})
    figure, axes = panels_over_time(len(components), title)
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
    figure, axes = panels_over_time(2, title)
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
    figure, axes = panels_over_time(len(panels), title)
    for axis, (label, times, first, second) in zip(axes, panels, strict=True):
        axis.plot(times, first, lw=1.8, color="#0072B2", label=labels[0])
        axis.plot(times, second, lw=1.1, ls="--", color="#D55E00", label=labels[1])
        axis.set_ylabel(label)
    axes[0].legend(loc="upper right", fontsize=8)
    figure.savefig(path, dpi=120)


def draw_reactions(path: Path, times: np.ndarray, columns: dict[str, np.ndarray], title: str) -> None:
    """Draw each resultant (nt,) of the ground's forces, and the share of open contacts, in a panel of its own."""
    figure, axes = panels_over_time(len(columns), title)
    for axis, (name, values) in zip(axes, columns.items(), strict=True):
        thousand = name.endswith(("[N]", "[N m]"))
        axis.plot(times, 1e-3 * values if thousand else values, lw=1.3)
        axis.set_ylabel(name.replace("[N", "[kN").replace(" [", "\n["))
    figure.savefig(path, dpi=120)


def draw_energy(path: Path, times: np.ndarray, columns: dict[str, np.ndarray], title: str) -> None:
    """Draw the ledger of energies (nt,) J, the numerical residual apart."""
    figure, axes = panels_over_time(2, title)
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
    figure, axes = panels_over_time(1, title)
    known = np.isfinite(lifted)
    axes[0].plot(times[known], lifted[known], lw=1.2, marker="." if known.sum() < 100 else None)
    axes[0].set_ylabel("area that has risen [%]")
    axes[0].set_ylim(bottom=0)
    figure.savefig(path, dpi=120)


def draw_response(path: Path, frequencies: np.ndarray, names: tuple[str, ...], values: np.ndarray, title: str) -> None:
    """Draw modulus and phase of complex answers (n_f, n) over frequencies (n_f,) in Hz."""
    figure, axes = panels_over_time(2, title)
    for name, column in zip(names, values.T, strict=True):
        axes[0].semilogy(frequencies, np.maximum(np.abs(column), 1e-300), lw=1.3, label=name)
        axes[1].plot(frequencies, np.degrees(np.angle(column)), lw=1.0, label=name)
    axes[0].set_ylabel("modulus [m or rad]")
    axes[1].set_ylabel("phase [degrees]")
    axes[1].set_yticks([-180, -90, 0, 90, 180])
    axes[1].set_xlabel("f [Hz]")
    axes[0].legend(loc="upper right", fontsize=8, ncols=2)
    figure.savefig(path, dpi=120)
