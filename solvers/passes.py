"""The published iteration on the contact forces: whole histories, pass by pass.

Pass 1 is the structure with every contact bonded. Each later pass applies to the plate the tensions that the contacts had
in the pass before, over the whole history at once. Source: code_aster manual, case SDLS119. It contracts slowly
where it converges at all, and is kept to reproduce the source.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from forms.uplift import UpliftLaw
from solvers.history import History

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Passes:
    """The histories of all passes and the norms that show how far they are from an end."""

    histories: list[History]
    change: list[float]
    """Per pass from the second: largest change of a probe, relative to its largest value."""
    pull: list[float]
    """Per pass: largest net tension left in a contact, relative to the largest compression: the law's own residual."""


def published_passes(solve: Callable[[np.ndarray | None], History], law: UpliftLaw, passes: int) -> Passes:
    """Run `passes` passes of `solve`, which maps release forces at the archived instants (nt, n_channels) N to a history."""
    release: np.ndarray | None = None
    histories: list[History] = []
    change: list[float] = []
    pull: list[float] = []
    for number in range(1, passes + 1):
        history = solve(release)
        compression = law.compression(law.tension(history.elongation), history.release)
        pull.append(_ratio(np.max(-compression, initial=0.0), np.max(compression, initial=0.0)))
        if histories:
            size = np.max(np.abs(history.probes), initial=0.0)
            change.append(_ratio(np.max(np.abs(history.probes - histories[-1].probes), initial=0.0), size))
            log.info("pass %d: displacements change by %.1e, contacts still pull %.1e", number, change[-1], pull[-1])
        histories.append(history)
        release = law.release(history.elongation)
    return Passes(histories, change, pull)


def _ratio(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else float(part > 0)
