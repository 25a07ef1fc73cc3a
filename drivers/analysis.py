"""One analysis: from a scene to histories, with the seconds that each phase took."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from drivers.runtime import form_compiler, require_scalars
from drivers.scene import Scene
from forms.model import AssembledPlate, assemble_plate, compile_plate
from forms.operators import Operators
from meshes.tagged import TaggedMesh, build_plate
from solvers.history import History
from solvers.newmark import Newmark, State, at_rest, settled_state, static_state, transient
from solvers.parameters import Scheme
from solvers.passes import Passes, published_passes

log = logging.getLogger(__name__)


@dataclass
class Clock:
    """Wall seconds by phase, in the order in which the phases began."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Add the time spent in the block to the phase."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.add(name, time.perf_counter() - begin)

    def add(self, name: str, seconds: float) -> None:
        """Add `seconds` to the phase."""
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds

    def line(self) -> str:
        """Return all phases on one line."""
        return ", ".join(f"{name} {s:.2f} s" for name, s in self.seconds.items())


@dataclass
class Plant:
    """A scene that is meshed and assembled, ready for any number of analyses; `with` frees it."""

    scene: Scene
    tagged: TaggedMesh
    assembled: AssembledPlate
    clock: Clock

    @property
    def operators(self) -> Operators:
        """The operators of the model."""
        return self.assembled.operators

    def __enter__(self) -> Plant:
        """Return itself."""
        return self

    def __exit__(self, *args: object) -> None:
        """Free the operators."""
        self.operators.__exit__(*args)


@dataclass
class Analysis:
    """The histories of one method and what is known about them."""

    method: str
    passes: Passes
    transform_check: float | None = None
    """Largest difference in m between two independent inverse transforms of the probes' spectra."""

    @property
    def final(self) -> History:
        """The history of the last pass."""
        return self.passes.histories[-1]


def prepare(scene: Scene, comm: Any) -> Plant:
    """Mesh, compile and assemble a scene (collective)."""
    clock = Clock()
    with clock.phase("mesh"):
        tagged = build_plate(comm, scene.plate)
    with clock.phase("forms and compilation"):
        compiled = compile_plate(tagged, scene.plate.degree, scene.model.material, form_compiler(comm))
    with clock.phase("assembly"):
        assembled = assemble_plate(compiled, scene.model)
    return Plant(scene, tagged, assembled, clock)


def analyse(plant: Plant, method: str, iterations: int) -> Analysis:
    """Run `iterations` passes of `method` (collective)."""
    run = {"transient": _transient, "time-frequency": _time_frequency}[method]
    analysis = run(plant, iterations)
    log.info("%s: %d dofs, %d passes", method, plant.operators.n, iterations)
    return analysis


def _start_state(plant: Plant) -> State:
    settings = plant.scene.transient
    assert settings is not None
    if settings.start == "rest":
        return at_rest(plant.operators)
    if settings.start == "static":
        return static_state(plant.operators)
    settling = settings.settling
    return settled_state(plant.operators, Scheme(settling.beta, settling.gamma), settling.step, settling.steps)


def _transient(plant: Plant, iterations: int) -> Analysis:
    settings = plant.scene.transient
    assert settings is not None
    begin = time.perf_counter()
    with _start_state(plant) as start, Newmark(plant.operators, settings.scheme, settings.step) as method:

        def solve(release: np.ndarray | None) -> History:
            return transient(method, start, settings.steps, every=settings.every, release=release)

        passes = published_passes(solve, plant.operators.contacts.law, iterations)
        factorisation = method.solver.factor_seconds
    plant.clock.add("factorisation", factorisation)
    plant.clock.add("solution", time.perf_counter() - begin - factorisation)
    return Analysis("transient", passes)


def _time_frequency(plant: Plant, iterations: int) -> Analysis:
    from solvers import fourier
    from solvers.harmonic import FourierResponse, sweep

    require_scalars("complex")
    window = plant.scene.fourier
    assert window is not None
    begin = time.perf_counter()
    transfer = sweep(plant.operators, 2 * np.pi * window.frequencies)
    response = FourierResponse(plant.operators, window, transfer)
    passes = published_passes(response.history, plant.operators.contacts.law, iterations)
    last = passes.histories[-1]
    release = plant.operators.contacts.law.release(passes.histories[-2].elongation) if iterations > 1 else None
    again = fourier.inverse_by_sum(response.probe_spectrum(release), window.samples)
    check = float(np.max(np.abs(again - last.probes), initial=0.0))
    plant.clock.add("factorisation", transfer.factor_seconds)
    plant.clock.add("solution", time.perf_counter() - begin - transfer.factor_seconds)
    return Analysis("time-frequency", passes, check)
