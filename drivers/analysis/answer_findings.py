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
"""Of the energy that the loads put in or the plate moved with; the scheme takes less where the steps are short."""

TENSION_LEFT = 1e-3
"""Of the largest compression."""


def answer_findings(assembly: AssembledScene, analysis: Analysis) -> list[Finding]:
    """Return what the final histories show: passes without an end, growth, flight, energy of the time integration."""
    history, contacts = analysis.final, assembly.operators.contacts
    found = [] if analysis.exact else list(of_passes(analysis.passes))
    moving = np.array([".DR" not in name for name in assembly.operators.probes.names], dtype=bool)
    found += at_the_end(farthest(history.probes, moving))
    if analysis.exact and contacts.names:
        found += in_flight(history.times, history.openings(contacts.law))
    if history.ledger is not None and analysis.passes.ended != "diverged":
        found += of_energy(history.ledger)
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


def in_flight(times: np.ndarray, gap: np.ndarray) -> Iterator[Finding]:
    """Say where all contacts, of openings (nt, n_c) m, are open at once."""
    flying = np.flatnonzero(np.all(gap > 0, axis=1))
    if flying.size:
        first = f"first at t = {times[flying[0]]:.6g} s"
        yield finding("flight", f"all contacts are open at once at {flying.size} archived instant(s), {first}")


def of_energy(ledger: Ledger) -> Iterator[Finding]:
    """Say where the time integration itself takes away or adds much of the energy."""
    turned = max(float(np.max(np.abs(ledger.work))), float(np.max(ledger.kinetic)))
    lost = float(np.max(np.abs(ledger.numerical)))
    if lost > LOST * turned > 0:
        words = f"the time integration itself takes away or adds up to {100 * lost / turned:.2g} % of the energy: try a smaller time step"
        yield finding("numerical energy", words)
