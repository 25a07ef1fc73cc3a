"""Work on an assembled scene that leaves a folder of files."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from uplift.drivers import process

if TYPE_CHECKING:
    from uplift.drivers.analysis.assembled_scene import AssembledScene


def assembled(options: argparse.Namespace, begin: float, name: str, work: Callable[[AssembledScene, Path], list[str]]) -> int:
    """Assemble the scene, let `work` write its files into a folder, and print the lines that it returns."""
    from uplift.drivers.results.folder import claimed_folder
    from uplift.drivers.scene.scene import read_scene

    scene = read_scene(options.scene)
    process.choose_scalars("real")
    out = options.out or Path("results") / options.scene.stem / name
    with claimed_folder(out, overwrite=options.overwrite), process.parallel() as comm:
        from uplift.drivers.analysis.assembled_scene import prepare

        start_up = time.perf_counter() - begin
        with prepare(scene, comm) as assembly:
            assembly.clock.add("start-up", start_up)
            lines = work(assembly, out)
            if not options.quiet:
                process.say("\n".join(lines))
                process.say(f"\nseconds: {assembly.clock.line()}\nfiles in {out}")
    return 0
