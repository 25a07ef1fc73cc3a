"""The memory of a run: refused before it begins where it cannot fit, told afterwards."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from uplift.drivers.scene.refinement import expected_dofs, kinematics_of
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import Scene
from uplift.forms.shells.kinematics import AXES_OF
from uplift.meshes.checked import ModelError

if TYPE_CHECKING:
    from uplift.solvers.memory import Size

GIB = 2.0**30

NEIGHBOURS = {
    ("quadrilateral", 1): 9.0, ("quadrilateral", 2): 16.0, ("quadrilateral", 3): 25.0,
    ("triangle", 1): 7.0, ("triangle", 2): 11.5, ("triangle", 3): 17.0,
}
"""Nodes that share a cell with a node, on average over a large mesh, by cell and degree."""

LOOKS = 20
"""Numbers archived at an instant beside two for each contact; more probes than this need no memory that counts."""


def expected_size(scene: Scene, *, is_complex: bool) -> Size:
    """Return the size of the system that the scene will become, near enough."""
    from uplift.solvers.memory import Size

    kind, cell, degree = kinematics_of(scene.plate, scene.kinematics, scene.model)
    n = expected_dofs(scene.plate, scene.kinematics, scene.model)
    n += sum(sum(k > 0 for k in support.stiffness) * len(support.points) for support in scene.model.supports)
    return Size(n, int(len(AXES_OF[kind]) * NEIGHBOURS[cell, degree] * n), is_complex)


def expected_bytes(scene: Scene, request: Request, ranks: int, groups: int | None) -> float:
    """Return the bytes that a run will need on all ranks; a sweep whose groups are not given is counted with one."""
    from uplift.solvers import memory

    size = expected_size(scene, is_complex=request.scalars == "complex")
    channels = 2 * sum(len(s.points) for s in scene.model.supports if s.unilateral)
    columns = channels + len(scene.model.motions) + 2
    if request.method == "time-frequency":
        window = scene.fourier if request.passes else None
        points = len(window.frequencies) if window else (scene.transient.steps + 2 if scene.transient else 1)
        solution = memory.sweep_bytes(size, columns, points, ranks, groups or 1)
    elif request.method == "modal":
        assert scene.modal is not None
        solution = size.factor + 2 * size.matrix + 3 * (scene.modal.number or 100) * size.vector
    elif request.method == "transient":
        assert scene.transient is not None
        solution = memory.march_bytes(size, channels, len(scene.transient.archived) * (LOOKS + channels))
    else:
        solution = memory.march_bytes(size, channels, channels)
    return memory.run_bytes(size, solution, ranks)


def check_memory(scene: Scene, request: Request, comm: Any, *, groups: int | None, limit: float | None) -> float:
    """Return the bytes that a run will need on all ranks (collective).

    Raises `ModelError` if those of the ranks on one machine exceed what it has left, or `limit` bytes where that is given.
    """
    from mpi4py import MPI

    from uplift.solvers import memory

    need = expected_bytes(scene, request, comm.size, groups)
    here = memory.ranks_here(comm)
    left = memory.available_bytes() if limit is None else limit
    # Of all machines, the one that is the shortest of memory.
    short, share, left = comm.allreduce((need * here / comm.size - left, need * here / comm.size, left), op=MPI.MAX)
    if short > 0:
        raise ModelError(
            "--memory",
            f"the run will need some {share / GIB:.3g} GiB on a machine that {'has' if limit is None else 'may give'} "
            f"{left / GIB:.3g} GiB; "
            "a coarser mesh, more machines, or another --memory",
        )
    return need


def memory_facts(need: float, comm: Any) -> dict[str, float]:
    """Return what the summary says of the memory, in MiB (collective)."""
    from uplift.solvers.memory import peak_bytes

    largest, whole = peak_bytes(comm)
    facts = {"estimated": need, "peak_all_ranks": whole, "peak_largest_rank": largest}
    return {name: round(value / 2**20, 1) for name, value in facts.items()}
