"""The stability table: stiff, extreme and ill-posed cases, each against an oracle or an invariant, as a page and a CSV file."""

from __future__ import annotations

import time
import traceback
from pathlib import Path
from typing import Any

from uplift.drivers.evidence.pages import command_line
from uplift.drivers.evidence.stability.bench import Bench, Finding
from uplift.drivers.evidence.stability.cases import Case
from uplift.drivers.evidence.stability.mesh_cases import meshes, numbers, units
from uplift.drivers.evidence.stability.model_cases import joints, materials, penalties, supports, thin_plates
from uplift.drivers.evidence.stability.page import Row, csv_text, page
from uplift.drivers.evidence.stability.refusals import methods, refusals, windows
from uplift.drivers.evidence.stability.run_cases import amplitudes, static_cases, steps
from uplift.drivers.process import say
from uplift.drivers.results.folder import all_or_nothing, writable_folder
from uplift.drivers.scene.scene import read_scene
from uplift.meshes.checked import ModelError
from uplift.solvers.errors import SolverError

GROUPS = (
    penalties, supports, materials, thin_plates, steps, amplitudes, numbers, joints, units, meshes, static_cases, methods, windows,
    refusals,
)
"""In the order of the page."""


def stability(comm: Any, scene: Path, out: Path, *, quick: bool, quiet: bool) -> bool:
    """Run the cases on the scene, write the page to `out` and a CSV file beside it; return whether all hold."""
    begin = time.perf_counter()
    if comm.size > 1:
        raise ModelError("--out", "the stability table is made by one process: start it without mpirun")
    if out.is_dir():
        raise ModelError("--out", f"{out} is a folder; expected the name of a file")
    writable_folder(out.absolute().parent)
    bench = Bench(read_scene(scene).source, scene.parent, comm)
    rows = []
    for case in cases(quick=quick):
        rows.append(tried(bench, case))
        if not quiet:
            say(rows[-1].line())
    command = command_line("stability", out, "stability.md", *["--quick"] * quick)
    with all_or_nothing(out.absolute().parent) as staging:
        (staging / out.name).write_text(page(rows, command, time.perf_counter() - begin), encoding="utf-8")
        (staging / f"{out.stem}.csv").write_text(csv_text(rows), encoding="utf-8")
    failed = [row for row in rows if not row.holds]
    if not quiet:
        say(f"{len(rows)} cases, {len(failed)} failed; page in {out}, {time.perf_counter() - begin:.0f} s")
    return not failed


def cases(*, quick: bool) -> list[Case]:
    """Return all cases, or those of the quick slice."""
    return [case for group in GROUPS for case in group() if case.quick or not quick]


def tried(bench: Bench, case: Case) -> Row:
    """Run one case; whatever ends it is a failure of the case, not of the table."""
    try:
        finding = case.run(bench)
    except (ModelError, SolverError, ArithmeticError) as error:
        finding = Finding(float("nan"), f"{type(error).__name__}: {error}", sound=False)
    except Exception:
        finding = Finding(float("nan"), traceback.format_exc().splitlines()[-1], sound=False)
    return Row(case, finding)
