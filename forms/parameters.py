"""The parameters of a plate model, apart from its mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forms.material import Material
from forms.signals import Signal
from forms.supports import Spring, Support
from meshes.checked import Checked, quantity


@dataclass(frozen=True)
class Probe(Checked):
    """A point whose displacement is recorded."""

    name: str = quantity("name of the probe")
    point: tuple[float, float] = quantity("position, at a node or anywhere in the plate", "m")


@dataclass(frozen=True)
class GroundMotion:
    """Acceleration of the common base of all springs, m/s2 along a direction (2,)."""

    direction: tuple[float, float]
    signal: Signal


@dataclass(frozen=True)
class PlateModel:
    """All that a plate is made of, apart from its mesh."""

    material: Material
    supports: tuple[Support, ...] = ()
    springs: tuple[Spring, ...] = ()
    probes: tuple[Probe, ...] = ()
    gravity: float = 0.0
    """m/s2 along -Y."""
    motions: tuple[GroundMotion, ...] = ()

    def free_motions(self) -> tuple[str, ...]:
        """Return in words the rigid motions that no spring resists with all contacts closed, however weakly; none if the plate is held."""
        holds = [(s.points, axis) for s in self.springs for axis in range(2) if s.stiffness[axis] > 0]
        holds += [(s.points, axis) for s in self.supports for axis in range(2) if np.isfinite(s.flexibility(axis))]
        points = np.array([p for group, _ in holds for p in group], dtype=float).reshape(-1, 2)
        if not len(points):
            return "sliding along X", "moving along Y", "rotation"
        middle, reach = points.mean(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-300)
        arms = (points - middle) / reach
        axes = np.concatenate([np.full(len(group), axis) for group, axis in holds])
        rows = np.where(
            axes[:, None] == 0,
            np.column_stack([np.ones(len(arms)), np.zeros(len(arms)), -arms[:, 1]]),
            np.column_stack([np.zeros(len(arms)), np.ones(len(arms)), arms[:, 0]]),
        )
        _, singular, motions = np.linalg.svd(rows)
        loose = motions[np.concatenate([singular, np.zeros(3 - len(singular))]) < 1e-9 * max(singular[0], 1.0)]
        names = ("sliding along X", "moving along Y", "rotation")
        return tuple(names[int(np.argmax(np.abs(motion)))] for motion in loose)
