"""Observed orders beside the theory: how errors fall with the step, the mesh, the window, the band and the size of a basis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uplift.drivers.evidence.pareto.cases import AS_PUBLISHED, CORRECTED, FOURIER, KRYLOV, MESH_STEP, MODES, SCHEMES, SPREAD, Mesh, Run
from uplift.drivers.evidence.pareto.errors import Trace, errors, order
from uplift.drivers.evidence.pareto.runs import Outcome


@dataclass(frozen=True)
class Observed:
    """One observed order of the three quantities."""

    case: str
    method: str
    parameter: str
    levels: str
    rates: tuple[float, float, float]
    """Of displacement, contact forces and uplift."""
    theory: str


def observed(outcomes: Sequence[Outcome], traces: Mapping[Run, Trace], decay: float) -> list[Observed]:
    """Return the orders that the runs show, with the slope over the finest three levels, or differences of levels.

    `traces` hold the runs of `outcomes` and of the references; `decay` in 1/s is the rate of the first mode of the case as published.
    """
    rows = [row for case in (AS_PUBLISHED, SPREAD) for method in SCHEMES for row in _in_step(case, method, traces)]
    rows += [row for degree in (1, 2) for row in _in_mesh(degree, traces)]
    rows += _in_window(outcomes, decay)
    rows += _in_band(traces)
    dofs = {o.run.mesh: o.dofs for o in outcomes}
    blocks = {o.run: o.blocks for o in outcomes if o.blocks}
    for case in (AS_PUBLISHED, SPREAD):
        rows += [row for method in (MODES, CORRECTED) for row in _in_size(case, method, traces, dofs)]
        rows += _in_blocks(case, blocks, traces)
    return rows


def _rates(parameters: Sequence[float], values: Sequence[np.ndarray]) -> tuple[float, float, float]:
    first, second, third = (order(parameters, column) for column in np.array(values).T)
    return first, second, third


def _differences(levels: Sequence[tuple[float, Trace]]) -> tuple[list[float], list[np.ndarray]]:
    """Return the parameters of all levels but the finest, and how far the next finer one is from each: free of any reference."""
    finest = levels[-1][1]
    pairs = zip(levels, levels[1:], strict=False)
    steps = [(h, np.array([_distance(a, b, c) for a, b, c in zip(here.parts, there.parts, finest.parts, strict=True)]))
             for (h, here), (_, there) in pairs]
    return [h for h, _ in steps], [value for _, value in steps]


def _distance(here: np.ndarray, there: np.ndarray, size: np.ndarray) -> float:
    return float(np.max(np.abs(here - there)) / max(np.max(np.abs(size)), np.finfo(float).tiny))


def _in_step(case: str, method: str, traces: Mapping[Run, Trace]) -> list[Observed]:
    found = [run for run in traces if (run.case, run.method) == (case, method)]
    meshes = sorted({run.mesh for run in found}, key=lambda mesh: (sum(run.mesh == mesh for run in found), mesh))
    if not meshes:
        return []
    runs = sorted((run for run in found if run.mesh == meshes[-1]), key=lambda run: -run.step)
    levels = [(run.step, traces[run]) for run in runs]
    if len(levels) < 4:
        return []
    parameters, values = _differences(levels)
    return [Observed(case, method, "time step", f"{parameters[-3]:g} to {levels[-1][0]:g} s", _rates(parameters, values), "2")]


def _in_mesh(degree: int, traces: Mapping[Run, Trace]) -> list[Observed]:
    runs = sorted(
        (run for run in traces if (run.case, run.method, run.step, run.mesh.degree) == (SPREAD, "Newmark", MESH_STEP, degree)),
        key=lambda run: run.mesh.factor,
    )
    levels = [(1.0 / run.mesh.factor, traces[run]) for run in runs]
    if len(levels) < 4:
        return []
    parameters, values = _differences(levels)
    name = "mesh, bilinear" if degree == 1 else "mesh, biquadratic"
    cells = f"factor {runs[-4].mesh.factor} to {runs[-1].mesh.factor}"
    theory = "2" if degree == 1 else "2; 3 or more only where nothing lifts: a contact opens between two nodes"
    return [Observed(SPREAD, "Newmark", name, cells, _rates(parameters, values), theory)]


def _in_window(outcomes: Sequence[Outcome], decay: float) -> list[Observed]:
    """Rate in 1/s at which the wrap-around of the bonded pass fades with the length of the window."""
    alike = [o for o in outcomes if (o.run.case, o.run.method, o.run.step, o.run.band) == (AS_PUBLISHED, FOURIER, 0.01, 25.0) and o.bonded]
    alike.sort(key=lambda o: o.run.window or 0.0)
    if len(alike) < 3:
        return []
    longest = alike[-1].bonded
    assert longest is not None
    lengths = [o.run.window or 0.0 for o in alike[:2]]
    values = np.array([errors(o.bonded, longest) for o in alike[:2] if o.bonded])
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = -np.diff(np.log(values), axis=0)[0] / (lengths[1] - lengths[0])
    words = f"{decay:.2f} 1/s = zeta omega of mode 1: what is left after one window decays as exp(-zeta omega L)"
    return [Observed(AS_PUBLISHED, "Fourier, bonded pass", "frequency step 1/L, rate in L [1/s]",
                     f"L = {lengths[0]:g} and {lengths[1]:g} s", (rates[0], rates[1], rates[2]), words)]


def _in_band(traces: Mapping[Run, Trace]) -> list[Observed]:
    samples = {run.step for run in traces if (run.method, run.case, run.window) == (FOURIER, AS_PUBLISHED, 20.48)}
    if not samples:
        return []
    runs = sorted(
        (run for run in traces if (run.method, run.case, run.window, run.step) == (FOURIER, AS_PUBLISHED, 20.48, min(samples))),
        key=lambda run: run.band or 0.0,
    )
    if len(runs) < 4:
        return []
    parameters, values = _differences([(1.0 / (run.band or 1.0), traces[run]) for run in runs])
    levels = f"{runs[-4].band:g} to {runs[-1].band:g} Hz"
    words = "contact forces 1: the kink of a force that sets in has a spectrum that falls as 1/omega^2"
    return [Observed(AS_PUBLISHED, FOURIER, "band (1 / cutoff)", levels, _rates(parameters, values), words)]


def _against_all_dofs(case: str, method: str, traces: Mapping[Run, Trace]) -> tuple[list[Run], list[np.ndarray]]:
    """Return the runs on a basis, largest bilinear mesh, and their errors against all dofs with the same mesh and step."""
    found = [run for run in traces if (run.case, run.method, run.step, run.mesh.degree) == (case, method, MESH_STEP, 1)]
    if not found:
        return [], []
    mesh = max(run.mesh for run in found)
    whole = traces[Run(case, "Newmark", mesh, MESH_STEP)]
    runs = sorted((run for run in found if run.mesh == mesh), key=lambda run: (run.size or 0, -(run.tolerance or 0.0)))
    return runs, [errors(traces[run], whole) for run in runs]


def _in_size(case: str, method: str, traces: Mapping[Run, Trace], dofs: Mapping[Mesh, int]) -> list[Observed]:
    """Up to half of the dofs: beyond, the basis is nearly the whole space."""
    runs, values = _against_all_dofs(case, method, traces)
    few = [i for i, run in enumerate(runs) if (run.size or 0) <= dofs[run.mesh] / 2]
    runs, values = [runs[i] for i in few], [values[i] for i in few]
    if len(runs) < 3:
        return []
    rates = _rates([1.0 / (run.size or 1) for run in runs], values)
    levels = f"{runs[-3].size} to {runs[-1].size} modes, {_mesh_words(runs[0].mesh)}"
    return [Observed(case, method, "1 / number of modes", levels, rates, THEORY[case, method])]


def _in_blocks(case: str, blocks: Mapping[Run, int], traces: Mapping[Run, Trace]) -> list[Observed]:
    """Digits that each block of a Krylov basis adds, over its first three residuals: the last one is at the floor."""
    runs, values = _against_all_dofs(case, KRYLOV, traces)
    runs, values = runs[:3], values[:3]
    numbers = [blocks[run] for run in runs]
    if len(set(numbers)) < 2 or not np.all(np.array(values) > 0):
        return []
    slopes = -np.polyfit(numbers, np.log10(np.array(values)), 1)[0]
    levels = f"{numbers[0]} to {numbers[-1]} blocks, {_mesh_words(runs[0].mesh)}"
    rates = slopes[0], slopes[1], slopes[2]
    return [Observed(case, KRYLOV, "blocks, digits gained by each", levels, rates, "a constant: geometric convergence")]


def _mesh_words(mesh: Mesh) -> str:
    return f"mesh factor {mesh.factor}"


THEORY = {
    (AS_PUBLISHED, MODES): "0: the contacts' compliance under a point load sums 1/j, which has no limit",
    (AS_PUBLISHED, CORRECTED): "2 at a frequency well below the last mode: what is left sums 1/j^3",
    (SPREAD, MODES): "1/2 for the contacts' compliance, one family of modes summing 1/m^2 with j ~ m^2; "
                     "histories as far off as these do not show it",
    (SPREAD, CORRECTED): "5/2 at a frequency well below the last mode: what is left sums 1/m^6",
}
"""Modes j of a membrane have eigenvalues lambda_j ~ j (Weyl). A force f_j on each has the compliance sum f_j^2 / lambda_j. With static
answers in the basis what is left of the motion is omega^2 f_j / lambda_j^2, whose energy, the error of the compliance by Galerkin, sums
omega^4 f_j^2 / lambda_j^3."""
