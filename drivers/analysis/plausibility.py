"""A few figures by which an engineer sees at once whether a scene is what was meant."""

from __future__ import annotations

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.analysis.modes import Wanted, find_modes
from uplift.forms.contact.supports import TRANSLATIONS
from uplift.meshes.checked import ModelError
from uplift.solvers.bases.pencil import dofs_with_mass
from uplift.solvers.errors import SolverError
from uplift.solvers.time_domain.initial import static_state

INSTANTS = 100_001
"""At which a signal is looked at."""


def plausibility(assembly: AssembledScene, *, rest_needed: bool) -> str:
    """Return first frequency, displacement at rest, largest acceleration of the ground and mass, in one line (collective).

    Every contact is bonded for the frequency; at rest those that pull are open. Raises `ModelError` where the scene needs a state of
    rest (`rest_needed`) and has none.
    """
    parts = [_first_frequency(assembly), _at_rest(assembly, rest_needed=rest_needed), _of_ground(assembly)]
    return ", ".join([part for part in parts if part] + [f"{assembly.plate.total_mass:,.1f} kg"])


def _first_frequency(assembly: AssembledScene) -> str:
    if not dofs_with_mass(assembly.operators):
        return "no mass and no frequency"
    try:
        return f"first frequency {find_modes(assembly, Wanted(1, None, 0.0)).frequencies[0]:.4g} Hz"
    except (ModelError, SolverError):
        return "free to move without strain"


def _at_rest(assembly: AssembledScene, *, rest_needed: bool) -> str:
    plate, operators = assembly.plate, assembly.operators
    try:
        with static_state(operators, exact_uplift=True) as state:
            moved = np.abs(plate.displacement(np.asarray(state.displacement.array_r)))
    except (ModelError, SolverError):
        if rest_needed:
            raise
        return "no state of rest"
    largest = max(operators.comm.allgather(float(np.max(moved[:, :TRANSLATIONS], initial=0.0))))
    return f"at rest {1e3 * largest:.4g} mm at most"


def _of_ground(assembly: AssembledScene) -> str:
    times = np.linspace(0.0, assembly.scene.horizon, INSTANTS)
    total = np.zeros((len(times), TRANSLATIONS))
    for motion in assembly.plate.model.motions:
        total += np.outer(motion.signal(times), motion.direction[:TRANSLATIONS])
    largest = float(np.max(np.linalg.norm(total, axis=1)))
    return f"ground up to {largest:.4g} m/s2" if largest else ""
