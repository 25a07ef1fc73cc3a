"""What a scene may not mean: said in words before it is run, while it is run all the same."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from uplift.drivers.scene.doubtful_values import doubtful_values
from uplift.drivers.scene.scene import Scene
from uplift.forms.loads.signals import Signal, Table
from uplift.forms.parameters import Force, Pressure
from uplift.meshes.findings import Finding, finding

FEW_STEPS = 10
"""Steps a period; the average-acceleration rule then lengthens the period by 3 %."""

SHARE = 0.01
"""Of a signal's energy, a tenth of its amplitude: what may be lost without a word."""

FINER = 8
"""The signal is looked at so many times as finely as it is analysed."""

MANY = 2**20
"""Values of a signal that are looked at, at most."""

JUMP = 0.02
"""Of a record's largest value; what a recorder still writes of noise at its end is less."""


def scene_cautions(scene: Scene, method: str = "") -> list[Finding]:
    """Return what is doubtful about a scene that can be run; by `method` if it is named, else by the scene's own."""
    model, signals = scene.model, list(_signals(scene))
    found: list[str] = []
    in_time = (method or scene.run.method) != "static"
    if not in_time and signals:
        found.append(f"the method static leaves out what acts in time, as its signal says: {', '.join(name for name, _ in signals)}")
    moved = any(condition.moves for condition in model.initial)
    if in_time and scene.transient is not None and not signals and not moved:
        found.append("nothing acts in time: there is no [load] with a signal, nor [[initial]]")
    lifting = [support for support in model.supports if support.unilateral]
    static = [load for load in _loads(scene) if load.signal is None]
    pressed = model.gravity != 0 or static or any(support.preload for support in lifting)
    if lifting and not pressed:
        found.append("nothing presses the plate on its supports: without [gravity] or a preload the contacts carry no force at rest")
    findings = [finding("scene", words) for words in found]
    findings += doubtful_values(scene)
    for name, signal in signals if in_time else []:
        findings += [replace(found, text=f"{name}: {found.text}") for found in _of_signal(scene, signal)]
    return findings


def _of_signal(scene: Scene, signal: Signal) -> Iterator[Finding]:
    if isinstance(signal, Table):
        yield from signal.remarks
    end = scene.transient.duration if scene.transient is not None else scene.horizon
    if end and not _acts(signal, end):
        lies = f"; it lies between {signal.times[0]:g} s and {signal.times[-1]:g} s" if isinstance(signal, Table) else ""
        yield finding("record", f"it is zero from 0 to the end of the analysis at {end:g} s and moves nothing{lies}")
        return
    if isinstance(signal, Table):
        yield from (finding("record", words) for words in _cut(signal, end))
    yield from (finding("signal", words) for words in _against_steps(scene, signal))


def _acts(signal: Signal, horizon: float) -> bool:
    """Tell whether a signal is anything but zero between 0 and `horizon` s."""
    times = np.linspace(0.0, horizon, min(MANY, FINER * 1000))
    if isinstance(signal, Table):
        times = np.append(signal.times[(signal.times >= 0) & (signal.times <= horizon)], (0.0, horizon))
    return bool(np.any(signal(times)))


def _cut(record: Table, horizon: float) -> Iterator[str]:
    """Say what of a record acts before the analysis begins, and where it jumps to zero."""
    times, values = record.times, record.values
    before, largest = values[times < 0], float(np.max(np.abs(values)))
    if np.any(before):
        share = float((before**2).sum() / (values**2).sum())
        yield f"the record begins at {times[0]:g} s; the analysis begins at 0 and misses {share:.2g} of its energy"
    for end, here, inside in ((0, "begins", 0 < times[0] < horizon), (-1, "ends", times[-1] < horizon)):
        if inside and abs(values[end]) > JUMP * largest:
            yield (
                f"the record {here} at {times[end]:g} s with {abs(values[end]) / largest:.0%} of its largest value and is zero "
                f"{'before' if end == 0 else 'after'}: it jumps there"
            )


def _signals(scene: Scene) -> Iterator[tuple[str, Signal]]:
    model = scene.model
    for number, motion in enumerate(model.motions, start=1):
        yield "load" if len(model.motions) == 1 else f"ground motion {number}", motion.signal
    for load in _loads(scene):
        if load.signal is not None:
            yield f"load {load.name!r}", load.signal


def _loads(scene: Scene) -> list[Force | Pressure]:
    return [*scene.model.forces, *scene.model.pressures]


def _against_steps(scene: Scene, signal: Signal) -> Iterator[str]:
    """Compare a signal with the time step of the transient analysis, in which it is interpolated linearly."""
    settings = scene.transient
    if settings is None:
        return
    if isinstance(signal, Table):
        yield from _resampled(signal, settings.step)
        energy = signal.values**2
        late = float(energy[signal.times > settings.duration].sum() / (energy.sum() or 1.0))
        if late > SHARE:
            yield f"the analysis ends at {settings.duration:g} s and misses {late:.0%} of the record's energy"
    times = np.linspace(0.0, settings.duration, min(FINER * settings.steps, MANY), endpoint=False)
    energy = np.abs(np.fft.rfft(signal(times))) ** 2
    limit = 1 / (FEW_STEPS * settings.step)
    above = float(energy[np.fft.rfftfreq(len(times), times[1]) > limit].sum() / (energy.sum() or 1.0)) if len(times) > 1 else 0.0
    if above > SHARE:
        yield f"{above:.0%} of its energy lies above {limit:.4g} Hz, where a period has fewer than {FEW_STEPS} steps of {settings.step:g} s"


def _resampled(record: Table, step: float) -> Iterator[str]:
    """Say if the instants of the analysis pass over rows of a record, or fall between them so that its peaks are cut."""
    row = float(np.median(np.diff(record.times)))
    if step > row * (1 + 1e-6):
        yield f"the record has a row every {row:g} s, and steps of {step:g} s pass over some: what is faster comes back slower (aliasing)"
    elif abs(row / step - round(row / step)) > 1e-6 * row / step:
        yield f"the record has a row every {row:g} s, which is no multiple of the step of {step:g} s: its peaks fall between the steps"
