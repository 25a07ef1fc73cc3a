"""The cases and the runs of the study of error against run time: every method on meshes, steps, bands and basis sizes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from uplift.drivers.scene.scene import Scene
from uplift.forms.contact.supports import Support
from uplift.meshes.checked import ModelError
from uplift.meshes.plate import Plate
from uplift.solvers.time_domain.scheme import Scheme, generalised_alpha, hilber_hughes_taylor

AS_PUBLISHED = "as published"
SPREAD = "spread supports"

SCHEMES = {
    "Newmark": Scheme(),
    "HHT, alpha = 0.05": hilber_hughes_taylor(0.05),
    "generalised-alpha, rho = 0.8": generalised_alpha(0.8),
}
"""Time stepping in all dofs, by the name of the method."""

LAPLACE, FOURIER, FOURIER_2 = "Laplace march", "Fourier, passes to the end", "Fourier, 2 passes"
NEWMARK_2 = "Newmark, 2 passes"
MODES, CORRECTED, KRYLOV = "modes", "modes + static answers", "block Krylov basis"
SWEEPS = (LAPLACE, FOURIER, FOURIER_2)
"""What needs complex PETSc."""
BASES = (MODES, CORRECTED, KRYLOV)
METHODS = (*SCHEMES, NEWMARK_2, LAPLACE, FOURIER, FOURIER_2, *BASES)

MESH_STEP = 0.005
"""s: step at which meshes are compared with one another."""

INSTANTS = 0.02
"""s: histories are compared at multiples of this, which every step divides."""


@dataclass(frozen=True, order=True)
class Mesh:
    """The scene's mesh with every cell cut into `factor` x `factor`, displacements of `degree`."""

    factor: int = 1
    degree: int = 1

    def name(self, scene: Scene) -> str:
        """Return the number of cells along X and Y, and the degree where it is not 1."""
        kind = "" if self.degree == 1 else ", quadratic"
        plate = rectangle(scene)
        return f"{plate.nx * self.factor} x {plate.ny * self.factor}{kind}"


@dataclass(frozen=True)
class Run:
    """One run of one method; what a method does not know is None."""

    case: str
    method: str
    mesh: Mesh
    step: float
    """s: time step, or distance of the samples in a window."""
    band: float | None = None
    """Hz: highest frequency solved."""
    window: float | None = None
    """s: length of the window, the inverse of the frequency step."""
    size: int | None = None
    """Number of modes."""
    tolerance: float | None = None
    """Residual to which the Krylov basis is grown."""

    @property
    def by_sweep(self) -> bool:
        """Whether it needs complex PETSc."""
        return self.method in SWEEPS

    @property
    def setting(self) -> str:
        """Return step, band, window and size in words."""
        parts = [f"dt {self.step:g} s"]
        if self.band is not None:
            parts += [f"to {self.band:g} Hz", f"window {self.window:g} s"]
        if self.size is not None:
            parts.append(f"{self.size} modes")
        if self.tolerance is not None:
            parts.append(f"residual {self.tolerance:g}")
        return ", ".join(parts)


def rectangle(scene: Scene) -> Plate:
    """Return the scene's plate. Raises `ModelError` where it is no rectangle."""
    if not isinstance(scene.plate, Plate):
        raise ModelError("mesh", "expected a rectangle with width and height, whose cells the study can cut")
    return scene.plate


def spread(scene: Scene, mesh: Mesh) -> Scene:
    """Return the scene on `mesh`, its supports spread along the bottom edge with the same stiffness and mass in all.

    Every node of the edge stands on a share that is the integral of its shape function (trapezoidal rule for degree 1, Simpson's for 2),
    so that the mesh has a limit, which it has not on supports at points: under a point load of a membrane displacements
    grow with the logarithm of the mesh size. Raises `ModelError` for a scene whose supports are no row along that edge.
    """
    own, plate = foot(scene), rectangle(scene)
    finer = replace(plate, nx=plate.nx * mesh.factor, ny=plate.ny * mesh.factor, degree=mesh.degree)
    width = plate.width
    points, share = edge_shares(width, finer.nx, mesh.degree)
    stiffness, mass = own.stiffness[own.axis] * len(own.points), own.mass * len(own.points)
    groups = []
    for j, weight in enumerate(sorted(set(share))):
        along = stiffness * weight / width
        components = tuple(along if axis == own.axis else value for axis, value in enumerate(own.stiffness))
        at = tuple((x, 0.0) for x, w in zip(points, share, strict=True) if w == weight)
        groups.append(replace(own, name=f"{own.name}{'abc'[j]}", points=at, stiffness=components, mass=mass * weight / width))
    return replace(scene, plate=finer, model=replace(scene.model, supports=tuple(groups)))


def foot(scene: Scene) -> Support:
    """Return the row of unilateral supports along the bottom edge that can be spread. Raises `ModelError` if it is not all there is."""
    supports, plate = scene.model.supports, rectangle(scene)
    if len(supports) != 1 or supports[0].unilateral != "Y" or len(supports[0].points) < 2 or supports[0].shares:
        raise ModelError("supports", "expected one group of equal points that pushes along Y, to be spread along the bottom edge")
    points = np.array([point[:2] for point in supports[0].points])
    even = np.linspace(0.0, plate.width, len(points))
    if np.any(points[:, 1] != 0) or not np.allclose(np.sort(points[:, 0]), even, atol=1e-9 * plate.width):
        raise ModelError("supports", "expected equidistant points from one end of the bottom edge to the other")
    if plate.nx % (len(points) - 1):
        raise ModelError("supports", "expected points at nodes of the mesh")
    return supports[0]


def edge_shares(width: float, cells: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes (n,) m of the bottom edge and the lengths (n,) m that they stand for, rounded so that equal ones are equal."""
    nodes = cells * degree + 1
    share = np.zeros(nodes)
    rule = np.array([1.0, 1.0]) / 2 if degree == 1 else np.array([1.0, 4.0, 1.0]) / 6
    for first in range(0, nodes - 1, degree):
        share[first : first + degree + 1] += rule
    return width * np.arange(nodes) / (nodes - 1), np.round(share, 12) * width / cells


def reference_runs(case: str, quick: bool) -> tuple[list[Run], list[Run], list[Run]]:
    """Return the runs that the reference of a case is extrapolated from, each with half the step or cell of the one before.

    First in the step, then in the mesh (none for the case as published, whose supports are points), then again in the step on a
    coarser mesh, which shows how much the extrapolation in the step depends on the mesh.
    """
    if case == AS_PUBLISHED:
        finest = 1.5625e-4 if quick else 9.765625e-6
        return [Run(case, "Newmark", Mesh(), finest * 2**k) for k in (2, 1, 0)], [], []
    coarser, finer = (1, 2) if quick else (2, 4)
    finest = 1.25e-3 if quick else 3.125e-4

    def in_step(factor: int) -> list[Run]:
        return [Run(case, "Newmark", Mesh(factor, 2), step) for step in (*(finest * 2**k for k in (2, 1, 0)), MESH_STEP)]

    in_mesh = [Run(case, "Newmark", Mesh(factor * finer, 2), MESH_STEP) for factor in (1, 2, 4)]
    return in_step(finer), in_mesh, in_step(coarser)


def runs(quick: bool, *, spread_too: bool) -> list[Run]:
    """Return every run of the study, in the order of cases and meshes."""
    table = list(_as_published(quick))
    return table + list(_spread(quick)) if spread_too else table


def _as_published(quick: bool) -> Iterator[Run]:
    mesh, steps = Mesh(), [0.02 / 2**k for k in range(5 if quick else 10)]
    for method in SCHEMES:
        yield from (Run(AS_PUBLISHED, method, mesh, step) for step in (steps if method == "Newmark" else steps[:7]))
    yield Run(AS_PUBLISHED, NEWMARK_2, mesh, 0.005)
    yield from (Run(AS_PUBLISHED, LAPLACE, mesh, step) for step in steps[: 3 if quick else 6])
    yield Run(AS_PUBLISHED, FOURIER_2, mesh, 0.01, 25.0, 20.48)
    for step in (0.01, 0.005) if quick else (0.01, 0.005, 0.0025, 0.00125):
        yield from (Run(AS_PUBLISHED, FOURIER, mesh, step, band, 20.48) for band in (12.5, 25.0, 50.0, 100.0, 200.0) if band <= 0.5 / step)
    yield from (Run(AS_PUBLISHED, FOURIER, mesh, 0.01, 25.0, window) for window in ((10.24, 40.96) if quick else (10.24, 40.96, 81.92)))
    if not quick:
        yield from (Run(AS_PUBLISHED, FOURIER, mesh, 0.25 / band, band, 40.96) for band in (50.0, 100.0, 200.0))
    yield from _on_bases(AS_PUBLISHED, mesh, (0.005, 0.00125) if quick else (0.005, 0.00125, 3.125e-4, 7.8125e-5, 3.90625e-5))


def _spread(quick: bool) -> Iterator[Run]:
    meshes = [Mesh(1), Mesh(2), Mesh(4), Mesh(8), Mesh(1, 2), Mesh(2, 2)] + ([] if quick else [Mesh(16), Mesh(4, 2), Mesh(8, 2)])
    steps = (0.01, 0.005, 0.0025) if quick else (0.02, 0.01, 0.005, 0.0025, 0.00125)
    for mesh in meshes:
        for method in SCHEMES:
            if method == "Newmark" or mesh.factor * mesh.degree <= (2 if quick else 8):
                yield from (Run(SPREAD, method, mesh, step) for step in steps)
    for mesh in (Mesh(1), Mesh(1, 2)) if quick else (Mesh(1), Mesh(2), Mesh(1, 2), Mesh(2, 2)):
        yield from (Run(SPREAD, LAPLACE, mesh, step) for step in steps[: 2 if quick else 3])
        yield from (Run(SPREAD, FOURIER, mesh, 0.01, band, 20.48) for band in ((12.5,) if quick else (12.5, 25.0)))
    for mesh in (Mesh(2), Mesh(4), Mesh(2, 2)) if quick else (Mesh(2), Mesh(4), Mesh(8), Mesh(16), Mesh(2, 2), Mesh(4, 2), Mesh(8, 2)):
        yield from _on_bases(SPREAD, mesh, (0.005,) if quick else (0.005, 0.00125))


def _on_bases(case: str, mesh: Mesh, steps: tuple[float, ...]) -> Iterator[Run]:
    for step in steps:
        yield from (Run(case, method, mesh, step, size=size) for method in (MODES, CORRECTED) for size in (5, 10, 20, 40, 80))
        yield from (Run(case, KRYLOV, mesh, step, tolerance=tolerance) for tolerance in (0.5, 0.1, 0.01, 1e-4))
