"""Files of a harmonic run."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.analysis.harmonic import responses
from uplift.drivers.process import heard_findings
from uplift.drivers.report.pictures import draw
from uplift.drivers.results.folder import all_or_nothing, versions, write_columns, write_summary
from uplift.solvers.frequency_domain.transfer import Transfer


def respond(assembly: AssembledScene, folder: Path, *, plots: bool) -> list[str]:
    """Sweep the frequencies of the scene, write response.csv into `folder`, and return the lines to print (collective).

    Where the scene asks for internal forces, forces.csv and cuts.csv hold their amplitudes in the same way; principal values and von Mises,
    which are not linear, have none.

    A column holds the answer to one load alone, whose history is exp(i omega t) times its vector: real and imaginary part, modulus and
    phase, all one-sided amplitudes (0 to peak). Ground motions have an amplitude of 1 m/s2 or rad/s2; the answer is relative to
    the ground. Gravity, gaps and preloads have no part in it.
    """
    settings = assembly.scene.harmonic
    assert settings is not None
    operators = assembly.operators
    shaking, transfer = responses(assembly)
    loads = [load.name for load in shaking]
    response = _by_load(loads, _rows(transfer, "probes"))
    names, values = list(response), np.stack([column for _, column in response.values()], axis=1)
    if operators.comm.rank == 0:
        with assembly.clock.phase("output"), all_or_nothing(folder) as staging:
            for table, columns in {"response": response, **_internal_forces(assembly, transfer, loads)}.items():
                write_columns(staging / f"{table}.csv", _columns(settings.points, columns))
            if plots:
                from uplift.drivers.report.history_plots import draw_response

                title = f"{assembly.scene.title or 'Uplift'}\nharmonic response, every contact bonded"
                draw(draw_response, staging / "response.png", settings.points, tuple(names), values, title)
            write_summary(staging / "summary.json", {
                "title": assembly.scene.title, "method": "harmonic", "scene": assembly.scene.source, "dofs": operators.n,
                "frequencies": len(settings.points), "loads": loads, "answers_are": {load: _per(load) for load in loads},
                "ranks": operators.comm.size,
                "peaks": {n: _peak(settings.points, v) for n, v in zip(names, np.abs(values).T, strict=True)},
                "findings": [asdict(finding) for finding in heard_findings()], "seconds": assembly.clock.seconds, "versions": versions(),
            })
    lines = [f"answers to {name} are {_per(name)}" for name in dict.fromkeys(loads)]
    lines += [f"{'load and probe':<40}{'largest modulus':>18}{'at f [Hz]':>14}"]
    for name, column in zip(names, np.abs(values).T, strict=True):
        peak = _peak(settings.points, column)
        lines.append(f"{name:<40}{peak['modulus']:>18.9e}{peak['frequency_Hz']:>14.6g}")
    return lines


def _per(load: str) -> str:
    """Return in words what amplitude of a load its answers are for."""
    if load == "ground motion":
        return "per m/s2 of its acceleration (per rad/s2 about an axis)"
    return "for the forces in N (N m, Pa) that the scene gives it, its signal 1: of 1 N they are per N"


def _rows(transfer: Transfer, name: str) -> dict[str, tuple[str, np.ndarray]]:
    """Return unit and answers (n_f, n_loads) of each output of a group."""
    group = transfer.layout[name]
    return {row: (unit, transfer.group(name)[:, k]) for k, (row, unit) in enumerate(zip(group.names, group.units, strict=True))}


def _by_load(loads: list[str], rows: dict[str, tuple[str, np.ndarray]]) -> dict[str, tuple[str, np.ndarray]]:
    """Return unit and answer (n_f,) of each output to each load, load by load."""
    return {f"{load}: {name}": (unit, values[:, k]) for k, load in enumerate(loads) for name, (unit, values) in rows.items()}


def _internal_forces(assembly: AssembledScene, transfer: Transfer, loads: list[str]) -> dict[str, dict[str, tuple[str, np.ndarray]]]:
    """Return the amplitudes of internal forces by table; a scene that asks for none has no table."""
    groups = {group.name for group in transfer.layout.groups}
    tables = {}
    if "forces" in groups:
        rows = _rows(transfer, "forces")
        tables["forces"] = _by_load(loads, rows | _stresses(assembly.plate.forces.thickness, rows))
    if "cuts" in groups:
        damping = _rows(transfer, "cuts damping") if "cuts damping" in groups else {}
        tables["cuts"] = _by_load(loads, _rows(transfer, "cuts") | damping)
    return tables


def _stresses(thickness: dict[str, float], rows: dict[str, tuple[str, np.ndarray]]) -> dict[str, tuple[str, np.ndarray]]:
    from uplift.forms.recovery.stresses import face_stresses

    found: dict[str, tuple[str, np.ndarray]] = {}
    for probe, t in thickness.items():
        own = {name.rpartition(".")[2]: values for name, (_, values) in rows.items() if name.rpartition(".")[0] == probe}
        found |= {f"{probe}.{name}": ("Pa", values) for name, values in face_stresses(own, t).items()}
    return found


def _columns(frequencies: np.ndarray, answers: dict[str, tuple[str, np.ndarray]]) -> dict[str, np.ndarray]:
    columns = {"frequency [Hz]": frequencies}
    for name, (unit, column) in answers.items():
        columns |= {
            f"{name} re [{unit}]": column.real, f"{name} im [{unit}]": column.imag,
            f"{name} modulus [{unit}]": np.abs(column), f"{name} phase [deg]": np.degrees(np.angle(column)),
        }
    return columns


def _peak(frequencies: np.ndarray, modulus: np.ndarray) -> dict[str, float]:
    row = int(np.argmax(modulus))
    return {"modulus": float(modulus[row]), "frequency_Hz": float(frequencies[row])}
