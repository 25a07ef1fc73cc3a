"""Flat plates at any height: a plate that is bent, or stretched in its plane, is computed in the plane Z = 0."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from uplift.forms.contact.supports import PlacedPoint
from uplift.forms.parameters import Cut, PlateModel
from uplift.forms.recovery.axes import Axes


def _with_points(model: PlateModel, move: Callable[[PlacedPoint], PlacedPoint]) -> PlateModel:
    def moved(placed: Any) -> Any:
        return replace(placed, points=tuple(move(point) for point in placed.points))

    def cut(cut: Cut) -> Cut:
        plane = cut.plane and replace(cut.plane, point=move(cut.plane.point))
        return replace(cut, point=move(cut.point), plane=plane)

    def axes(axes: Axes | None) -> Axes | None:
        if axes is None or axes.cylinder is None:
            return axes
        return replace(axes, cylinder=replace(axes.cylinder, point=move(axes.cylinder.point)))

    changed: dict[str, Any] = {name: tuple(moved(p) for p in getattr(model, name)) for name in ("supports", "springs", "masses", "forces")}
    changed["probes"] = tuple(replace(probe, point=move(probe.point)) for probe in model.probes)
    changed["parts"] = tuple(replace(part, axes=axes(part.axes)) for part in model.parts)
    return replace(model, cuts=tuple(cut(one) for one in model.cuts), axes=axes(model.axes), **changed)


def in_plane(model: PlateModel, level: float) -> PlateModel:
    """Return the model with points of height 0, as [x, y] has it, in the plane of a flat mesh at the height `level` in m."""
    return _with_points(model, lambda p: p if isinstance(p, str) or p[2] != 0.0 else (p[0], p[1], level)) if level else model


def shifted(model: PlateModel, by: float) -> PlateModel:
    """Return the model with all its points, and the centres of rotations, moved by so many m along Z."""
    if not by:
        return model
    motions = tuple(replace(motion, center=(*motion.center[:2], motion.center[2] + by)) for motion in model.motions)
    initial = tuple(condition.moved_up(by) for condition in model.initial)
    moved = _with_points(model, lambda p: p if isinstance(p, str) else (p[0], p[1], p[2] + by))
    return replace(moved, motions=motions, initial=initial)
