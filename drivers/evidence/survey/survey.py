"""A survey of uplift: the reference case and its variations by every method, as a page of tables.

Each case is run exactly in time and by the Laplace sweep, which must agree, and by the published passes in time and by the
Fourier sweep, which may or may not arrive. Two tables more: supports so stiff that the average-acceleration scheme chatters, and the
convergence of the reference case in the time step.
"""


from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from uplift.drivers.evidence.pages import command_line
from uplift.drivers.evidence.survey.cases import AGREEMENT, CASES, CHATTER, COMMON, QUICK, STIFF, Case, refined
from uplift.drivers.evidence.survey.page import (
    chatter_section,
    exact_section,
    introduction,
    passes_section,
    penalty_section,
    progress,
    provenance,
    step_section,
)
from uplift.drivers.evidence.survey.runs import run_case, run_chatter, run_level
from uplift.drivers.process import say
from uplift.drivers.results.folder import all_or_nothing, writable_folder
from uplift.drivers.scene.paths import varied
from uplift.drivers.scene.scene import Scene, build_scene, read_scene
from uplift.meshes.checked import ModelError


def survey(comm: Any, path: Path, out: Path, *, quick: bool, quiet: bool) -> bool:
    """Run the survey of the scene at `path` and write its page to `out` (collective); return whether the exact solvers agree."""
    begin = time.perf_counter()
    scene = read_scene(path)
    _check(scene, out)
    if comm.rank == 0:
        writable_folder(out.parent)

    def build(case: Case) -> Scene:
        return build_scene(varied(scene.source, COMMON | case.changes), path.parent)

    fitting, left_out = fitting_cases([case for case in CASES if not quick or case.name in QUICK], build)
    outcomes = []
    for case, varied_scene in fitting:
        outcomes.append(run_case(varied_scene, comm, case))
        if not quiet:
            say(progress(outcomes[-1]))
    stiff = [dataclasses.replace(case, changes=STIFF | case.changes) for case in (CHATTER[:2] if quick else CHATTER)]
    chatter = [run_chatter(varied_scene, comm, case) for case, varied_scene in fitting_cases(stiff, build)[0]]
    finer_scenes = [build(Case("", refined(2**level))) for level in range(2 if quick else 5)]
    levels = [run_level(finer, comm, laplace=level < (1 if quick else 2)) for level, finer in enumerate(finer_scenes)]
    differences = [o.difference for o in outcomes if o.case.claimed] + [level.difference for level in levels if level.laplace]
    agree = max(differences) <= AGREEMENT
    text = "\n\n".join(
        [
            *introduction(scene),
            *exact_section(scene, outcomes, left_out),
            *passes_section(outcomes),
            *penalty_section(scene, outcomes),
            *(chatter_section(scene, chatter) if chatter else []),
            *step_section(scene, levels),
            provenance(_command(path, out, quick), comm.size, time.perf_counter() - begin),
        ]
    )
    if comm.rank == 0:
        with all_or_nothing(out.parent) as staging:
            (staging / out.name).write_text(text + "\n", encoding="utf-8")
    if not quiet:
        say(f"largest difference of the exact solvers {max(differences):.1e} (limit {AGREEMENT:g}){'' if agree else ': FAILED'}")
        say(f"page in {out}, {time.perf_counter() - begin:.0f} s")
    return agree


def fitting_cases(cases: list[Case], build: Callable[[Case], Scene]) -> tuple[list[tuple[Case, Scene]], list[str]]:
    """Return the cases that fit the scene with their scenes, and of the others the names and what does not fit."""
    fitting, left_out = [], []
    for case in cases:
        try:
            fitting.append((case, build(case)))
        except ModelError as error:
            left_out.append(f"{case.name} ({error})")
    return fitting, left_out


def _check(scene: Scene, out: Path) -> None:
    if out.is_dir():
        raise ModelError("--out", f"{out} is a folder; expected the name of a file")
    for section in ("transient", "fourier"):
        if getattr(scene, section) is None:
            raise ModelError(section, f"missing; the survey needs the section [{section}]")
    if not any(support.unilateral for support in scene.model.supports):
        raise ModelError("supports", "expected at least one unilateral support, whose uplift can be surveyed")


def _command(path: Path, out: Path, quick: bool) -> str:
    return command_line("survey", out, "uplift.md", *["--quick"] * quick, scene=path)
