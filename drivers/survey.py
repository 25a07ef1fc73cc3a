"""A survey of uplift: the reference case and its variations by every method, as a page of tables.

Each case is run exactly in time and by the Laplace sweep, which must agree, and by the published passes in time and by the
Fourier sweep, which may or may not arrive. Two tables more: supports so stiff that the average-acceleration scheme chatters, and the
convergence of the reference case in the time step.
"""

from __future__ import annotations

import copy
import dataclasses
import datetime
import math
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.fft

from drivers.analysis import Plant, prepare
from drivers.methods import analyse
from drivers.output import all_or_nothing, versions, writable_folder
from drivers.request import Request
from drivers.runtime import say
from drivers.scene import Scene, Transient, build_scene, read_scene
from drivers.verify import SCENE
from forms.operators import Operators
from meshes.checked import ModelError
from solvers.history import History
from solvers.newmark import Newmark, at_rest, transient
from solvers.passes import RUNAWAY, Passes, published_passes

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


def _refined(by: int) -> dict[str, Any]:
    return {"transient.step": lambda old: old / by}


CHATTER = (
    Case("average acceleration"),
    Case("HHT, alpha = 0.05", _hht(0.05)),
    Case("HHT, alpha = 0.3", _hht(0.3)),
    Case("generalised-alpha, rho = 0.8", _generalised(0.8)),
    Case("generalised-alpha, rho = 0.3", _generalised(0.3)),
    Case("generalised-alpha, rho = 0", _generalised(0.0)),
    Case("average acceleration, step / 4", _refined(4)),
    Case("average acceleration, step / 16", _refined(16)),
    Case("generalised-alpha, rho = 0, step / 4", _generalised(0.0) | _refined(4)),
    Case("generalised-alpha, rho = 0, step / 16", _generalised(0.0) | _refined(16)),
)


def varied(table: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Return a copy of a scene's TOML table with `changes`, see `Case`; in arrays of tables every table is changed.

    Raises `ModelError` if the scene lacks a table, or an old value, that is to be changed.
    """
    table = copy.deepcopy(table)
    for path, value in changes.items():
        *groups, key = path.split(".")
        places = [table]
        for group in groups:
            _require(places, group, path)
            places = [inner for place in places for inner in _tables(place[group])]
        if callable(value):
            _require(places, key, path)
        for place in places:
            if value is None:
                place.pop(key, None)
            else:
                place[key] = value(place[key]) if callable(value) else value
    return table


def _require(places: list[dict[str, Any]], key: str, path: str) -> None:
    if not all(key in place for place in places):
        raise ModelError(path, "missing; the survey varies it")


def _tables(entry: Any) -> list[dict[str, Any]]:
    return entry if isinstance(entry, list) else [entry]


@dataclass(frozen=True)
class PassesInTime:
    """What became of the published passes in time, tensions taken at every step."""

    passes: Passes
    check: float
    """Difference of the second pass by superposition and by time stepping."""
    number_unbounded: int = 0
    """Passes done when those that ran away were let run; 0 if they did not."""
    ended_unbounded: str = ""
    largest: float = 0.0
    """m: largest displacement on the way."""


@dataclass(frozen=True)
class Outcome:
    """What one case gave."""

    case: Case
    exact: History
    difference: float
    """Transient and Laplace, largest difference of any probe at any step, relative to the largest displacement."""
    opened: int
    """Contacts open at most at once."""
    in_time: PassesInTime | None
    in_window: Passes | None


def survey(comm: Any, path: Path, out: Path, *, quick: bool, quiet: bool) -> bool:
    """Run the survey of the scene at `path` and write its page to `out` (collective); return whether the exact solvers agree."""
    begin = time.perf_counter()
    scene = read_scene(path)
    _check(scene, out)
    if comm.rank == 0:
        writable_folder(out.parent)

    def build(case: Case) -> Scene:
        return build_scene(varied(scene.source, COMMON | case.changes), path.parent)

    fitting, left_out = _fitting([case for case in CASES if not quick or case.name in QUICK], build)
    outcomes = []
    for case, varied_scene in fitting:
        outcomes.append(_outcome(varied_scene, comm, case))
        if not quiet:
            say(_progress(outcomes[-1]))
    stiff = [dataclasses.replace(case, changes=STIFF | case.changes) for case in (CHATTER[:2] if quick else CHATTER)]
    chatter = [_chatter(varied_scene, comm, case) for case, varied_scene in _fitting(stiff, build)[0]]
    refined = [build(Case("", _refined(2**level))) for level in range(2 if quick else 5)]
    levels = [_level(finer, comm, laplace=level < (1 if quick else 2)) for level, finer in enumerate(refined)]
    differences = [o.difference for o in outcomes if o.case.claimed] + [level.difference for level in levels if level.laplace]
    agree = max(differences) <= AGREEMENT
    text = "\n\n".join(
        [
            *_introduction(scene),
            *_exact_section(scene, outcomes, left_out),
            *_passes_section(outcomes),
            *_penalty_section(scene, outcomes),
            *(_chatter_section(scene, chatter) if chatter else []),
            *_step_section(scene, levels),
            _provenance(_command(path, out, quick), comm.size, time.perf_counter() - begin),
        ]
    )
    if comm.rank == 0:
        with all_or_nothing(out.parent) as staging:
            (staging / out.name).write_text(text + "\n", encoding="utf-8")
    if not quiet:
        say(f"largest difference of the exact solvers {max(differences):.1e} (limit {AGREEMENT:g}){'' if agree else ': FAILED'}")
        say(f"page in {out}, {time.perf_counter() - begin:.0f} s")
    return agree


def _fitting(cases: list[Case], build: Callable[[Case], Scene]) -> tuple[list[tuple[Case, Scene]], list[str]]:
    """Return the cases that fit the scene with their scenes, and of the others the names and what does not fit."""
    fitting, left_out = [], []
    for case in cases:
        try:
            fitting.append((case, build(case)))
        except ModelError as error:
            left_out.append(f"{case.name} ({error})")
    return fitting, left_out


def _check(scene: Scene, out: Path) -> None:
    if out.is_dir():
        raise ModelError("--out", f"{out} is a folder; expected the name of a file")
    for section in ("transient", "fourier"):
        if getattr(scene, section) is None:
            raise ModelError(section, f"missing; the survey needs the section [{section}]")
    if not any(support.unilateral for support in scene.model.supports):
        raise ModelError("supports", "expected at least one unilateral support, whose uplift can be surveyed")


def _command(path: Path, out: Path, quick: bool) -> str:
    words = ["python3 -m drivers survey"]
    words += [str(path)] if path.resolve() != SCENE.resolve() else []
    words += ["--out", str(out)] if out != Path("docs/uplift.md") else []
    words += ["--quick"] if quick else []
    return " ".join(words)


def relative(here: np.ndarray, there: np.ndarray) -> float:
    """Return the largest difference of two histories (nt, n) relative to the largest value of the second."""
    return float(np.max(np.abs(here - there)) / np.max(np.abs(there)))


def _exact(plant: Plant, method: str) -> History:
    return analyse(plant, Request(method)).final


def _outcome(scene: Scene, comm: Any, case: Case) -> Outcome:
    with prepare(scene, comm) as plant:
        exact, swept = _exact(plant, "transient"), _exact(plant, "time-frequency")
        n_c = plant.operators.contacts.law.n_contacts
        opened = int(np.max(np.sum(exact.release[:, :n_c] > 0, axis=1)))
        in_time, in_window = None, None
        if not any(s.unilateral and s.sideways == "released" for s in scene.model.supports):
            in_time = passes_in_time(plant)
            in_window = analyse(plant, Request("time-frequency", IN_WINDOW, END)).passes
    return Outcome(case, exact, relative(swept.probes, exact.probes), opened, in_time, in_window)


def unit_answers(operators: Operators, settings: Transient, step: int) -> np.ndarray:
    """Return what a release force of 1 N in one contact at one `step` does at all steps, by time stepping (collective).

    (steps + 1, n_probes + n_channels, n_channels) m: probes, then elongations of the bonded contacts.
    """
    unloaded = dataclasses.replace(operators, loads=[], reactions=None)
    answers = []
    with at_rest(unloaded) as start, Newmark(unloaded, settings.scheme, settings.step) as method:
        for channel in range(operators.contacts.law.n_channels):
            release = np.zeros((settings.steps + 1, operators.contacts.law.n_channels))
            release[step, channel] = 1.0
            history = transient(method, start, settings.steps, release=release)
            answers.append(np.concatenate([history.probes, history.elongation], axis=1))
    return np.stack(answers, axis=2)


def causal(kernel: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Return the map of values (nt, n_in) to sum_{m <= n} kernel_{n-m} values_m, (nt, n_out), for a kernel (nt, n_out, n_in).

    The first half is convolved by itself, halved again and again, and its effect on the second is added by FFT. So round-off of what comes
    later does not reach what comes before, as it would in one FFT: passes that run away are larger later by any number of digits.
    """
    nt, n_out, n_in = kernel.shape
    leaf = 32
    size = leaf * 2 ** max(0, math.ceil(math.log2(nt / leaf)))
    kernel = np.concatenate([kernel, np.zeros((size - nt, n_out, n_in))])
    lag = np.arange(leaf) - np.arange(leaf)[:, None]
    direct = np.where((lag >= 0)[..., None, None], kernel[lag], 0.0)  # (step in, step out, n_out, n_in)
    direct = np.ascontiguousarray(direct.transpose(0, 3, 1, 2)).reshape(leaf * n_in, leaf * n_out)
    spectra: dict[int, np.ndarray] = {}

    def halved(values: np.ndarray) -> np.ndarray:
        n = len(values)
        if n == leaf:
            return (values.reshape(-1) @ direct).reshape(leaf, n_out)
        if n not in spectra:
            spectra[n] = scipy.fft.rfft(kernel[:n], axis=0)
        before = scipy.fft.rfft(values[: n // 2], n, axis=0)
        ahead = scipy.fft.irfft((spectra[n] @ before[..., None])[..., 0], n, axis=0)[n // 2 :]
        return np.concatenate([halved(values[: n // 2]), halved(values[n // 2 :]) + ahead])

    return lambda values: halved(np.concatenate([values, np.zeros((size - nt, n_in))]))[:nt]


def superposed(plant: Plant, first: History) -> Callable[[np.ndarray | None], History]:
    """Return the solution by time stepping for release forces at every step, superposed from the answers to unit forces.

    `first` is the bonded response. A pass is a linear and causal map of release forces, the same one from any step on; superposed it takes
    a small part of the time of stepping. Only time 0 is apart, where a force also enters the initial acceleration.
    """
    settings = plant.scene.transient
    assert settings is not None
    answer = causal(unit_answers(plant.operators, settings, 1)[1:])
    sudden = plant.operators.contacts.law.release(first.elongation[0])
    bonded = np.concatenate([first.probes, first.elongation], axis=1)
    if sudden.any():
        bonded = bonded + unit_answers(plant.operators, settings, 0) @ sudden
    n_probes = first.probes.shape[1]

    def solve(release: np.ndarray | None) -> History:
        if release is None:
            return first
        values = bonded.copy()
        values[1:] += answer(release[1:])
        return History(first.times, values[:, :n_probes], values[:, n_probes:], release, np.zeros((len(values), 0)))

    return solve


def passes_in_time(plant: Plant) -> PassesInTime:
    """Run the published passes in time, and let those that run away run (collective)."""
    law = plant.operators.contacts.law
    first, second = analyse(plant, Request("transient", 2)).passes.histories
    superpose = superposed(plant, first)
    check = relative(superpose(law.release(first.elongation)).probes, second.probes)
    passes = published_passes(superpose, law, IN_TIME, tolerance=END, keep_all=False)
    if passes.ended != "diverged":
        return PassesInTime(passes, check)
    largest = 0.0

    def watched(begin: np.ndarray, later: np.ndarray | None) -> History:
        nonlocal largest
        history = superpose(begin if later is None else later)
        largest = max(largest, float(np.max(np.abs(history.probes))))
        return history

    part, number = passes, passes.number
    while part.ended == "diverged" and part.number and number < UNBOUNDED:
        begin = law.release(part.final.elongation)
        part = published_passes(partial(watched, begin), law, UNBOUNDED - number, tolerance=END, keep_all=False)
        number += part.number
    return PassesInTime(passes, check, number, part.ended, largest)


@dataclass(frozen=True)
class Chatter:
    """What one time scheme makes of stiff supports."""

    case: Case
    exact: History
    difference: float
    """Transient and Laplace, as in `Outcome`."""
    force: float
    """N: largest contact force."""
    high: float
    """N: its largest part above `HIGH`."""


def _chatter(scene: Scene, comm: Any, case: Case) -> Chatter:
    with prepare(scene, comm) as plant:
        exact, swept = _exact(plant, "transient"), _exact(plant, "time-frequency")
        law = plant.operators.contacts.law
        force = law.compression(law.tension(exact.elongation), exact.release)
    high = np.max(np.abs(high_part(exact.times, force)))
    return Chatter(case, exact, relative(swept.probes, exact.probes), float(force.max()), float(high))


def high_part(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the part of histories (nt, n) above `HIGH`, by a transform of what is left over the line from first to last value."""
    ramp = np.linspace(0.0, 1.0, len(times))[:, None]
    spectrum = np.fft.rfft(values - (1 - ramp) * values[0] - ramp * values[-1], axis=0)
    spectrum[np.fft.rfftfreq(len(times), times[1] - times[0]) <= HIGH] = 0.0
    return np.fft.irfft(spectrum, len(times), axis=0)


@dataclass(frozen=True)
class Level:
    """The reference case with one time step."""

    step: float
    transient: History
    laplace: History | None
    difference: float


def _level(scene: Scene, comm: Any, *, laplace: bool) -> Level:
    assert scene.transient is not None
    with prepare(scene, comm) as plant:
        stepped = _exact(plant, "transient")
        swept = _exact(plant, "time-frequency") if laplace else None
    return Level(scene.transient.step, stepped, swept, relative(swept.probes, stepped.probes) if swept else 0.0)


def order_and_limit(values: np.ndarray) -> tuple[float, float]:
    """Return the order of values (n,) of a step halved again and again, and the limit that order 2 points to.

    The order is the least-squares slope over the last three differences, nan where there are fewer.
    """
    steps = np.diff(values)
    order = 0.5 * math.log2(abs(steps[-3] / steps[-1])) if len(steps) >= 3 else math.nan
    return order, float(values[-1] + steps[-1] / 3)


def _progress(outcome: Outcome) -> str:
    passes = _ending(outcome.in_time.passes) if outcome.in_time else "cannot"
    return f"{outcome.case.name:<20} transient and Laplace differ by {outcome.difference:.1e}; published passes: {passes}"


def _ending(passes: Passes) -> str:
    if passes.ended == "converged":
        return f"{passes.number}"
    if passes.ended == "diverged":
        return f"diverges after pass {passes.number}"
    return f"not in {passes.number}: change {passes.change[-1]:.0e}, tension left {passes.pull[-1]:.0e}"


def _table(header: list[str], rows: list[list[str]]) -> str:
    align = ["---", *["---:"] * (len(header) - 1)]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (header, align, *rows))


def _instant(scene: Scene, history: History) -> int:
    """Return the step at which values are listed: the last instant that the scene prints, else the end."""
    wanted = scene.output.instants[-1] if scene.output.instants else history.times[-1]
    return int(np.argmin(np.abs(history.times - wanted)))


def _listed(scene: Scene, history: History) -> tuple[float, float, float]:
    """Return DX and DY of the first probe at that instant and its smallest DX, in m."""
    row = _instant(scene, history)
    return float(history.probes[row, 0]), float(history.probes[row, 1]), float(history.probes[:, 0].min())


def _listed_names(scene: Scene, history: History) -> list[str]:
    probe, t = scene.model.probes[0].name, history.times[_instant(scene, history)]
    return [f"{probe} DX({t:.4g} s) [m]", f"{probe} DY({t:.4g} s) [m]", f"{probe} min DX [m]"]


def _paragraph(text: str) -> str:
    return " ".join(text.split())


def _introduction(scene: Scene) -> list[str]:
    assert scene.transient is not None and scene.fourier is not None
    transient, window = scene.transient, scene.fourier
    return [
        "# Uplift: what the methods give, case by case",
        _paragraph(f"""The reference case is: {scene.title or "a scene without a title"}. The supports push and cannot pull, so the plate
            lifts from them while it rocks. Uplift can be solved exactly: only the contacts are nonlinear, and at every time step a
            small problem of their number is solved beside the linear one. Two methods do that by different means, stepping in time
            (transient) and a sweep over Laplace points with a march over the contact forces (time-frequency). On the same steps they
            have the same answer, so that their difference checks both. The source of the case does otherwise: it solves all times
            with every contact bonded, puts the tensions it finds on the plate as forces, and solves all times again, pass by pass."""),
        _paragraph(f"""This page varies one parameter of the reference case at a time, all else as it is, and shows whether the exact
            methods agree and whether the published passes arrive. Step {transient.step:g} s up to {transient.duration:g} s, from the
            static state; window of the Fourier sweep {window.length:g} s, {window.samples} samples, cut off at {window.cutoff:g} Hz.
            A difference of two histories is the largest over all probes and steps, relative to the largest displacement."""),
    ]


def _exact_section(scene: Scene, outcomes: list[Outcome], left_out: list[str]) -> list[str]:
    header = ["case", *_listed_names(scene, outcomes[0].exact), "contacts open at most", "transient - Laplace"]
    rows = [
        [o.case.name, *(f"{v:.7f}" for v in _listed(scene, o.exact)), f"{o.opened}", f"{o.difference:.1e}{'' if o.case.claimed else ' *'}"]
        for o in outcomes
    ]
    claimed = max(o.difference for o in outcomes if o.case.claimed)
    verdict = "The methods agree" if claimed <= AGREEMENT else "**The methods do not agree**"
    texts = [
        "## Uplift solved exactly",
        _table(header, rows),
        f"{verdict}: the largest difference is {claimed:.1e}, admitted is {AGREEMENT:g}.",
    ]
    if not all(o.case.claimed for o in outcomes):
        texts.append("\\* Not held to that: on supports as stiff as this the scheme itself enlarges round-off, see below.")
    idle = [o.case.name for o in outcomes if o.opened == 0]
    if idle:
        texts.append(f"No contact ever opens in: {', '.join(idle)}. These runs are linear and say nothing about uplift.")
    if left_out:
        texts.append(f"Left out, because they do not fit the scene: {'; '.join(left_out)}.")
    return texts


def _passes_section(outcomes: list[Outcome]) -> list[str]:
    rows = []
    for o in outcomes:
        if o.in_time is None or o.in_window is None:
            rows.append([o.case.name, "cannot", "", "", "cannot"])
            continue
        run = o.in_time
        off = "" if run.passes.ended == "diverged" else f"{relative(run.passes.final.probes, o.exact.probes):.0e}"
        further = ""
        if run.ended_unbounded:
            number = f"{run.number_unbounded}" if run.ended_unbounded == "converged" else f"not in {run.number_unbounded}"
            further = f"{number}, by way of {run.largest:.0e} m"
        rows.append([o.case.name, _ending(run.passes), off, further, _ending(o.in_window)])
    header = ["case", "passes in time", "off the exact answer", "let run on", "passes by Fourier sweep"]
    check = max((o.in_time.check for o in outcomes if o.in_time), default=0.0)
    texts = [
        "## The published passes",
        _paragraph(f"""Number of passes until both norms are below {END:g}: the change of the displacements from pass to pass (root of the
            sum of squares over the window), and the largest tension left in a contact, relative to the largest compression. At most
            {IN_TIME} passes in time, with the tensions of every step, and {IN_WINDOW} by Fourier sweep. "Diverges after pass k": pass
            k + 1 is more than {RUNAWAY:.0e} times as large as pass 1. One pass: nothing was in tension. "Cannot": the published
            passes do not know how to release a support sideways."""),
        _table(header, rows),
        _paragraph(f"""**Divergence.** In time stepping a force acts on what comes after it and on nothing before. So the passes come
            right from the beginning of the record onwards, and, short of an overflow, enough of them end at the exact answer whatever
            they do on the way. What they do, the column "let run on" shows: the late part of the record grows from pass to pass,
            through the displacement given there, before the correct part reaches it (up to {UNBOUNDED} passes were allowed). That is
            no way to an answer, so it counts as divergence here and makes `run` end with an error. By Fourier sweep the window is
            periodic, its end acts on its beginning, and nothing comes to the rescue. Where that sweep arrives, its answer is the one
            for a band-limited load in that window, near the exact one and not equal to it."""),
        _paragraph("""**Slow passes.** Where the passes do not arrive within the limit, their change from pass to pass can be small all
            the same: compare it with how far off the exact answer they are. Hence the second norm."""),
        _paragraph(f"""The passes in time are superposed from the answers of the time stepping to unit forces, the same linear map and
            much faster; the second pass, made both ways, differs by {check:.0e} at most."""),
    ]
    return texts


def _penalty_section(scene: Scene, outcomes: list[Outcome]) -> list[str]:
    support = next(support for support in scene.model.supports if support.unilateral)
    own = support.contact[support.axis]
    histories = {o.case.name: o.exact.probes[:, 0] for o in outcomes}
    reference = histories["reference"]
    rows = []
    for name, stiffness in PENALTIES.items():
        if name not in histories or stiffness == own:
            continue
        change = float(np.max(np.abs(histories[name] - reference)) / np.max(np.abs(reference)))
        added = abs(1 / stiffness - 1 / own)
        rows.append([f"{stiffness:.0e}", f"{change:.2e}", f"{added:.2e}", f"{change / added:.2e}"])
    return [
        "## Penalty stiffness",
        _paragraph(f"""The contacts, and the supports sideways, are springs of {own:.0e} N/m that stand for something rigid.
            With another value the DX history may change only by the compliance which that adds to a joint, or takes from it: then the
            ratio of the two is the same in all rows. Round-off, which 1e18 N/m beside 1e8 N/m invites, would spoil it."""),
        _table(["penalty [N/m]", "change of DX", "change of a joint's compliance [m/N]", "ratio [N/m]"], rows),
    ]


def _chatter_section(scene: Scene, chatter: list[Chatter]) -> list[str]:
    header = ["time integration", _listed_names(scene, chatter[0].exact)[0], "transient - Laplace", "largest contact force [MN]",
              f"largest part above {HIGH:g} Hz [MN]"]
    rows = [
        [c.case.name, f"{_listed(scene, c.exact)[0]:.7f}", f"{c.difference:.0e}", f"{1e-6 * c.force:.3f}", f"{1e-6 * c.high:.3f}"]
        for c in chatter
    ]
    return [
        "## Supports so stiff that contacts chatter",
        _paragraph(f"""With supports of {STIFF["supports.stiffness.Y"]:.0e} N/m a contact is as good as rigid. Average acceleration
            dissipates nothing: what an impact excites at the highest frequencies that the step carries stays in the contact forces,
            contacts open and close with it, and each time round-off is enlarged. Two exact solvers of the same equations then part
            company, and the digits that they do not share mean nothing. Smaller steps do not help: the same happens at higher
            frequencies."""),
        _table(header, rows),
        _paragraph("""Dissipation at high frequency (`method = "hht"` or `"generalised-alpha"` in `[transient]`) makes the problem well
            posed: the two solvers agree again, and the largest contact force hardly depends on the step. The price is a larger error
            of second order in the displacements, which smaller steps take away. The part at high frequency may grow with them: the
            band that is not dissipated widens."""),
    ]


def _step_section(scene: Scene, levels: list[Level]) -> list[str]:
    header = ["step [s]", "method", *_listed_names(scene, levels[0].transient), "transient - Laplace"]
    rows = []
    for level in levels:
        rows.append([f"{level.step:g}", "transient", *(f"{v:.7f}" for v in _listed(scene, level.transient)), ""])
        if level.laplace:
            rows.append([f"{level.step:g}", "Laplace", *(f"{v:.7f}" for v in _listed(scene, level.laplace)), f"{level.difference:.1e}"])
    columns = np.array([_listed(scene, level.transient) for level in levels]).T
    orders, limits = zip(*(order_and_limit(column) for column in columns), strict=True)
    rows.append(["order", "", *("" if math.isnan(order) else f"{order:.2f}" for order in orders), ""])
    rows.append(["limit", "", *(f"{limit:.7f}" for limit in limits), ""])
    return [
        "## Convergence in the time step",
        _paragraph("""Average acceleration is of second order. A contact that opens or closes inside a step adds an error of that order
            too, but one that jumps with the place in the step at which it does, so that successive differences fall irregularly. The
            order is the slope of the last three differences; the limit is extrapolated from the last two values with order 2. The
            table of the ground motion stays as it is while the step is halved."""),
        _table(header, rows),
    ]


def _provenance(command: str, ranks: int, seconds: float) -> str:
    known = ", ".join(f"{name} {version}" for name, version in versions().items())
    day = datetime.date.today().isoformat()
    return f"---\n\nMade by `{command}` on {day} in {seconds:.0f} s ({ranks} rank{'s' if ranks > 1 else ''}, {_processor()}; {known})."


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())
