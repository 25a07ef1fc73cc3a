"""The harmonic response: complex answers of the probes to each load at given frequencies, every contact bonded."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from drivers.analysis import Plant
from drivers.output import all_or_nothing, versions, write_columns, write_summary
from drivers.runtime import require_scalars
from forms.operators import no_contacts
from meshes.checked import ModelError
from solvers.harmonic import harmonic_sweep


def respond(plant: Plant, folder: Path, *, plots: bool) -> list[str]:
    """Sweep the frequencies of the scene, write response.csv into `folder`, and return the lines to print (collective).

    A column holds the answer to one load alone, whose history is exp(i omega t) times its vector: real and imaginary part, modulus and
    phase, all one-sided amplitudes (0 to peak). Ground motions have an amplitude of 1 m/s2 or rad/s2; the answer is relative to
    the ground. Gravity, gaps and preloads have no part in it.
    """
    require_scalars("complex")
    settings = plant.scene.harmonic
    assert settings is not None
    operators = plant.operators
    shaking = [load for load in operators.loads if not load.internal and not (load.static and load.name == "gravity")]
    if not shaking:
        raise ModelError("load", "expected a load beside gravity: nothing shakes the plate")
    with plant.clock.phase("solution"):
        linear = replace(operators, loads=shaking, contacts=no_contacts(operators.n_local, operators.comm))
        answers = harmonic_sweep(linear, 2 * np.pi * settings.points).probes
    names = [f"{load.name}: {probe}" for load in shaking for probe in operators.probes.names]
    values = answers.transpose(0, 2, 1).reshape(len(settings.points), -1)
    if operators.comm.rank == 0:
        with plant.clock.phase("output"), all_or_nothing(folder) as staging:
            write_columns(staging / "response.csv", _columns(settings.points, names, values))
            if plots:
                from drivers.plots import draw_response

                title = f"{plant.scene.title or 'Uplift'}\nharmonic response, every contact bonded"
                draw_response(staging / "response.png", settings.points, tuple(names), values, title)
            write_summary(staging / "summary.json", {
                "title": plant.scene.title, "method": "harmonic", "scene": plant.scene.source, "dofs": operators.n,
                "frequencies": len(settings.points), "loads": [load.name for load in shaking], "ranks": operators.comm.size,
                "peaks": {n: _peak(settings.points, v) for n, v in zip(names, np.abs(values).T, strict=True)},
                "seconds": plant.clock.seconds, "versions": versions(),
            })
    lines = [f"{'load and probe':<40}{'largest modulus':>18}{'at f [Hz]':>14}"]
    for name, column in zip(names, np.abs(values).T, strict=True):
        peak = _peak(settings.points, column)
        lines.append(f"{name:<40}{peak['modulus']:>18.9e}{peak['frequency_Hz']:>14.6g}")
    return lines


def _columns(frequencies: np.ndarray, names: list[str], values: np.ndarray) -> dict[str, np.ndarray]:
    columns = {"frequency [Hz]": frequencies}
    for name, column in zip(names, values.T, strict=True):
        unit = "rad" if ".DR" in name else "m"
        columns |= {
            f"{name} re [{unit}]": column.real, f"{name} im [{unit}]": column.imag,
            f"{name} modulus [{unit}]": np.abs(column), f"{name} phase [deg]": np.degrees(np.angle(column)),
        }
    return columns


def _peak(frequencies: np.ndarray, modulus: np.ndarray) -> dict[str, float]:
    row = int(np.argmax(modulus))
    return {"modulus": float(modulus[row]), "frequency_Hz": float(frequencies[row])}
