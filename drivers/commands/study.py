"""The command `study`: a scene with values varied, in one basis."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from uplift.drivers import process
from uplift.drivers.commands.options import add_folder, add_scene, fraction


def add(commands: Any) -> None:
    """Add the command to those of the command line."""
    parser = commands.add_parser(
        "study", help="a scene with values varied, in one basis",
        description="Run a scene with exact uplift for every combination of varied values, in a Krylov basis that is made once, and write "
                    "a table and a picture of the extremes. Signals, gravity, gaps, preloads and time steps cost seconds a case; what "
                    "changes stiffness, mass or contacts costs a basis for each case.",
    )
    add_scene(parser)
    parser.add_argument("--vary", action="append", required=True, metavar="KEY=FIRST:LAST:NUMBER",
                       help="a value of the scene by its path, as load.amplitude=0.5:8:16 or supports.RESS.gap=0,0.001; may be repeated")
    parser.add_argument("--basis", type=fraction, default=1e-6, metavar="TOL", help="tolerance of the basis (default: %(default)s)")
    parser.add_argument("--basis-file", type=Path, metavar="FILE",
                       help="read the basis from this HDF5 file, or write it there if it is not there yet")
    add_folder(parser, "study")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace, begin: float) -> int:
    """Run the command; return the exit code."""
    from uplift.drivers.results.folder import claimed_folder
    from uplift.drivers.scene.scene import read_scene

    scene = read_scene(options.scene)
    process.choose_scalars("real")
    out = options.out or Path("results") / options.scene.stem / "study"
    with claimed_folder(out, overwrite=options.overwrite), process.parallel() as comm:
        from uplift.drivers.scene.vary import variation
        from uplift.drivers.studies.variation import run_study, write_study

        variations = [variation(text) for text in options.vary]
        study = run_study(scene, variations, options.basis, options.basis_file, comm)
        if comm.rank == 0:
            write_study(out, study, draw=not options.no_plots)
        if not options.quiet:
            process.say("\n".join(study.lines()))
            facts = study.facts
            process.say(f"{facts['cases']} cases on {len(facts['bases'])} bases in {facts['seconds']:.1f} s\nfiles in {out}")
        return process.FAILED if study.facts["failed"] else 0
