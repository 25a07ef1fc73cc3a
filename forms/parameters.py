"""The parameters of a plate model, apart from its mesh."""

from __future__ import annotations

from dataclasses import dataclass

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
