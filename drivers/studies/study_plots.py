"""Pictures of studies: errors over numbers of modes, extremes over varied values."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np

from uplift.drivers.report.figures import new_figure, wrapped


def draw_truncation(path: Path, counts: np.ndarray, panels: dict[str, dict[str, np.ndarray]], title: str) -> None:
    """Draw relative errors (n,) against numbers of modes (n,), one panel for each quantity, one line for each way."""
    figure = new_figure(5.4 * len(panels), 4.8)
    figure.suptitle(wrapped(title, 110), fontsize=11)
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
    figure = new_figure(8.0, 1.0 + 1.9 * len(results))
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
