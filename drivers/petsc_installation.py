"""Which PETSc an interpreter imports: for real or for complex scalars, and with which environment it imports the other one.

A process has one of the two, from its start. Both stand side by side in Debian's packages (chosen by PETSC_DIR and SLEPC_DIR) and in the
container of the dolfinx project (by PETSC_ARCH, PYTHONPATH and LD_LIBRARY_PATH; its scripts dolfinx-real-mode and dolfinx-complex-mode).
The wheels dolfinx-solver-real and dolfinx-solver-complex and the packages of conda-forge leave one of them in an environment.

Nothing here imports PETSc, MPI or dolfinx: the answer must be there before they are.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

Scalars = Literal["real", "complex"]

BOTH: tuple[Scalars, Scalars] = ("real", "complex")

DEBIAN = Path("/usr/lib")
"""Holds petscdir/petsc-SCALARS and slepcdir/slepc-SCALARS."""

CONTAINER = Path("/usr/local")
"""Holds dolfinx-SCALARS."""

ARCHITECTURES: Mapping[Scalars, str] = {"real": "linux-gnu-real64-32", "complex": "linux-gnu-complex128-32"}
"""Names of the two builds of PETSc in the container."""


@dataclass(frozen=True)
class Installation:
    """The PETSc of an interpreter."""

    scalars: Scalars | None
    """What a process imports as the environment is now; None where PETSc and SLEPc are of different builds."""
    advice: str
    """How to get a build that is missing; {scalars} stands for it."""
    builds: Mapping[Scalars, Mapping[str, str]] = field(default_factory=dict)
    """Builds that the same interpreter can import, and the variables that its environment then needs."""


def installation() -> Installation | None:
    """Return the PETSc of this interpreter, None where it is none of those known here."""
    return _wheel() or _conda() or _container() or _debian()


def _wheel() -> Installation | None:
    """Read the name of the distribution, as in dolfinx_solver_complex-0.11.0.post0.dist-info."""
    module = _origin("dolfinx_solver")
    records = [path.name for path in Path(module).parents[1].glob("dolfinx_solver_*.dist-info")] if module else []
    if not records:
        return None
    scalars: Scalars = "complex" if records[0].startswith("dolfinx_solver_complex") else "real"
    return Installation(scalars, "make a second virtual environment with pip install 'uplift-fem[fenicsx-{scalars}]'")


def _conda() -> Installation | None:
    """Read the build string of conda-forge's package, as in petsc-3.21.5-real_h8cb40c4_101."""
    records = [path.stem for path in (Path(sys.prefix) / "conda-meta").glob("petsc-*.json")]
    if not records:
        return None
    scalars: Scalars = "complex" if "complex" in records[0].rpartition("-")[2] else "real"
    return Installation(scalars, "make a second environment with conda create -c conda-forge fenics-dolfinx 'petsc=*={scalars}*'")


def _container() -> Installation | None:
    folders = {scalars: CONTAINER / f"dolfinx-{scalars}" for scalars in BOTH}
    python = "python{}.{}".format(*sys.version_info[:2])
    packages = {scalars: folder / "lib" / python / "dist-packages" for scalars, folder in folders.items()}
    present = [scalars for scalars in BOTH if (packages[scalars] / "dolfinx").is_dir()]
    here = next((scalars for scalars in present if Path(_origin("dolfinx")).is_relative_to(folders[scalars])), None)
    if here is None:
        return None

    def first(variable: str, path: Path) -> str:
        """Return a list of folders with `path` before all that belong to neither build."""
        listed = os.environ.get(variable, "").split(os.pathsep)
        others = [item for item in listed if item and not any(Path(item).is_relative_to(folder) for folder in folders.values())]
        return os.pathsep.join([str(path), *others])

    builds: dict[Scalars, Mapping[str, str]] = {
        scalars: {
            "PETSC_ARCH": ARCHITECTURES[scalars],
            "PYTHONPATH": first("PYTHONPATH", packages[scalars]),
            "LD_LIBRARY_PATH": first("LD_LIBRARY_PATH", folders[scalars] / "lib"),
        }
        for scalars in present
    }
    agree = os.environ.get("PETSC_ARCH", ARCHITECTURES[here]) == ARCHITECTURES[here]
    return Installation(here if agree else None, "take the image dolfinx/dolfinx, which has both builds", builds)


def _debian() -> Installation | None:
    builds: dict[Scalars, Mapping[str, str]] = {}
    for scalars in BOTH:
        petsc, slepc = DEBIAN / "petscdir" / f"petsc-{scalars}", DEBIAN / "slepcdir" / f"slepc-{scalars}"
        if petsc.exists() and slepc.exists():
            builds[scalars] = {"PETSC_DIR": str(petsc), "SLEPC_DIR": str(slepc)}
    origins = [Path(_origin(module)).resolve() for module in ("petsc4py", "slepc4py")]
    if not builds or not all(origin.is_relative_to(DEBIAN.resolve()) for origin in origins):
        return None
    kinds: list[Scalars] = ["complex" if "complex" in str(origin.relative_to(DEBIAN.resolve())) else "real" for origin in origins]
    return Installation(kinds[0] if kinds[0] == kinds[1] else None, "apt install python3-dolfinx-{scalars}", builds)


def _origin(module: str) -> str:
    """Return the file that a module would be imported from, without importing it (empty if there is none)."""
    found = find_spec(module)
    return (found.origin if found is not None else None) or ""
