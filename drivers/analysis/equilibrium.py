"""Whether loads, inertia and reactions of a run balance, in its summary and said where they do not."""

from __future__ import annotations

from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.meshes.findings import say
from uplift.meshes.tagged import extent_of
from uplift.solvers.time_domain.equilibrium import Equilibrium

BALANCED = 1e-6
"""Part of the largest force that loads, inertia and reactions may miss each other by; sound models stay below 1e-9."""


def equilibrium_of(assembly: AssembledScene, values: np.ndarray, every: int = 1) -> Equilibrium:
    """Return what watches the equilibrium at the archived instants, every `every`-th step of a march (collective).

    `values` (nt, n_loads) are those of the load histories there.
    """
    return Equilibrium(assembly.operators, assembly.plate.resultant_motions(), values, every)


def equilibrium_notes(assembly: AssembledScene, equilibrium: Equilibrium) -> dict[str, Any]:
    """Return the imbalance by resultant for the summary, and say it where it counts (collective)."""
    found = equilibrium.imbalance(extent_of(assembly.tagged.mesh.geometry.x, assembly.operators.comm))
    worst = max(found, key=lambda name: found[name], default=None)
    if worst is not None and found[worst] > BALANCED:
        say("equilibrium", f"loads, inertia and reactions do not balance: the {worst} is off by {found[worst]:.1e} of the largest force; "
            "something is so stiff beside what holds it that digits are lost: take a lower stiffness for what is nearly rigid")
    return {"equilibrium": found}
