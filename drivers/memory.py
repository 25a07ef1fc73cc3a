"""The memory of a run: refused before it begins where it cannot fit, told afterwards."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from drivers.request import Request
from drivers.scene import Scene
from meshes.checked import ModelError

if TYPE_CHECKING:
    from solvers.memory import Size

GIB = 2.0**30

ROW = {("quadrilateral", 1): 18, ("quadrilateral", 2): 32, ("triangle", 1): 14, ("triangle", 2): 23}
"""Entries in a row of a matrix with two dofs a node, by cell and degree."""

LOOKS = 20
"""Numbers archived at an instant beside two for each contact; more probes than this need no memory that counts."""


def expected_size(scene: Scene, *, is_complex: bool) -> Size:
    """Return the size of the system that the scene will become."""
    from solvers.memory import Size

    plate = scene.plate
    n = 2 * (plate.nx * plate.degree + 1) * (plate.ny * plate.degree + 1) + 2 * sum(len(s.points) for s in scene.model.supports)
    return Size(n, ROW[plate.cell, plate.degree] * n, is_complex)


def expected_bytes(scene: Scene, request: Request, ranks: int, groups: int | None) -> float:
    """Return the bytes that a run will need on all ranks; a sweep whose groups are not given is counted with one."""
    from solvers import memory

    size = expected_size(scene, is_complex=request.scalars == "complex")
    channels = 2 * sum(len(s.points) for s in scene.model.supports if s.unilateral)
    columns = channels + len(scene.model.motions) + 2
    if request.method == "time-frequency":
        assert scene.fourier is not None or scene.transient is not None
        points = scene.transient.steps + 2 if scene.transient and not request.passes else len(scene.fourier.frequencies)  # type: ignore[union-attr]
        solution = memory.sweep_bytes(size, columns, points, ranks, groups or 1)
    elif request.method == "modal":
        assert scene.modal is not None
        solution = size.factor + 2 * size.matrix + 3 * (scene.modal.number or 100) * size.vector
    else:
        assert scene.transient is not None
        solution = memory.march_bytes(size, channels, len(scene.transient.archived) * (LOOKS + channels))
    return memory.run_bytes(size, solution, ranks)


def check_memory(scene: Scene, request: Request, comm: Any, *, groups: int | None, limit: float | None) -> float:
    """Return the bytes that a run will need on all ranks (collective).

    Raises `ModelError` if those of the ranks on one machine exceed what it has left, or `limit` bytes where that is given.
    """
    from mpi4py import MPI

    from solvers import memory

    need = expected_bytes(scene, request, comm.size, groups)
    here = memory.ranks_here(comm)
    left = memory.available_bytes() if limit is None else limit
    # Of all machines, the one that is the shortest of memory.
    short, share, left = comm.allreduce((need * here / comm.size - left, need * here / comm.size, left), op=MPI.MAX)
    if short > 0:
        raise ModelError(
            "--memory",
            f"the run will need some {share / GIB:.3g} GiB on a machine that "
            f"{'has' if limit is None else 'may give'} {left / GIB:.3g} GiB; a coarser mesh, more machines, or another --memory",
        )
    return need


def memory_facts(need: float, comm: Any) -> dict[str, float]:
    """Return what the summary says of the memory, in MiB (collective)."""
    from solvers.memory import peak_bytes

    largest, whole = peak_bytes(comm)
    return {name: round(value / 2**20, 1) for name, value in (("estimated", need), ("peak_all_ranks", whole), ("peak_largest_rank", largest))}
