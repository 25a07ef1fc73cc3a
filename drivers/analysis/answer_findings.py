"""What the histories of a run show that a user has to know of its answer."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uplift.drivers.analysis.assembled_scene import Analysis, AssembledScene
from uplift.meshes.findings import Finding, finding, tell
from uplift.solvers.contact.published_passes import Passes
from uplift.solvers.history import Ledger, farthest

ENOUGH_INSTANTS = 20
"""A history of fewer has no end to speak of."""

NEAR_THE_END = 0.98
"""Of the instants: a largest value after so many of them may not be the last one."""

LOST = 0.02
"""Of the energy that loads and start have put in; the scheme takes less where the steps are short."""

AT_REST = 1e-9
"""Part of the stored energy: changes of less are round-off of a state of rest."""

PEAK_LOST = 0.01
"""Of the largest displacement of a probe, that may lie between archived instants without a word."""

TENSION_LEFT = 1e-3
"""Of the largest compression."""


def answer_findings(assembly: AssembledScene, analysis: Analysis) -> list[Finding]:
    """Return what the final histories show: passes without an end, growth, flight, energy of the time integration."""
    history, contacts = analysis.final, assembly.operators.contacts
    found = [] if analysis.exact else list(of_passes(analysis.passes))
    moving = np.array([".DR" not in name for name in assembly.operators.probes.names], dtype=bool)
    found += at_the_end(farthest(history.probes, moving))
    settings = assembly.scene.transient
    if settings is not None and settings.every > 1 and analysis.method in ("transient", "modal", "time-frequency"):
        found += between_instants(history.probes[:, moving], settings.every)
    if analysis.exact and contacts.names:
        found += in_flight(history.times, history.openings(contacts.law))
    if history.ledger is not None and analysis.passes.ended != "diverged":
        open_ = history.openings(contacts.law) > 0
        found += of_energy(history.ledger, int(np.sum(open_[:-1] & ~open_[1:])))
    return found


def say_findings(assembly: AssembledScene, analysis: Analysis) -> None:
    """Say what the histories of a run show."""
    for found in answer_findings(assembly, analysis):
        tell(found)


def of_passes(passes: Passes) -> Iterator[Finding]:
    """Say where the published passes are no answer."""
    if passes.ended == "diverged":
        words = "the published passes diverge: this is the last finite pass, not an answer; solve uplift exactly"
        yield finding("passes without end", words)
    elif passes.ended == "not converged":
        words = "the published passes have not converged: the last of them is not an answer; solve uplift exactly"
        yield finding("passes without end", words)
    elif not passes.ended and passes.pull and passes.pull[-1] > TENSION_LEFT:
        yield finding(
            "tension left", f"uplift is by {passes.number} published pass(es), for comparison with their source: contacts still pull with "
            f"{100 * passes.pull[-1]:.2g} % of the largest compression; without --iterations uplift is solved exactly"
        )


def at_the_end(size: np.ndarray) -> Iterator[Finding]:
    """Say where the farthest probe, `size` (nt,) from zero, is farthest at the end."""
    if len(size) > ENOUGH_INSTANTS and np.argmax(size) >= NEAR_THE_END * (len(size) - 1) and size[-1] > 0:
        yield finding("farthest at the end", "a probe is farthest from zero at the end of the run: the motion may grow beyond it; take a "
                      "longer duration")


def between_instants(probes: np.ndarray, every: int) -> Iterator[Finding]:
    """Say where peaks of the probes (nt, n) may lie between archived instants: on the parabola through three of them, beyond the middle."""
    if len(probes) < 3:
        return
    slope, bend = 0.5 * (probes[2:] - probes[:-2]), probes[2:] - 2 * probes[1:-1] + probes[:-2]
    turns = np.abs(slope) <= 0.5 * np.abs(bend)
    beyond = np.where(turns, 0.5 * slope**2 / np.where(bend != 0, np.abs(bend), 1.0), 0.0)
    largest = np.max(np.abs(probes), axis=0)
    lost = np.max(np.abs(probes[1:-1]) + beyond, axis=0, initial=0.0) - largest
    share = float(np.max(np.divide(lost, largest, out=np.zeros_like(lost), where=largest > 0), initial=0.0))
    if share > PEAK_LOST:
        yield finding("thin archive", f"every {every} steps are archived, and a largest displacement between may be {share:.1%} larger")


def in_flight(times: np.ndarray, gap: np.ndarray) -> Iterator[Finding]:
    """Say where all contacts, of openings (nt, n_c) m, are open at once."""
    flying = np.flatnonzero(np.all(gap > 0, axis=1))
    if flying.size:
        first = f"first at t = {times[flying[0]]:.6g} s"
        yield finding("flight", f"all contacts are open at once at {flying.size} archived instant(s), {first}")


def of_energy(ledger: Ledger, impacts: int) -> Iterator[Finding]:
    """Say how much energy the time integration makes or takes away, and what helps, of a run in which contacts close `impacts` times."""
    put_in = float(np.max(np.abs(ledger.work), initial=0.0)) + float(ledger.kinetic[0])
    stored = float(np.max(np.abs(ledger.kinetic + ledger.strain + ledger.springs), initial=0.0))
    if put_in <= AT_REST * stored:
        return
    made, lost = (float(np.max(side, initial=0.0)) / put_in for side in (-ledger.numerical, ledger.numerical))
    if made > LOST:
        words = f"the time integration makes {_times(made)} the energy that loads and start have put in"
        helps = (
            f", at {impacts} impacts on stops: a smaller step does not help; take the method exact, generalised-alpha with "
            "rho_infinity = 0 or newmark with beta = 0.36 and gamma = 0.7, or stops as soft as they are"
        )
        yield finding("numerical energy", words + (helps if impacts else ": take a smaller step"), severity="grave" if made > 1 else None)
    elif lost > LOST:
        more = ", or the method exact" if impacts else ""
        words = f"the time integration takes away {_times(lost)} the energy that loads and start have put in: take a smaller step{more}"
        yield finding("numerical energy", words)


def _times(ratio: float) -> str:
    return f"{ratio:.1%} of" if ratio < 1 else f"{ratio:.3g} times"
