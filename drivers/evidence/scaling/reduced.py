"""What the reduced sweep costs as the mesh grows, against one factorisation of the same matrix, the direct sweep and the full march."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene, prepare
from uplift.drivers.analysis.basis import basis_of
from uplift.drivers.evidence.scaling.cost import refined
from uplift.drivers.scene.scene import Scene
from uplift.solvers.bases.project import project
from uplift.solvers.frequency_domain.harmonic import FourierResponse, harmonic_sweep
from uplift.solvers.history import History
from uplift.solvers.memory import peak_bytes
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import stepper_of, transient
from uplift.solvers.time_domain.newmark import Newmark

TOLERANCE = 1e-6
"""Of the basis."""

CASES = ((8, 1000, 12), (16, 1000, 8), (32, 600, 6), (64, 600, 4), (128, 40, 2))
"""Refinement of the scene, steps of the march in all dofs, frequencies that the direct sweep solves."""

QUICK = ((2, 600, 4), (4, 600, 4))

SHOWN = 500
"""A march of fewer steps ends before the plate has lifted; its history is not compared."""

FILE = "sweep.npz"

CHECKED = f"""One basis, grown to a relative residual of {TOLERANCE:g}, serves all frequencies of the window and the march with exact uplift
in it, over the whole window. "Whole" is basis, projection, sweep and march; "factorisation" is the real one that the basis is made
with; all on one rank in one process. The direct sweep is estimated from the frequencies that were solved, one after another. "P3 of
the sweep" is the largest difference of the probe's amplitudes from the direct sweep's at these frequencies, under the same loads and
converged contact forces, over the largest amplitude; "P3 of the march" is that of the displacements from exact uplift by Newmark's
method in all dofs, where that march is long enough to see the plate lift. The last column is what that march costs, everything but
the static state counted, over one factorisation and as many bare solves, timed in turns with the steps (in parentheses
their number)."""
"""What the table shows."""

HEAD = [
    "| dofs | vectors | mesh, assembly s | factorisation s | basis s | projection s | sweep s | march s | whole / factorisation "
    "| peak GiB | direct sweep, estimated s | P3 of the sweep | P3 of the march | march in all dofs / (factorisation + solves) |",
    "|" + "---:|" * 14,
]


@dataclass(frozen=True)
class Reduced:
    """One reduced run; wall seconds."""

    dofs: int
    vectors: int
    ready: float
    """Mesh, forms and assembly."""
    factor: float
    """The real factorisation that the basis is made with."""
    basis: float
    """The whole basis: that factorisation, solves, orthonormalisation, error estimate."""
    projection: float
    sweep: float
    """All frequencies of the window."""
    march: float
    """In the basis, with exact uplift, over the window."""
    steps: int
    """Of that march."""
    memory: float
    """Bytes, the peak of the process at the end of all this."""
    full_steps: int
    """Steps of the march in all dofs, after it."""
    full_over_solves: float
    """The march in all dofs with exact uplift, all counted, over one factorisation and as many bare solves."""
    full_difference: float | None
    """Largest difference of the probes between the two marches over the largest displacement of the same component; None: not compared."""

    @property
    def over_factor(self) -> float:
        """Basis, projection, sweep and march in factorisations."""
        return (self.basis + self.projection + self.sweep + self.march) / self.factor


@dataclass(frozen=True)
class Direct:
    """The direct sweep at a few frequencies."""

    seconds: float
    """A frequency."""
    difference: float
    """Largest difference of a probe's amplitude from the reduced run's, over the largest amplitude of that component."""


def measure_reduced(scene: Scene, comm: Any, factor: int, full_steps: int, checks: int, folder: Path) -> Reduced:
    """Make the basis, sweep the window, march with exact uplift, and leave the response at `checks` frequencies in `folder`."""
    window, settings = scene.fourier, scene.transient
    assert window is not None and settings is not None
    begin = time.perf_counter()
    with prepare(refined(scene, factor), comm) as assembly:
        seconds = [time.perf_counter() - begin]

        def timed(action: Callable[[], Any]) -> Any:
            begin = time.perf_counter()
            done = action()
            seconds.append(time.perf_counter() - begin)
            return done

        basis, _ = timed(lambda: basis_of(assembly, TOLERANCE, None))
        model = timed(lambda: project(assembly.operators, basis))
        transfer = timed(lambda: harmonic_sweep(model, 2 * np.pi * window.frequencies))
        steps = round(window.length / settings.step)
        every = steps // window.samples
        start = static_state(model, exact_uplift=True)

        def march() -> History:
            with stepper_of(model, settings.scheme, settings.step, exact_uplift=True) as stepper:
                return transient(stepper, start, steps, every=every)

        run = timed(march)
        memory = peak_bytes(comm)[0]
        response = FourierResponse(model, window, transfer)
        release = run.release[: window.samples]
        chosen = np.round(np.linspace(0.04, 1.0, checks) * (len(window.frequencies) - 1)).astype(int)
        history = run.probes
        np.savez(
            folder / FILE, history=history,
            frequencies=window.frequencies[chosen], drive=response.spectrum(release)[chosen],
            probes=response.probe_spectrum(release)[chosen],
        )
        ratio, full = _full_march(assembly, full_steps, every, basis.growth.seconds["factorisation"])
        compared = full_steps >= SHOWN
        ready, grown, projected, swept, marched = seconds
        return Reduced(
            dofs=assembly.operators.n, vectors=basis.size, ready=ready, factor=basis.growth.seconds["factorisation"], basis=grown,
            projection=projected, sweep=swept, march=marched, steps=steps, memory=memory, full_steps=full_steps, full_over_solves=ratio,
            full_difference=relative(history[: len(full)], full) if compared else None,
        )


class _BareSolves:
    """Solves once with the factor of a march at every instant that it archives, so that both meet the same state of the machine."""

    def __init__(self, method: Newmark) -> None:
        self.seconds = 0.0
        self.number = 0
        self._solver = method.solver
        self._right, self._solution = method.operators.new_vector(), method.operators.new_vector()
        self._right.set(1.0)

    def wants(self, row: int) -> bool:
        return True

    def watch(self, row: int, values: np.ndarray) -> None:
        begin = time.perf_counter()
        self._solver.solve(self._right, self._solution)
        self.seconds += time.perf_counter() - begin
        self.number += 1

    def kept(self) -> tuple[np.ndarray, np.ndarray]:
        raise NotImplementedError("a march that is timed keeps no checkpoint")

    def restore(self, shares: np.ndarray, fields: np.ndarray) -> None:
        raise NotImplementedError("a march that is timed keeps no checkpoint")


def _full_march(assembly: AssembledScene, steps: int, every: int, factor: float) -> tuple[float, np.ndarray]:
    """March in all dofs; return the cost over one factorisation and as many bare solves, and the probes at every `every`-th step."""
    settings, operators = assembly.scene.transient, assembly.operators
    assert settings is not None
    with static_state(operators, exact_uplift=True) as start:
        begin = time.perf_counter()
        with Newmark(operators, settings.scheme, settings.step, exact_uplift=True) as method:
            bare = _BareSolves(method)
            history = transient(method, start, steps, every=every, watcher=bare)
            cost = time.perf_counter() - begin - bare.seconds
    return cost / (factor + steps * bare.seconds / bare.number), history.probes


def relative(values: np.ndarray, reference: np.ndarray) -> float:
    """Return the largest difference (n, components) over the largest size of its component."""
    return float(np.max(np.max(np.abs(values - reference), axis=0) / np.max(np.abs(reference), axis=0)))


def measure_direct(scene: Scene, comm: Any, factor: int, folder: Path) -> Direct:
    """Solve the frequencies in `folder` directly, under the same loads and contact forces (complex PETSc)."""
    with np.load(folder / FILE) as saved, prepare(refined(scene, factor), comm) as assembly:
        frequencies, drive, probes = saved["frequencies"], saved["drive"], saved["probes"]
        begin = time.perf_counter()
        transfer = harmonic_sweep(assembly.operators, 2 * np.pi * frequencies, groups=1)
        seconds = (time.perf_counter() - begin) / len(frequencies)
        return Direct(seconds, relative(probes, np.einsum("fpj,fj->fp", transfer.probes, drive)))


def row(mine: Reduced, direct: Direct, frequencies: int) -> str:
    """Return the line of the table."""
    gib = mine.memory / 2**30
    march = "" if mine.full_difference is None else f"{mine.full_difference:.1e}"
    return (
        f"| {mine.dofs:,} | {mine.vectors} | {mine.ready:.1f} | {mine.factor:.2f} | {mine.basis:.2f} | {mine.projection:.2f} "
        f"| {mine.sweep:.2f} | {mine.march:.2f} | {mine.over_factor:.1f} | {gib:.2f} | {direct.seconds * frequencies:,.0f} "
        f"| {direct.difference:.1e} | {march} | {mine.full_over_solves:.2f} ({mine.full_steps}) |"
    )


def reduced_rows(
    scene: Scene, child: Callable[..., dict[str, Any]], say: Callable[[str], None], *, quick: bool
) -> list[str]:
    """Measure all cases, each in processes of its own, and return the table; `child(*arguments)` returns what one of them printed."""
    assert scene.fourier is not None
    lines = list(HEAD)
    for line in lines:
        say(line)
    for factor, steps, checks in QUICK if quick else CASES:
        with tempfile.TemporaryDirectory() as folder:
            mine = Reduced(**child("reduced", factor, steps, checks, folder))
            direct = Direct(**child("direct", factor, folder))
        lines.append(row(mine, direct, len(scene.fourier.frequencies)))
        say(lines[-1])
    return lines
