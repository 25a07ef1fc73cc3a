"""The cases of the survey: changes of a scene's TOML table, by name."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

AGREEMENT = 1e-7
"""Largest admissible difference of two exact solvers of the same equations, relative to the largest displacement. Their round-off
stays below 1e-8 in all cases but those whose contacts chatter."""

END = 1e-7
"""The published passes end when both of their norms are below this."""

IN_TIME, IN_WINDOW, UNBOUNDED = 300, 200, 1000
"""Published passes at most: in time, by the Fourier sweep, and in time if those that run away are let run."""

HIGH = 50.0
"""Hz: contact forces above this are not the plate's, whose response to a pulse of a few Hz ends far below."""


@dataclass(frozen=True)
class Case:
    """A variation of a scene: dotted keys of its file with their new values, functions of the old ones, or None to take them out."""

    name: str
    changes: dict[str, Any] = field(default_factory=dict)
    claimed: bool = True
    """Whether the exact solvers must agree."""


def _penalty(stiffness: float) -> dict[str, Any]:
    return {"supports.stiffness.X": stiffness, "supports.contact": {"X": stiffness, "Y": stiffness}}


PENALTIES = {f"penalty {exponent}": 10.0**power for exponent, power in ((f"1e{p} N/m", p) for p in (12, 13, 14, 16, 18))}

STIFF = {"supports.stiffness.Y": 1e12}

COMMON = {"transient.every": 1, "transient.start": "static"}
"""Of all cases: every step is kept, and all methods start from the same state of rest."""

CASES = (
    Case("reference"),
    Case("amplitude 4 m/s2", {"load.amplitude": 4.0}),
    Case("amplitude 8 m/s2", {"load.amplitude": 8.0}),
    Case("supports 1e7 N/m", {"supports.stiffness.Y": 1e7}),
    Case("supports 1e9 N/m", {"supports.stiffness.Y": 1e9}),
    Case("supports 1e12 N/m", STIFF, claimed=False),
    Case("damping / 5", {"plate.alpha": lambda old: old / 5, "plate.beta": lambda old: old / 5}),
    Case("no damping", {"plate.alpha": 0.0, "plate.beta": 0.0}),
    Case("f = 0.5 Hz", {"load.frequency": 0.5}),
    Case("f = 1.5 Hz", {"load.frequency": 1.5}),
    Case("f = 3 Hz", {"load.frequency": 3.0}),
    Case("nu = 0.45", {"plate.poisson": 0.45}),
    Case("E x 10", {"plate.young": lambda old: 10 * old}),
    Case("E / 10", {"plate.young": lambda old: old / 10}),
    Case("gap 5 mm", {"supports.gap": 0.005}),
    Case("two supports", {"supports.count": 2}),
    Case("no gravity", {"gravity": None}),
    Case("sideways released", {"supports.sideways": "released"}),
    *(Case(name, _penalty(stiffness)) for name, stiffness in PENALTIES.items()),
)

QUICK = ("reference", "amplitude 4 m/s2", "penalty 1e12 N/m")


def _hht(alpha: float) -> dict[str, Any]:
    return {"transient.method": "hht", "transient.alpha": alpha}


def _generalised(rho: float) -> dict[str, Any]:
    return {"transient.method": "generalised-alpha", "transient.rho_infinity": rho}


def refined(by: int) -> dict[str, Any]:
    """Return the change to steps that are `by` times as short."""
    return {"transient.step": lambda old: old / by}


CHATTER = (
    Case("average acceleration"),
    Case("HHT, alpha = 0.05", _hht(0.05)),
    Case("HHT, alpha = 0.3", _hht(0.3)),
    Case("generalised-alpha, rho = 0.8", _generalised(0.8)),
    Case("generalised-alpha, rho = 0.3", _generalised(0.3)),
    Case("generalised-alpha, rho = 0", _generalised(0.0)),
    Case("average acceleration, step / 4", refined(4)),
    Case("average acceleration, step / 16", refined(16)),
    Case("generalised-alpha, rho = 0, step / 4", _generalised(0.0) | refined(4)),
    Case("generalised-alpha, rho = 0, step / 16", _generalised(0.0) | refined(16)),
)
