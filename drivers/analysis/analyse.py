"""One method of analysis on an assembled scene."""

from __future__ import annotations

from uplift.drivers.analysis.assembled_scene import Analysis, AssembledScene
from uplift.drivers.analysis.modal import run_modal
from uplift.drivers.analysis.snapshots import Snapshots
from uplift.drivers.analysis.static import run_static
from uplift.drivers.analysis.time_frequency import run_fourier, run_laplace
from uplift.drivers.analysis.transient import run_transient
from uplift.drivers.process import require_scalars
from uplift.drivers.scene.request import Request
from uplift.solvers.watch import Watch


def analyse(
    assembly: AssembledScene,
    request: Request,
    snapshots: Snapshots | None = None,
    *,
    groups: int | None = None,
    watch: Watch | None = None,
    iterative: bool = False,
) -> Analysis:
    """Run one method (collective), filmed if a film is given.

    Raises `ModelError` where it needs a static state and nothing holds the plate.

    A sweep uses `groups` groups of ranks (None: chosen from the sizes), a transient run solves its systems by a factor or by an
    `iterative` method; `watch` shows the progress of long loops and keeps their checkpoints.
    """
    request.check_held(assembly.scene, assembly.plate.unrestrained)
    if request.basis is not None:
        from uplift.drivers.analysis.reduced_methods import analyse_in_basis

        return analyse_in_basis(assembly, request, snapshots)
    if request.method == "time-frequency":
        require_scalars("complex")
        sweep = run_laplace if request.passes is None else run_fourier
        analysis = sweep(assembly, request, snapshots, groups, watch)
    elif request.method == "transient":
        analysis = run_transient(assembly, request, snapshots, watch, iterative)
    else:
        analysis = (run_modal if request.method == "modal" else run_static)(assembly, request, snapshots)
    if snapshots is not None and analysis.passes.ended == "diverged":
        snapshots.start(0)  # what ran away is not what the history holds
    return analysis
