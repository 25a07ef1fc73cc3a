"""Whether an answer stays within the theory of small displacements."""

from __future__ import annotations

import numpy as np

from uplift.drivers.analysis.assembled_scene import Analysis, AssembledScene
from uplift.forms.contact.supports import TRANSLATIONS
from uplift.forms.shells.kinematics import up_of
from uplift.meshes.findings import say
from uplift.meshes.tagged import extent_of

SEEN = 0.1
"""rad, or displacement by extent: the second order that small displacements leave out is then 0.5 % of lengths and 5 % of offsets."""

BEYOND = 0.5
"""The same at which it is 12 % of lengths and a quarter of offsets: no small displacement any more."""


def say_large_displacements(assembly: AssembledScene, analysis: Analysis) -> None:
    """Say displacements of probes, and tilts over the supports, that are beyond small ones (collective)."""
    operators, history = assembly.operators, analysis.final
    extent = extent_of(assembly.tagged.mesh.geometry.x, operators.comm)
    largest = float(np.max(np.abs(history.probes[:, operators.probes.moving]), initial=0.0)) / extent
    if largest > SEEN:
        say("large displacements", f"a probe moves by {largest * extent:.3g} m, {largest:.2g} times the extent of the model: "
                                   "beyond small displacements", severity="grave" if largest > BEYOND else "doubt")
    plate = assembly.plate
    up = up_of(plate.model, plate.kind)
    height = _middle_height(assembly, up)  # collective
    points = operators.contacts.points
    if not len(points):
        return
    across = np.delete(points, up, axis=1)
    tilt, gap = _largest_tilt(history.openings(operators.contacts.law), across)
    arm, rise = 0.5 * float(np.linalg.norm(np.ptp(across, axis=0))), height - float(points[:, up].mean())
    falls = float(np.arctan2(arm, rise)) if rise > 0 else np.inf
    words = f"the plate tilts by {tilt:.3g} rad over its supports, where a gap is {gap:.3g} m"
    if tilt > falls:
        say("large displacements", f"{words}; a rigid body falls over beyond {falls:.3g} rad, its middle {rise:.3g} m above supports "
                                   f"{2 * arm:.3g} m apart: this is no answer")
    elif tilt > SEEN:
        say("large displacements", f"{words}: beyond small rotations", severity="grave" if tilt > BEYOND else "doubt")


def _largest_tilt(openings: np.ndarray, across: np.ndarray) -> tuple[float, float]:
    """Return the largest tilt in rad of contacts with `openings` (nt, n_c) m at `across` (n_c, 2) m, and the gap in m with it.

    At each instant it is the difference of the widest and the narrowest gap by the distance of the two contacts.
    """
    rows, widest, narrowest = np.arange(len(openings)), openings.argmax(axis=1), openings.argmin(axis=1)
    rise = openings[rows, widest] - openings[rows, narrowest]
    apart = np.linalg.norm(across[widest] - across[narrowest], axis=1)
    tilts = np.where(apart > 0, np.arctan2(rise, np.where(apart > 0, apart, 1.0)), 0.0)
    worst = int(np.argmax(tilts)) if len(tilts) else -1
    return (float(tilts[worst]), float(openings[worst, widest[worst]])) if worst >= 0 else (0.0, 0.0)


def _middle_height(assembly: AssembledScene, up: int) -> float:
    """Return the coordinate in m along axis `up` of the middle of the mesh (collective)."""
    at = assembly.tagged.mesh.geometry.x[:, up] + (assembly.tagged.level if up == TRANSLATIONS - 1 else 0.0)
    ends = assembly.operators.comm.allgather((float(at.min(initial=np.inf)), float(at.max(initial=-np.inf))))
    return 0.5 * (min(low for low, _ in ends) + max(high for _, high in ends))
