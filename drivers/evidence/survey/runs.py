"""The runs of the survey: each case exactly by two methods and by the published passes, in time and in a window."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import scipy.fft

from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import AssembledScene, prepare
from uplift.drivers.evidence.survey.cases import END, HIGH, IN_TIME, IN_WINDOW, UNBOUNDED, Case
from uplift.drivers.scene.analysis import Transient
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import Scene
from uplift.forms.operators import Operators
from uplift.solvers.contact.published_passes import Passes, published_passes
from uplift.solvers.history import History
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.state import at_rest


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


def relative(here: np.ndarray, there: np.ndarray) -> float:
    """Return the largest difference of two histories (nt, n) relative to the largest value of the second."""
    return float(np.max(np.abs(here - there)) / np.max(np.abs(there)))


def _exact(assembly: AssembledScene, method: str) -> History:
    return analyse(assembly, Request(method)).final


def run_case(scene: Scene, comm: Any, case: Case) -> Outcome:
    """Run one case by every method (collective)."""
    with prepare(scene, comm) as assembly:
        exact, swept = _exact(assembly, "transient"), _exact(assembly, "time-frequency")
        n_c = assembly.operators.contacts.law.n_contacts
        opened = int(np.max(np.sum(exact.release[:, :n_c] > 0, axis=1)))
        in_time, in_window = None, None
        if not any(s.follows_sideways for s in scene.model.supports):
            in_time = passes_in_time(assembly)
            in_window = analyse(assembly, Request("time-frequency", IN_WINDOW, END)).passes
    return Outcome(case, exact, relative(swept.probes, exact.probes), opened, in_time, in_window)


def unit_answers(operators: Operators, settings: Transient, step: int) -> np.ndarray:
    """Return what a release force of 1 N in one contact at one `step` does at all steps, by time stepping (collective).

    (steps + 1, n_probes + n_channels, n_channels) m: probes, then elongations of the bonded contacts.
    """
    unloaded = dataclasses.replace(operators, loads=[])
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


def superposed(assembly: AssembledScene, first: History) -> Callable[[np.ndarray | None], History]:
    """Return the solution by time stepping for release forces at every step, superposed from the answers to unit forces.

    `first` is the bonded response. A pass is a linear and causal map of release forces, the same one from any step on; superposed it takes
    a small part of the time of stepping. Only time 0 is apart, where a force also enters the initial acceleration.
    """
    settings = assembly.scene.transient
    assert settings is not None
    answer = causal(unit_answers(assembly.operators, settings, 1)[1:])
    sudden = assembly.operators.contacts.law.release(first.elongation[0])
    bonded = np.concatenate([first.probes, first.elongation], axis=1)
    rows = np.r_[first.layout.layout["probes"], first.layout.layout["elongation"]]
    if sudden.any():
        bonded = bonded + unit_answers(assembly.operators, settings, 0) @ sudden

    def solve(release: np.ndarray | None) -> History:
        if release is None:
            return first
        values = bonded.copy()
        values[1:] += answer(release[1:])
        outputs = np.full(first.outputs.shape, np.nan)  # reactions are not superposed
        outputs[:, rows] = values
        return History(first.times, outputs, first.layout, release)

    return solve


def passes_in_time(assembly: AssembledScene) -> PassesInTime:
    """Run the published passes in time, and let those that run away run (collective)."""
    law = assembly.operators.contacts.law
    first, second = analyse(assembly, Request("transient", 2)).passes.histories
    superpose = superposed(assembly, first)
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


def run_chatter(scene: Scene, comm: Any, case: Case) -> Chatter:
    """Run one case of very stiff supports by both exact methods (collective)."""
    with prepare(scene, comm) as assembly:
        exact, swept = _exact(assembly, "transient"), _exact(assembly, "time-frequency")
        law = assembly.operators.contacts.law
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


def run_level(scene: Scene, comm: Any, *, laplace: bool) -> Level:
    """Run one level of the time step by stepping and, if `laplace`, by the sweep (collective)."""
    assert scene.transient is not None
    with prepare(scene, comm) as assembly:
        stepped = _exact(assembly, "transient")
        swept = _exact(assembly, "time-frequency") if laplace else None
    return Level(scene.transient.step, stepped, swept, relative(swept.probes, stepped.probes) if swept else 0.0)


def order_and_limit(values: np.ndarray) -> tuple[float, float]:
    """Return the order of values (n,) of a step halved again and again, and the limit that order 2 points to.

    The order is the least-squares slope over the last three differences, nan where there are fewer.
    """
    steps = np.diff(values)
    order = 0.5 * math.log2(abs(steps[-3] / steps[-1])) if len(steps) >= 3 else math.nan
    return order, float(values[-1] + steps[-1] / 3)
