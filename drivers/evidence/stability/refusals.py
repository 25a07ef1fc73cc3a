"""The cases of the stability table that must be refused, or flagged: what is ill-posed, inadmissible or badly sampled."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.special import gammaincc

from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.time_frequency import LOST, WRAPPED
from uplift.drivers.evidence.stability.bench import Bench, Finding
from uplift.drivers.evidence.stability.cases import Case
from uplift.drivers.scene.request import Request
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark


def refusals() -> list[Case]:
    """Return the cases that must end with exit code 2 and one line in words of mechanics."""
    newmark, mechanics = "Newmark parameters outside stability", "Ill-posed or not physical"
    unheld = {"springs": None, "supports.edge": None, "supports.count": None}
    rows: list[tuple[str, str, dict[str, Any], str]] = [
        (newmark, "beta = 0.2, gamma = 0.5: conditionally stable", {"transient.beta": 0.2}, "unconditional stability"),
        (newmark, "beta = 0: explicit", {"transient.beta": 0.0}, "transient.beta"),
        (newmark, "gamma = 0.4: negative damping", {"transient.gamma": 0.4}, "transient.gamma"),
        (newmark, "HHT, alpha = 0.5", {"transient.method": "hht", "transient.alpha": 0.5}, "transient.alpha"),
        (newmark, "generalised-alpha, rho = 1.2", {"transient.method": "generalised-alpha", "transient.rho_infinity": 1.2}, "rho_infinity"),
        (newmark, "settling steps with beta = 0.25, gamma = 1.5", {"transient.settling.beta": 0.25}, "unconditional stability"),
        (newmark, "dt = 0", {"transient.step": 0.0}, "transient.step"),
        (newmark, "duration no multiple of dt", {"transient.step": 0.003}, "multiple of the step"),
        (mechanics, "no support and no spring, static start", {"supports": None, "springs": None}, "nothing holds the plate"),
        (mechanics, "no support, springs of 1 N/m upwards only", {"supports": None}, "sliding along X"),
        (mechanics, "one support and no spring", unheld | {"supports.points": [[2.0, 0.0]]}, "rotation"),
        (
            mechanics,
            "two supports on the left half, no spring: tips over",
            unheld | {"supports.points": [[0.0, 0.0], [1.0, 0.0]]},
            "lift or tip",
        ),
        (mechanics, "gravity reversed, no spring: flies off", {"springs": None, "gravity.acceleration": -9.81}, "lift or tip"),
        (mechanics, "nu = 0.5", {"plate.poisson": 0.5}, "plate.poisson"),
        (mechanics, "E = 0", {"plate.young": 0.0}, "plate.young"),
        (mechanics, "density 0", {"plate.density": 0.0}, "plate.density"),
        (mechanics, "thickness 0", {"plate.thickness": 0.0}, "plate.thickness"),
        (mechanics, "negative stiffness", {"supports.stiffness.Y": -1e8}, "stiffness.Y"),
        (mechanics, "stiffness NaN", {"supports.stiffness.Y": math.nan}, "stiffness.Y"),
        (mechanics, "unilateral support without stiffness", {"supports.contact.Y": 0.0}, "unilateral"),
        (mechanics, "negative damping", {"plate.alpha": -1e-3}, "plate.alpha"),
        (mechanics, "a Fourier band beyond half the sampling rate", {"fourier.cutoff": 60.0}, "half the sampling rate"),
    ]
    cases = [
        _refusal(group, name, partial(Bench.refused, changes=changes, words=words), quick=name in ("density 0", "beta = 0: explicit"))
        for group, name, changes, words in rows
    ]
    for name, rest, words in (
        ("NaN", "0.1, nan", "finite"),
        ("infinity", "0.1, inf", "finite"),
        ("time running back", "-0.1, 1.0", "increasing"),
        ("one line only", "", "two lines"),
        ("text among the numbers", "0.1, loud", "expected a time and an acceleration"),
    ):
        changes = {"load": {"direction": "X", "signal": "csv", "file": "quake.csv"}}
        text = f"t, a\n0.0, 0.0\n{rest}\n0.2, 0.0\n" if rest else "t, a\n0.0, 0.0\n"
        cases.append(_refusal("Accelerogram", name, partial(Bench.refused, changes=changes, words=words, quake=text)))
    return cases


def _refusal(group: str, name: str, run: Callable[[Bench], Finding], *, quick: bool = False) -> Case:
    what = "run from the command line: it must end with exit code 2, one line that names the entry and the mechanics, and no files"
    return Case(group, name, what, run, 0.0, "it does, or it does not", quick)


def windows() -> list[Case]:
    """Return the cases of the window of the Fourier transform."""
    smooth = {"load.start": 0.0, "load.table_step": None, "load.table_digits": None}
    closed = (
        "warned of; the reported share against the closed form: the energy of a Ricker pulse goes with f^4 exp(-2 (f / f0)^2), so that "
        "its tail is an incomplete gamma function"
    )
    cases = [
        Case(
            "Window",
            f"{length:g} s{', too short' if warned else ''}",
            "wrap-around: what the run reports as left at the end, against the error that it makes, the difference from time stepping in "
            f"fine steps: log2 of their ratio; {'a warning must come' if warned else 'no warning may come'}",
            partial(_wrap, length=length, warned=warned),
            1.0,
            "a factor of two between an estimate and an error",
        )
        for length, warned in ((20.48, False), (5.12, True), (10.24, True))
    ]
    cases += [
        Case(
            "Window",
            f"sampled at {rate:g} Hz, pulse of 4 Hz",
            "aliasing " + closed,
            partial(
                _beyond,
                changes=smooth | {"load.frequency": 4.0, "fourier.samples": round(20.48 * rate), "fourier.cutoff": 3.0},
                nyquist=True,
            ),
            0.05,
            "the tail begins between two lines of the spectrum",
        )
        for rate in (12.5, 6.25)
    ]
    cases += [
        Case(
            "Window",
            f"cut off at {cutoff:g} Hz, pulse of 4 Hz",
            "a band that misses the load, " + closed,
            partial(_beyond, changes=smooth | {"load.frequency": 4.0, "fourier.cutoff": cutoff}, nyquist=False),
            0.05,
            "the tail begins between two lines of the spectrum",
            quick=cutoff == 1.0,
        )
        for cutoff in (1.0, 8.0)
    ]
    return cases


def _wrap(bench: Bench, length: float, warned: bool) -> Finding:
    changes = {"fourier.length": length, "fourier.samples": round(100 * length), "fourier.cutoff": 25.0}
    analysis, said = bench.fourier(changes)
    history, samples, finer = analysis.final, len(analysis.final.times), 16
    with bench.assembly(changes) as assembly, static_state(assembly.operators) as start:
        settings = assembly.scene.transient
        assert settings is not None
        step = length / samples / finer
        with Newmark(assembly.operators, settings.scheme, step) as method:
            stepped = transient(method, start, finer * (samples - 1), every=finer)
    moved = stepped.probes - stepped.probes[0]
    error = float(np.max(np.abs(history.probes - stepped.probes)) / np.max(np.abs(moved)))
    reported = float(analysis.notes["response_left_at_end_of_window"])
    sound = ("wrap-around" in said) == warned == (reported > WRAPPED)
    return Finding(
        abs(math.log2(error / reported)),
        f"reported {reported:.2g}, error {error:.2g}{', warned' if 'wrap-around' in said else ''}",
        sound=sound,
    )


def _beyond(bench: Bench, changes: dict[str, Any], nyquist: bool) -> Finding:
    analysis, said = bench.fourier(changes)
    scene = bench.scene(changes, true=True)
    assert scene.fourier is not None
    window, pulse = scene.fourier, changes["load.frequency"]
    last = window.samples / (2 * window.length) if nyquist else window.frequencies[-1]
    there = float(gammaincc(2.5, 2 * ((last + 0.5 / window.length) / pulse) ** 2))
    reported = float(analysis.notes["load_energy_above_nyquist" if nyquist else "load_energy_above_cutoff"])
    sound = ("aliasing" if nyquist else "cutoff") in said and reported > LOST
    return Finding(
        abs(reported / there - 1), f"reported {reported:.3g}, closed form {there:.3g}{', warned' if sound else ', no warning'}", sound=sound
    )


def methods() -> list[Case]:
    """Return the cases in which two methods that share no time stepping must agree."""
    return [
        Case(
            "Two methods",
            name,
            "time stepping and the sweep over Laplace points, which never steps the plate, have the same answer",
            partial(_two_methods, changes=changes),
            1e-8,
            "round-off of the inverse transform, eps^(2/3) x amplitude ratio",
        )
        for name, changes in (
            ("amplitude 8 m/s2", {"load.amplitude": 8.0}),
            ("no damping", {"plate.alpha": 0.0, "plate.beta": 0.0}),
            (
                "supports 1e12 N/m, generalised-alpha",
                {"supports.stiffness.Y": 1e12, "transient.method": "generalised-alpha", "transient.rho_infinity": 0.0},
            ),
            ("nu = 0.4999, E = 2.1e11 Pa", {"plate.poisson": 0.4999, "plate.young": 2.1e11}),
        )
    ]


def _two_methods(bench: Bench, changes: dict[str, Any]) -> Finding:
    with bench.assembly(changes) as assembly:
        stepped = analyse(assembly, Request("transient")).final
    with Bench(bench.table, bench.folder, bench.comm).assembly(changes) as assembly:
        swept = analyse(assembly, Request("time-frequency")).final
    return Finding(float(np.max(np.abs(stepped.probes - swept.probes)) / np.max(np.abs(swept.probes - swept.probes[0]))))
