"""One analysis: from a scene to histories, with the seconds that each phase took."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from uplift.drivers.analysis.envelope_data import EnvelopeData
from uplift.drivers.analysis.form_cache import form_cache
from uplift.drivers.process import form_compiler, silent_compiler
from uplift.drivers.scene.refinement import kinematics_of
from uplift.drivers.scene.scene import Scene
from uplift.forms.assembly.assemble import AssembledPlate, assemble_plate
from uplift.forms.assembly.compiled_forms import compile_plate
from uplift.forms.assembly.level import in_plane, shifted
from uplift.forms.operators import Operators
from uplift.forms.shells.kinematics import choose, degree_of
from uplift.meshes.checked import ModelError
from uplift.meshes.imported import MeshFile
from uplift.meshes.panels import Panels
from uplift.meshes.plate import Plate
from uplift.meshes.sources import MeshSource
from uplift.meshes.tagged import TaggedMesh, build_mesh
from uplift.solvers.contact.published_passes import Passes
from uplift.solvers.history import History

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

    @contextmanager
    def remainder(self, name: str) -> Iterator[None]:
        """Add the time spent in the block to the phase, less what the block itself adds to other phases."""
        begin, before = time.perf_counter(), sum(self.seconds.values())
        try:
            yield
        finally:
            self.add(name, time.perf_counter() - begin - (sum(self.seconds.values()) - before))

    def line(self) -> str:
        """Return all phases on one line."""
        return ", ".join(f"{name} {s:.2f} s" for name, s in self.seconds.items())


@dataclass
class AssembledScene:
    """A scene that is meshed and assembled, ready for any number of analyses; `with` frees it."""

    scene: Scene
    tagged: TaggedMesh
    plate: AssembledPlate
    clock: Clock

    @property
    def operators(self) -> Operators:
        """The operators of the model."""
        return self.plate.operators

    def __enter__(self) -> AssembledScene:
        """Return itself."""
        return self

    def __exit__(self, *args: object) -> None:
        """Free the operators."""
        self.plate.__exit__(*args)


@dataclass(frozen=True)
class ContactEvents:
    """Contacts that open or close, in the order of time."""

    times: np.ndarray
    """(n,) s."""
    contacts: tuple[str, ...]
    """Names."""
    kinds: tuple[str, ...]
    """"opens" or "closes"."""
    speeds: np.ndarray
    """(n,) m/s of the gap, negative where it closes."""


@dataclass
class Analysis:
    """The histories of one method and what is known about them."""

    method: str
    passes: Passes
    exact: bool
    """Whether uplift was solved exactly; else the history is the last of the published passes."""
    transform_check: float | None = None
    """Largest difference in m between two independent inverse transforms of the probes' spectra."""
    tries: float | None = None
    """Contact problems tried per step, where uplift was solved exactly."""
    lifted: np.ndarray | None = None
    """(nt,) share of the plate's area whose nodes have risen, in percent; nan where it was not asked for."""
    notes: dict[str, Any] = field(default_factory=dict)
    """Further facts for the summary."""
    events: ContactEvents | None = None
    """Where the method locates them."""
    envelopes: EnvelopeData | None = None
    """Extremes of the section forces all over the plate, on rank 0, where the scene asks for them."""

    @property
    def final(self) -> History:
        """The history of the last pass."""
        return self.passes.final

    @property
    def failed(self) -> bool:
        """Whether the iteration did not come to its end."""
        return self.passes.ended in ("diverged", "not converged")


def source_of(scene: Scene) -> MeshSource:
    """Return what the mesh of a scene is made of; which points of joined plates are nodes anyway depends on the degree."""
    source = scene.plate
    if not isinstance(source, Panels):
        return source
    return replace(source, degree=kinematics_of(source, scene.kinematics, scene.model)[2])


def prepare(scene: Scene, comm: Any) -> AssembledScene:
    """Mesh, compile and assemble a scene (collective)."""
    clock, model, source = Clock(), scene.model, source_of(scene)
    kind, degree = "", source.degree

    def layout(flat: bool, order: int, level: float) -> tuple[int, int]:
        """Say whether the mesh shall lie in the plane or in space, and of which order it shall be."""
        nonlocal kind, degree, model
        kind = choose(scene.kinematics, shifted(model, -level), flat)
        model = in_plane(model, level)
        if isinstance(source, MeshFile) and order > 1:  # what is written of a solution stands at the nodes of the mesh
            if degree not in (None, order):
                raise ModelError("mesh.degree", f"expected {order}, the order of the mesh file, got {degree}")
            degree = order
        curved = isinstance(source, Plate) and kind == "plane stress" and degree == 2
        return 3 if kind == "shell" else 2, 2 if curved else order

    with clock.phase("mesh"):
        tagged = build_mesh(comm, source, layout)
    degree = degree_of(kind, degree, tagged.mesh.topology.cell_type.name)
    with clock.phase("forms and compilation"), form_cache(comm), silent_compiler():
        compiled = compile_plate(
            tagged, kind, degree, model, form_compiler(comm), rotary_inertia=scene.kinematics.rotary_inertia,
        )
    with clock.phase("assembly"):
        assembled = assemble_plate(compiled, model)
    return AssembledScene(scene, tagged, assembled, clock)
