"""The picture of error against run time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from uplift.drivers.evidence.pareto.cases import METHODS
from uplift.drivers.evidence.pareto.errors import Reference, efficient
from uplift.drivers.evidence.pareto.runs import Outcome

MARKS = "osD^v<>PX*"
COLOURS = ("C0", "C1", "C2", "0.4", "C3", "C4", "C5", "C6", "C9", "C8")


def draw(path: Path, outcomes: Sequence[Outcome], references: Mapping[str, Reference], scored: np.ndarray, probe: str) -> None:
    """Draw errors (n_outcomes, 3) of displacement and contact forces against seconds, a column for each case, the front as a line."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4 * len(references), 9.4))
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, len(references), squeeze=False)
    for column, (case, reference) in enumerate(references.items()):
        own = [i for i, o in enumerate(outcomes) if o.run.case == case and o.trace is not None]
        for row, words in enumerate((f"error of {probe}", "error of the contact forces")):
            axis = axes[row][column]
            for method, mark, colour in zip(METHODS, MARKS, COLOURS, strict=True):
                here = [i for i in own if outcomes[i].run.method == method]
                if here:
                    axis.loglog([outcomes[i].total for i in here], scored[here, row], mark, color=colour, ms=5, alpha=0.75, label=method)
            seconds, values = [outcomes[i].total for i in own], scored[own, row]
            front = efficient(seconds, list(values))
            axis.loglog([seconds[i] for i in front], values[front], "k-", lw=1.2, label="efficient front")
            axis.axhline(reference.error[row], color="0.5", lw=1.0, ls=":", label="estimated error of the reference")
            axis.set_title(f"{case}: {words}", fontsize=10)
            axis.set_xlabel("run time [s]")
            axis.set_ylabel("largest difference / largest value")
            axis.grid(True, which="major", lw=0.3)
            low = min([*values[values > 0], reference.error[row]], default=1e-8)
            axis.set_ylim(0.5 * low, 3.0)
    handles = {label: handle for line in axes for axis in line for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="lower center", ncol=2 * len(references), fontsize=8)
    figure.subplots_adjust(0.12 / len(references), 0.06 + 0.3 / (2 * len(references) + 1), 0.98, 0.96, 0.18, 0.24)
    figure.savefig(path, dpi=110, metadata={"Software": None})
