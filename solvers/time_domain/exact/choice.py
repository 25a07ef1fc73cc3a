"""Which of the two exact time integrations suits a model, and why, in a sentence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.solvers.time_domain.exact.first_order import FirstOrder

FEW_CONTACTS = 20
"""Up to so many, sets of open contacts come back often enough that the march from event to event is the cheaper one (measured)."""
LONGEST_ITERATED = 1.0
"""Contact frequency times step up to which the iteration of the collocation contracts, by 1/2 at least."""
MOST_HALVINGS = 6
"""Of the archived interval that a collocation is worth."""


@dataclass(frozen=True)
class Choice:
    """A time integration and the reason for it."""

    events: bool
    """Whether to march from event to event; else by collocation."""
    reason: str


def contact_frequency(system: FirstOrder) -> float:
    """Return the rate in rad/s at which contact forces act back on themselves: sqrt of the largest eigenvalue of Q A P.

    A unit release force accelerates the structure, and so changes the second derivative of the tensions by Q A P: for a mass m on a
    spring k that is k / m. Beside a force that acts at once, E, it is what the iteration of the collocation contracts by.
    """
    if not system.P.size:
        return 0.0
    back = np.abs(np.linalg.eigvals(system.Q @ system.A @ system.P))
    return float(np.sqrt(back.max(initial=0.0)))


def choose(system: FirstOrder, interval: float) -> Choice:
    """Return what to do for a model whose answers are wanted every `interval` s."""
    n_c, frequency = len(system.Q), contact_frequency(system)
    if n_c <= FEW_CONTACTS:
        return Choice(True, f"from event to event: {n_c} contacts, at most {FEW_CONTACTS}, whose sets of open contacts come back")
    if frequency * interval > LONGEST_ITERATED * 2**MOST_HALVINGS:
        words = f"contacts of {frequency:.3g} rad/s are too stiff for forces that are polynomials in time, at instants {interval:g} s apart"
        return Choice(True, f"from event to event: {words}")
    return Choice(False, f"by collocation: {n_c} contacts, more than {FEW_CONTACTS}, whose sets of open contacts hardly come back")
