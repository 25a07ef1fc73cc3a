"""Files of a harmonic run."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.analysis.harmonic import probe_responses
from uplift.drivers.process import heard_findings
from uplift.drivers.report.pictures import draw
from uplift.drivers.results.folder import all_or_nothing, versions, write_columns, write_summary


def respond(assembly: AssembledScene, folder: Path, *, plots: bool) -> list[str]:
    """Sweep the frequencies of the scene, write response.csv into `folder`, and return the lines to print (collective).

    A column holds the answer to one load alone, whose history is exp(i omega t) times its vector: real and imaginary part, modulus and
    phase, all one-sided amplitudes (0 to peak). Ground motions have an amplitude of 1 m/s2 or rad/s2; the answer is relative to
    the ground. Gravity, gaps and preloads have no part in it.
    """
    settings = assembly.scene.harmonic
    assert settings is not None
    operators = assembly.operators
    shaking, answers = probe_responses(assembly)
    names = [f"{load.name}: {probe}" for load in shaking for probe in operators.probes.names]
    values = answers.transpose(0, 2, 1).reshape(len(settings.points), -1)
    if operators.comm.rank == 0:
        with assembly.clock.phase("output"), all_or_nothing(folder) as staging:
            write_columns(staging / "response.csv", _columns(settings.points, names, values))
            if plots:
                from uplift.drivers.report.history_plots import draw_response

                title = f"{assembly.scene.title or 'Uplift'}\nharmonic response, every contact bonded"
                draw(draw_response, staging / "response.png", settings.points, tuple(names), values, title)
            write_summary(staging / "summary.json", {
                "title": assembly.scene.title, "method": "harmonic", "scene": assembly.scene.source, "dofs": operators.n,
                "frequencies": len(settings.points), "loads": [load.name for load in shaking], "ranks": operators.comm.size,
                "peaks": {n: _peak(settings.points, v) for n, v in zip(names, np.abs(values).T, strict=True)},
                "findings": [asdict(finding) for finding in heard_findings()], "seconds": assembly.clock.seconds, "versions": versions(),
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
