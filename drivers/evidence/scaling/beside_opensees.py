"""The reduced run beside OpenSeesPy: the reference case on finer meshes, its supports where the scene has them."""

from __future__ import annotations

import os
import platform
import tempfile
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.evidence.pages import command_line
from uplift.drivers.evidence.pareto.cases import MESH_STEP, Mesh
from uplift.drivers.evidence.peers.peers import OPENSEES, answer_of, misfit, on_points, opensees, problem
from uplift.drivers.evidence.scaling.reduced import FILE, Reduced, relative
from uplift.drivers.process import say
from uplift.drivers.results.folder import processor, versions, writable_folder
from uplift.drivers.scene.scene import Scene
from uplift.meshes.checked import ModelError

CASES = ((4, 1000), (32, 40))
"""Refinement of the scene and steps that OpenSeesPy makes; the time of all is scaled from them."""

QUICK = ((1, 1000),)

HEAD = [
    "| dofs | reduced run s | of it the march s | steps | OpenSeesPy s | OpenSeesPy / reduced run | P3 differs by |",
    "|" + "---:|" * 7,
]


def compare_with_opensees(scene: Scene, child: Callable[..., dict[str, Any]], out: Path, *, quick: bool) -> None:
    """Measure both and write the page; `child(*arguments)` returns what a measuring process printed.

    Raises `ModelError` for a scene that OpenSeesPy's model does not cover, or if OpenSeesPy cannot be had.
    """
    writable_folder(out.absolute().parent)
    if scene.fourier is None or scene.transient is None or scene.transient.step != MESH_STEP:
        raise ModelError("scale", f"expected a scene with a section [fourier] and steps of {MESH_STEP:g} s")
    if wrong := misfit(scene):
        raise ModelError("scale", f"the model in OpenSeesPy does not have {wrong}")
    python, version = opensees()
    if python is None:
        raise ModelError("scale", f"OpenSeesPy cannot be had: {version}")
    lines = list(HEAD)
    for line in lines:
        say(line)
    for factor, measured in QUICK if quick else CASES:
        lines.append(_row(scene, child, python, factor, measured))
        say(lines[-1])
    out.write_text(_page(lines, version, command_line("scale", out, "scaling-peers.md", "--peers", *["--quick"] * quick)), encoding="utf-8")
    say(f"page in {out}")


def _row(scene: Scene, child: Callable[..., dict[str, Any]], python: str, factor: int, measured: int) -> str:
    assert scene.transient is not None
    steps, every = scene.transient.steps, scene.transient.every
    with tempfile.TemporaryDirectory() as folder:
        mine = Reduced(**child("reduced", factor, 1, 2, folder))
        with np.load(Path(folder) / FILE) as saved:
            history = saved["history"]
    answer = answer_of(OPENSEES, python, on_points(problem(scene, Mesh(factor), measured), scene))
    build, static, march = answer["seconds"]
    seconds = float(build + static + march * steps / measured)
    own = mine.ready + mine.basis + mine.projection + mine.march
    there = answer["probe"][::every]
    differs = f"{relative(history[: len(there)], there):.1e}" if measured == steps else ""
    scaled = "" if measured == steps else f" ({measured} steps, scaled)"
    return (
        f"| {mine.dofs:,} | {own:.2f} | {mine.march:.2f} | {mine.steps:,} | {seconds:,.2f}{scaled} | {seconds / own:,.0f} | {differs} |"
    )


def _page(lines: list[str], version: str, command: str) -> str:
    about = versions()
    return f"""# The reduced run beside OpenSeesPy

The same plate on the same mesh of bilinear cells, on its five supports, steps of {MESH_STEP * 1e3:g} ms by Newmark's method, uplift
exact. The reduced run counts mesh, assembly, basis, projection and a march over the whole window, of as many steps as the table says;
OpenSeesPy counts its model, static state and the steps of the scene, Newton's method at each, on MUMPS, as in [pareto.md](pareto.md).
Where these are scaled from the first steps, in which the plate has not lifted yet and Newton's method ends soonest, OpenSeesPy looks
quicker than it is. P3 is compared where it makes all steps. Imports are counted in neither.

{chr(10).join(lines)}

Made by `{command}` on {datetime.now(UTC):%Y-%m-%d} with OpenSeesPy {version}, dolfinx {about["dolfinx"]}, PETSc {about["petsc"]},
Python {about["python"]} ({platform.machine()}, {processor()}, {os.cpu_count()} cores).
"""
