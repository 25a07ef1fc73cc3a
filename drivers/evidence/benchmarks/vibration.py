"""The benchmarks of forced vibration: a supported plate under a pressure that swings, or that is put on at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from uplift.drivers.evidence.benchmarks.cases import EDGES, NAFEMS
from uplift.drivers.evidence.benchmarks.runs import Check, Outcome, Runner, targets
from uplift.drivers.evidence.benchmarks.theory import SupportedPlate
from uplift.forms.shells.material import Material

THIN = {**NAFEMS, "alpha": 1.339e-3, "beta": 0.299}
THICK = {**NAFEMS, "thickness": 1.0, "alpha": 6.929e-5, "beta": 5.772}
"""Rayleigh damping of 2 % in the first mode."""

PRESSURE = {"thin": 100.0, "thick": 1e6}
"""Pa."""


def _table(plate: dict[str, float], pressure: float) -> dict[str, Any]:
    return {
        "mesh": {"width": 10.0, "height": 10.0, "nx": 8, "ny": 8}, "plate": plate,
        "kinematics": {"kind": "bending", "rotary_inertia": True}, "conditions": [{"group": e, "edge": "hard"} for e in EDGES],
        "load": [{"kind": "pressure", "name": "P", "value": pressure, "signal": "step"}],
        "probes": [{"name": "MIDDLE", "point": [5.0, 5.0]}],
    }


def harmonic(runner: Runner) -> list[Outcome]:
    """Run NAFEMS 13H and 21H: steady vibration of the thin and of the thick plate."""
    outcomes = []
    for which, plate in (("thin", THIN), ("thick", THICK)):
        theory = SupportedPlate(10.0, Material(**plate))
        first = theory.frequencies(1)[0]
        points = first * np.array([0.0, 0.5, 0.9, 1.5, *np.linspace(0.95, 1.05, 201)])
        table = _table(plate, PRESSURE[which]) | {"harmonic": {"frequencies": points.tolist()}}
        frequencies, answers, words, dofs = runner.harmonic(table)
        found = np.abs(answers[:, 0])
        exact = np.abs(theory.harmonic(PRESSURE[which], frequencies))
        peak, peak_exact = 4 + int(np.argmax(found[4:])), 4 + int(np.argmax(exact[4:]))
        checks = [Check(f"{which}: {frequencies[i]:.3f} Hz, modulus", "mm", 1e3 * found[i], 1e3 * exact[i]) for i in range(4)]
        checks += [
            Check(f"{which}: peak", "mm", 1e3 * found[peak], 1e3 * exact[peak_exact]),
            Check(f"{which}: frequency of the peak", "Hz", frequencies[peak], frequencies[peak_exact], 2e-3),
        ]
        if which == "thin":
            printed = targets("13H")
            checks.append(Check("thin: peak", "mm", 1e3 * found[peak], printed["peak"], note="as NAFEMS prints it"))
            checks.append(Check("thin: frequency of the peak", "Hz", frequencies[peak], printed["frequency"], note="as NAFEMS prints it"))
        outcomes.append(Outcome(words, dofs, tuple(checks)))
    return outcomes


def transient(runner: Runner) -> list[Outcome]:
    """Run NAFEMS 13T and 21T: a pressure put on at once, by three methods."""
    outcomes = []
    for which, plate in (("thin", THIN), ("thick", THICK)):
        theory = SupportedPlate(10.0, Material(**plate))
        period = 1 / theory.frequencies(1)[0]
        step = float(f"{period / 200:.2g}")
        table = _table(plate, PRESSURE[which]) | {
            "transient": {"step": step, "duration": 300 * step, "start": "rest"}, "modal": {"number": 12},
        }
        for method in ("transient", "modal", "time-frequency"):
            if runner.quick and method != "transient":
                continue
            probes, history, words, dofs = runner.history(table, method)
            exact, found = theory.step(PRESSURE[which], history.times), probes["MIDDLE.DZ"]
            top, top_exact = int(np.argmax(found)), int(np.argmax(exact))
            distance = 1e3 * float(np.max(np.abs(found - exact)))
            checks = [
                Check(f"{which}: peak", "mm", 1e3 * found[top], 1e3 * exact[top_exact]),
                Check(f"{which}: time of the peak", "ms", 1e3 * history.times[top], 1e3 * history.times[top_exact]),
                Check(f"{which}: largest difference at any time", "mm", distance, 0.0, note="of the peak", scale=1e3 * exact[top_exact]),
            ]
            outcomes.append(Outcome(f"{words}; {method}, step {1e3 * step:g} ms", dofs, tuple(checks)))
    return outcomes
