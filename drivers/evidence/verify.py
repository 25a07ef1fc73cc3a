"""Rerun the published verification case and compare every published value."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.analysis.snapshots import Snapshots
from uplift.drivers.process import say
from uplift.drivers.report.files import write_run
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import read_scene
from uplift.drivers.scene.shipped import REFERENCE
from uplift.solvers.history import History

PUBLISHED = Path(__file__).parent / "reference" / "sdls119a.csv"

TOLERANCE = 1e-5
"""Relative: the source prints six significant digits."""

TRANSFORM_TOLERANCE = 1e-15
"""m: two inverse transforms of displacements of some 0.05 m may differ in the last digit of a double."""


@dataclass(frozen=True)
class Published:
    """One published value, as printed."""

    method: str
    pass_number: int
    time: float
    component: str
    printed: str

    @property
    def value(self) -> float:
        """The value in m."""
        return float(self.printed)


def published_values(path: Path = PUBLISHED) -> list[Published]:
    """Read a table of published values."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return [Published(r["method"], int(r["pass"]), float(r["time_s"]), r["component"], r["value_m"]) for r in rows]


def value_at(history: History, names: tuple[str, ...], component: str, time: float) -> float:
    """Return a probe's component in m at an archived instant."""
    row = int(np.argmin(np.abs(history.times - time)))
    if abs(history.times[row] - time) > 1e-9:
        raise ValueError(f"t = {time} s is not archived")
    return float(history.probes[row, names.index(component)])


def verify(comm: Any, out: Path, *, plots: bool) -> bool:
    """Run both variants of modelisation A, print the comparison and write the runs below `out` (collective)."""
    scene = read_scene(REFERENCE)
    with prepare(scene, comm) as assembly:
        names = assembly.operators.probes.names
        say(f"{scene.title}\n{assembly.operators.n} dofs, {assembly.plate.total_mass:,.1f} kg\n")
        good = True
        say(f"{'method':<16}{'pass':>4}{'t [s]':>8}  {'value':<7}{'published [m]':>15}{'here [m]':>24}{'rel. diff.':>12}")
        check = 0.0
        for method in ("transient", "time-frequency"):
            snapshots = Snapshots(assembly)
            analysis = analyse(assembly, Request(method, 2), snapshots)
            for item in (p for p in published_values() if p.method == method):
                here = value_at(analysis.passes.histories[item.pass_number - 1], names, item.component, item.time)
                difference = abs(here - item.value) / abs(item.value)
                good &= difference <= TOLERANCE
                say(
                    f"{item.method:<16}{item.pass_number:>4}{item.time:>8.2f}  {item.component:<7}{item.printed:>15}{here:>24.15e}"
                    f"{difference:>12.1e}{'' if difference <= TOLERANCE else '  MISSED'}"
                )
            if analysis.transform_check is not None:
                check = analysis.transform_check
            write_run(assembly, analysis, out / method, plots=plots, snapshots=snapshots, scene_text=REFERENCE.read_text(encoding="utf-8"))
        good &= check <= TRANSFORM_TOLERANCE
        say(f"\ninverse transform by FFT and by its sum differ by {check:.1e} m (limit {TRANSFORM_TOLERANCE:g})")
        say(f"seconds: {assembly.clock.line()}")
        say(f"files in {out / 'transient'} and {out / 'time-frequency'}")
        say(f"all values within {TOLERANCE:g}" if good else "FAILED: a value misses")
    return bool(good)
