"""Harmonic responses of the outputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.process import require_scalars
from uplift.forms.operators import Load, no_contacts
from uplift.meshes.checked import ModelError
from uplift.solvers.frequency_domain.harmonic import harmonic_sweep
from uplift.solvers.frequency_domain.transfer import Transfer


def probe_responses(assembly: AssembledScene) -> tuple[list[Load], np.ndarray]:
    """Return the loads that shake the plate, and the answers (n_f, n_probes, n_loads) m or rad to each of them (collective)."""
    shaking, transfer = responses(assembly)
    return shaking, transfer.probes


def responses(assembly: AssembledScene) -> tuple[list[Load], Transfer]:
    """Return the loads that shake the plate, and the answers of all outputs to each of them (collective).

    The history of a load is exp(i omega t) times its vector. Raises `ModelError` if there is none beside gravity.
    """
    require_scalars("complex")
    settings = assembly.scene.harmonic
    assert settings is not None
    operators = assembly.operators
    shaking = [load for load in operators.loads if not load.internal and not (load.static and load.name == "gravity")]
    if not shaking:
        raise ModelError("load", "expected a load beside gravity: nothing shakes the plate")
    with assembly.clock.phase("solution"):
        linear = replace(operators, loads=shaking, contacts=no_contacts(operators.n_local, operators.comm))
        return shaking, harmonic_sweep(linear, 2 * np.pi * settings.points)
