"""One method of analysis on an assembled scene."""

from __future__ import annotations

from dataclasses import replace

from uplift.drivers.analysis.assembled_scene import Analysis, AssembledScene
from uplift.drivers.analysis.crowded_supports import say_crowded_supports
from uplift.drivers.analysis.modal import run_modal
from uplift.drivers.analysis.small_displacements import say_large_displacements
from uplift.drivers.analysis.snapshots import Snapshots
from uplift.drivers.analysis.static import run_static
from uplift.drivers.analysis.task import Task
from uplift.drivers.analysis.time_frequency import run_fourier, run_laplace
from uplift.drivers.analysis.transient import run_transient
from uplift.drivers.process import require_scalars
from uplift.drivers.scene.request import Request
from uplift.forms.assembly.row_labels import rigid_motions
from uplift.meshes.checked import ModelError
from uplift.meshes.findings import say
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
    """Run one method (collective); `snapshots` takes the deformed plate if it is given.

    Raises `ModelError` where it needs a static state and nothing holds the plate.

    A sweep uses `groups` groups of ranks (None: chosen from the sizes), a transient run solves its systems by a factor or by an
    `iterative` method; `watch` shows the progress of long loops and keeps their checkpoints.
    """
    unrestrained = assembly.plate.unrestrained
    request.check_held(assembly.scene, unrestrained)
    if unrestrained:
        say("free", f"nothing holds the plate against {' and '.join(unrestrained)}: what acts in a direction that is free moves it away")
    task = Task(assembly, assembly.operators, request, snapshots, groups, watch)
    if request.basis is not None:
        analysis = _in_basis(task)
    elif request.method == "exact":
        analysis = _exactly(task)
    elif request.method == "transient":
        analysis = run_transient(_solved_iteratively(task) if iterative else task)
    elif request.method == "time-frequency":
        require_scalars("complex")
        analysis = _swept(task)
    else:
        analysis = (run_modal if request.method == "modal" else run_static)(task)
    if snapshots is not None and analysis.passes.ended == "diverged":
        snapshots.start(0)  # what ran away is not what the history holds
    say_crowded_supports(assembly)
    if not analysis.failed:
        say_large_displacements(assembly, analysis)
    return analysis


def _exactly(task: Task) -> Analysis:
    from uplift.drivers.analysis.exact import run_exact

    return run_exact(task)


def _swept(task: Task) -> Analysis:
    return run_laplace(task) if task.exact else run_fourier(task)


def _in_basis(task: Task) -> Analysis:
    from uplift.drivers.analysis.basis import basis_notes, basis_of
    from uplift.solvers.bases.project import project

    assert task.request.basis is not None
    basis, settings = basis_of(task.assembly, task.request.basis, task.request.basis_file)
    with task.assembly.clock.phase("projection"):
        small = project(task.operators, basis)
    with small:
        reduced = replace(task, operators=small, notes={"basis": basis_notes(basis, settings)})
        methods = {"transient": run_transient, "exact": _exactly, "time-frequency": _swept}
        return methods[task.request.method](reduced)


def _solved_iteratively(task: Task) -> Task:
    components = task.assembly.plate.components
    if any(name.startswith("DR") for name in components):
        raise ModelError("--solver", "iterative solves for displacements alone; a shell with rotations needs the direct one")
    return replace(task, rigid_modes=rigid_motions(task.assembly.plate.labels, components))
