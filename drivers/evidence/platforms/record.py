"""What one platform answers: its pages of evidence, their times and its versions, kept in a folder."""

from __future__ import annotations

import json
import os
import platform
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

from uplift.drivers.process import say
from uplift.drivers.results.folder import processor, versions, writable_folder
from uplift.drivers.scene.shipped import REFERENCE
from uplift.meshes.checked import ModelError
from uplift.meshes.gmsh_session import gmsh_session

FACTS = "platform.json"

COMMANDS = {
    "verify": ["verify", "--no-plots"],
    "survey": ["survey", "--quick"],
    "benchmarks": ["benchmarks", "--quick"],
    "stability": ["stability", "--quick"],
}
"""Page -> the command that makes it."""

START_UP = ["check", "--no-mesh", str(REFERENCE)]
"""A command that does hardly more than load the libraries."""

LAUNCHED = ("OMPI_COMM", "PMIX", "PMI_", "PRTE")
"""Beginnings of the variables by which an MPI launcher makes a process one of its ranks."""


def record(folder: Path, meshes: Path) -> bool:
    """Run the quick pages into `folder`, with their processor times; return whether all commands succeed.

    The folder `meshes` holds the mesh files of the benchmarks, which differ between releases of gmsh; what it lacks is written there.
    """
    writable_folder(folder)
    if (folder / FACTS).exists():
        raise ModelError("--record", f"{folder} holds a platform already; name another folder")
    good, seconds = True, {}
    for page, command in COMMANDS.items():
        out = folder / page if page == "verify" else folder / f"{page}.md"
        stored = ["--meshes", str(meshes)] if page == "benchmarks" else []
        code, text, first = _timed([*command, *stored, "--out", str(out)])
        if page == "verify":
            (folder / "verify.md").write_text(text, encoding="utf-8")
        good &= code == 0
        seconds[page] = first
        say(f"{page:<12}{first:8.1f} s of processor time{'' if code == 0 else '  FAILED'}")
    seconds["start-up"] = min(_timed(START_UP)[2] for _ in range(3))
    facts: dict[str, Any] = {
        "system": platform.freedesktop_os_release()["PRETTY_NAME"], "versions": versions() | {"gmsh": _gmsh_version()},
        "processor": processor(), "seconds": seconds,
    }
    (folder / FACTS).write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
    return good


def _timed(arguments: list[str]) -> tuple[int, str, float]:
    """Run a command in a process of its own; return its exit code, what it prints and the s that processors have worked for it."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(LAUNCHED)}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, "-m", "uplift.drivers", *arguments], env=environment, stdout=subprocess.PIPE, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done.returncode, done.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _gmsh_version() -> str:
    with gmsh_session() as gmsh:
        return str(gmsh.option.getString("General.Version"))
