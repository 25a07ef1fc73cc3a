"""Rigid motions at single points, and by virtual work the resultants of forces that act there."""

from __future__ import annotations

import numpy as np

from uplift.forms.contact.supports import TRANSLATIONS, Spring, Support
from uplift.forms.parameters import PlateModel


def rigid_value(point: np.ndarray, axis: int, motion: int, center: np.ndarray) -> float:
    """Return the component `axis` at `point` of the rigid motion by 1 m along or 1 rad about axis `motion` through `center`."""
    if axis >= TRANSLATIONS or motion < TRANSLATIONS:
        return float(axis == motion)
    turn = np.zeros(3)
    turn[motion - TRANSLATIONS] = 1.0
    return float(np.cross(turn, point - center)[axis])


def resultants_of(point: np.ndarray, axis: int, center: np.ndarray) -> np.ndarray:
    """Return force and moment about `center` (6,) of a unit force along, or a unit moment about, `axis` at `point`.

    By virtual work: each is the motion of the point along `axis` under the rigid motion that it works on.
    """
    return np.array([rigid_value(point, axis, motion, center) for motion in range(6)])


def foot_middle(model: PlateModel) -> np.ndarray:
    """Return the point (3,) m about which moments are taken: the middle of the box that holds all supports and springs."""
    groups: tuple[Support, ...] | tuple[Spring, ...] = model.supports or model.springs
    points = [p for group in groups for p in group.points]
    if not points:
        return np.zeros(3)
    middle: np.ndarray = 0.5 * (np.min(points, axis=0) + np.max(points, axis=0))
    return middle
