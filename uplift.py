"""Uplift: the seismic response of plates and shells on compression-only supports.

The names below are the face for scripts and notebooks (docs/library.md) and are kept stable; modules below them may move. Nothing heavy is
imported before it is used, so that `choose_scalars` can still choose between real and complex PETSc.
"""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

_here = Path(__file__).parent
# In a checkout the folder of this file holds the rooms; installed, the folder `uplift` beside it does.
__path__ = [str(_here / "uplift" if (_here / "uplift").is_dir() else _here)]

if find_spec("dolfinx_solver"):
    import_module("uplift.meshes.mpi_first")

_FACE = {
    "ModelError": "meshes.checked",
    "SolverError": "solvers.errors",
    "choose_scalars": "drivers.process",
    "read_scene": "drivers.scene.scene",
    "assemble": "drivers.library",
    "transient": "drivers.library",
    "time_frequency": "drivers.library",
    "modes": "drivers.library",
    "krylov_basis": "drivers.library",
    "with_static_answers": "solvers.bases.static_answers",
    "project": "solvers.bases.project",
    "Operators": "forms.operators",
    "from_matrices": "forms.matrices",
    "to_matrices": "forms.matrices",
    "contacts": "forms.matrices",
    "Scheme": "solvers.time_domain.scheme",
    "hilber_hughes_taylor": "solvers.time_domain.scheme",
    "generalised_alpha": "solvers.time_domain.scheme",
    "Ricker": "forms.loads.signals",
    "Sine": "forms.loads.signals",
    "Step": "forms.loads.signals",
    "Table": "forms.loads.signals",
}

__all__ = sorted(_FACE)


def __getattr__(name: str) -> Any:
    """Import a name of the face when it is first used."""
    if name not in _FACE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"uplift.{_FACE[name]}"), name)


def __dir__() -> list[str]:
    """Return the names of the face."""
    return __all__
