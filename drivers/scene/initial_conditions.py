"""The tables [[initial]] of a scene file."""

from __future__ import annotations

from typing import Any

from uplift.drivers.scene.mesh import point_of
from uplift.drivers.scene.toml_table import Table
from uplift.forms.initial_conditions import InitialCondition, Turn
from uplift.meshes.checked import ModelError

TURNS = {"rotation": ("angle", "rad"), "spin": ("rate", "rad/s")}
"""Entries that are rotations: the name of their amount, and its unit."""

WHAT = ("displacement", "velocity", *TURNS, "mode")


def initial_condition(table: Table) -> InitialCondition:
    """Read one table. Raises `ModelError` for one that says nothing."""
    if not any(name in table.rest for name in (*WHAT, "amplitude")):
        table.note("group", *WHAT, "amplitude")
        table.rest.pop("group", None)
        table.finish()
        raise ModelError(table.where, f"expected one of {', '.join(WHAT)}")
    given: dict[str, Any] = {name: _vector(table, name) for name in ("displacement", "velocity")}
    given |= {name: _turn(table, name, amount) for name, (amount, _) in TURNS.items()}
    condition: InitialCondition = table.whole(InitialCondition, **given)
    return condition


def _vector(table: Table, name: str) -> tuple[float, ...]:
    """Read `{ X = .., Y = .., Z = .. }`; zero where the table, or a component, is absent."""
    inner = Table(table.take(name, dict, default={}), table.key(name))
    values = tuple(inner.take(axis, float, default=0.0) for axis in "XYZ")
    inner.finish()
    return values


def _turn(table: Table, name: str, amount: str) -> Turn | None:
    given = table.take(name, dict, default=None)
    if given is None:
        return None
    inner = Table(given, table.key(name))
    size = inner.take(amount, float)
    if not abs(size) < float("inf"):
        raise ModelError(inner.key(amount), f"expected a finite number {TURNS[name][1]}, got {size!r}")
    turn: Turn = inner.whole(Turn, amount=size, point=point_of(inner.take("point", list), inner.key("point")))
    return turn
