"""Values of a scene that may be slips: units, soft contacts, centres that are not given, instants that are not archived."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from uplift.drivers.scene.scene import Scene
from uplift.forms.contact.supports import AXES, TRANSLATIONS
from uplift.meshes.findings import Finding, finding

LIGHT, HEAVY = 50.0, 25_000.0
"""kg/m3: foam is lighter and no metal of a structure heavier; 2.5 is concrete in t/m3."""

SOFT, STIFF = 1e6, 2e12
"""Pa: rubber is softer and diamond stiffer; 30,000 is concrete in MPa."""

FALLS = (1.0, 30.0)
"""m/s2 of free fall: the Moon's, and three times the Earth's; 9810 is in mm/s2."""

SAME = 1e-6
"""Of an archived step: instants that differ by less are one."""


def doubtful_values(scene: Scene) -> Iterator[Finding]:
    """Give what is said of single values, each with its figure."""
    yield from (finding("units", words) for words in _units(scene))
    for support in scene.model.supports:
        if support.unilateral and support.contact[support.axis] < support.stiffness[support.axis]:
            contact, spring = support.contact[support.axis], support.stiffness[support.axis]
            words = f"its contact has {contact:.3g} N/m, softer than its spring of {spring:.3g} N/m"
            yield finding("soft contact", f"supports[{support.name}]: {words}: the plate sinks into the contact more than into the ground")
    for number, entry in enumerate(_loads(scene.source), start=1):
        if entry.get("kind", "ground") == "ground" and _rocks(entry.get("direction")) and "center_of_rotation" not in entry:
            yield finding("rocking", f"load {number}: the ground turns about (0, 0, 0) m, as no center_of_rotation is given")
    yield from (finding("instants", words) for words in _instants(scene))


def _units(scene: Scene) -> Iterator[str]:
    model = scene.model
    for where, material in (("plate", model.material), *((f"parts[{part.group}]", part.material) for part in model.parts)):
        if not LIGHT <= material.density <= HEAVY:
            yield f"{where}.density: {material.density:g} kg/m3 is no density of a structure: is it in another unit, such as t/m3?"
        if not SOFT <= material.young <= STIFF:
            yield f"{where}.young: {material.young:g} Pa is no modulus of a structure: is it in another unit, such as MPa?"
    if model.gravity and not FALLS[0] <= abs(model.gravity) <= FALLS[1]:
        yield f"gravity.acceleration: {model.gravity:g} m/s2: is it in another unit, such as g or mm/s2?"


def _loads(source: dict[str, Any]) -> list[dict[str, Any]]:
    given = source.get("load", [])
    return [given] if isinstance(given, dict) else given


def _rocks(direction: Any) -> bool:
    turning = AXES[TRANSLATIONS:]
    return any(direction.get(axis) for axis in turning) if isinstance(direction, dict) else direction in turning


def _instants(scene: Scene) -> Iterator[str]:
    settings, wanted = scene.transient, scene.output.instants
    if settings is None or not wanted:
        return
    archived = settings.archived
    every = settings.step * settings.every
    late = [instant for instant in wanted if instant > archived[-1] * (1 + SAME)]
    if late:
        yield f"output.instants: {len(late)} of {len(wanted)} lie beyond the end at {archived[-1]:g} s, such as {late[0]:g} s"
    off = [t for t in wanted if t not in late and np.min(np.abs(archived - t)) > SAME * every]
    if off:
        yield f"output.instants: {len(off)} of {len(wanted)} are not archived, every {every:g} s, such as {off[0]:g} s"
