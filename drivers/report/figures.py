"""Empty figures for pictures of a run. Only this module loads a plotting library, and only when it is asked for a figure."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
import textwrap
from typing import Any


def new_figure(width: float, height: float, layout: str | None = "constrained") -> Any:
    """Return an empty figure in inches, drawn without a screen."""
    folder = os.environ.get("MPLCONFIGDIR")
    if "matplotlib" not in sys.modules and folder and os.path.isdir(folder) and not os.access(folder, os.W_OK):
        # A read-only installation: matplotlib would complain and search all fonts again without a copy of its cache.
        copy = tempfile.mkdtemp(prefix="uplift-matplotlib-")
        atexit.register(shutil.rmtree, copy, ignore_errors=True)
        shutil.copytree(folder, copy, dirs_exist_ok=True)
        os.environ["MPLCONFIGDIR"] = copy
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    matplotlib.rcdefaults()  # whatever a file matplotlibrc in the current folder says
    matplotlib.rcParams["text.parse_math"] = False  # a name may hold dollar signs
    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def panels_over_time(number: int, title: str) -> tuple[Any, Any]:
    """Return a figure with `number` panels over time, one above the other."""
    height = 2.4 * number + 1.1
    figure = new_figure(9, height, layout=None)  # fixed margins take half the time of a layout that is solved for
    figure.suptitle(wrapped(title, 110), fontsize=11)
    axes = figure.subplots(number, 1, sharex=True, squeeze=False)[:, 0]
    figure.subplots_adjust(left=0.125, right=0.98, bottom=0.5 / height, top=1 - 0.75 / height, hspace=0.1)
    figure.align_ylabels(axes)
    for axis in axes:
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("t [s]")
    return figure, axes


def wrapped(title: str, width: int) -> str:
    """Return a title with each of its lines broken at so many characters."""
    return "\n".join(textwrap.fill(line, width) for line in title.splitlines())
