"""The published iteration on the contact forces: whole histories, pass by pass.

Pass 1 is the structure with every contact bonded. Each later pass applies to the plate the tensions that the contacts had
in the pass before, over the whole history at once. Source: code_aster manual, case SDLS119. It contracts slowly
where it converges at all, and is kept to reproduce the source: exact uplift costs no passes.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from uplift.forms.contact.law import UpliftLaw
from uplift.solvers.history import History

log = logging.getLogger(__name__)

RUNAWAY = 1e6
"""Displacements that have grown by this factor since pass 1 are not on their way to an answer."""


@dataclass
class Passes:
    """The first and the last histories of an iteration and the norms that show how far it is from an end."""

    histories: list[History] = field(default_factory=list)
    """Of every pass, or of the first and the last two where there were many."""
    change: list[float] = field(default_factory=list)
    """Per pass from the second: change of the probes over the window (root of the sum of squares), relative to the probes."""
    pull: list[float] = field(default_factory=list)
    """Per pass: largest net tension left in a contact, relative to the largest compression: the law's own residual."""
    number: int = 0
    """Passes done."""
    ended: str = ""
    """Why the iteration ended, if that was not the wanted number of passes: "converged", "diverged", "not converged"."""

    @property
    def final(self) -> History:
        """The history of the last pass."""
        return self.histories[-1]


def published_passes(
    solve: Callable[[np.ndarray | None], History],
    law: UpliftLaw,
    passes: int,
    *,
    tolerance: float | None = None,
    keep_all: bool = True,
) -> Passes:
    """Run at most `passes` passes of `solve`, which maps release forces at the archived instants (nt, n_channels) N to a history.

    With a `tolerance` the iteration ends when both the change and the tension left are below it; the change alone can look
    converged at a wrong answer. It also ends where it runs away, with the last finite history kept.
    """
    result = Passes()
    release: np.ndarray | None = None
    while result.number < passes:
        history = solve(release)
        if not np.all(np.isfinite(history.probes)) or _size(history) > RUNAWAY * max(_size(h) for h in result.histories[:1] or [history]):
            result.ended = "diverged"
            break
        result.number += 1
        compression = law.compression(law.tension(history.elongation), history.release)
        result.pull.append(_ratio(np.max(-compression, initial=0.0), np.max(compression, initial=0.0)))
        if result.histories:
            difference = np.linalg.norm(history.probes - result.final.probes)
            result.change.append(_ratio(float(difference), float(np.linalg.norm(history.probes))))
            words = "pass %d: relative change of displacements %.1e, largest residual tension %.1e of the largest compression"
            log.info(words, result.number, result.change[-1], result.pull[-1])
        if not keep_all and len(result.histories) > 2:
            del result.histories[1]
        result.histories.append(history)
        if tolerance is not None and result.pull[-1] <= tolerance and (not result.change or result.change[-1] <= tolerance):
            result.ended = "converged"
            break
        release = law.release(history.elongation)
    if tolerance is not None and not result.ended:
        result.ended = "not converged"
    return result


def _size(history: History) -> float:
    return float(np.max(np.abs(history.probes), initial=0.0))


def _ratio(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else float(part > 0)
