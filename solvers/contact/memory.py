"""The law of contact as the time integrations use it: from one instant to the next, with all that it remembers in one object."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uplift.forms.contact.law import UpliftLaw
from uplift.solvers.contact.step import ContactProblem


class ContactMemory(NamedTuple):
    """What the contacts know of the instants before."""

    release: np.ndarray
    """(n_channels,) N: forces on the plate at this instant."""
    inner: np.ndarray
    """(n_inner,): further state of the law, such as the motion of auxiliary nodes; empty where it has none."""


def closed(n_channels: int) -> ContactMemory:
    """Return the memory of contacts that have never been open."""
    return ContactMemory(np.zeros(n_channels), np.zeros(0))


class ContactStep:
    """The law of uplift from one instant to the next, for one compliance of the structure in a step; it has no further state.

    Base of the laws that have one: `uplift.solvers.contact.laws` chooses.
    """

    n_inner = 0
    """Numbers of further state."""

    def __init__(self, law: UpliftLaw, compliance: np.ndarray) -> None:
        """Take the tensions (n_channels, n_channels) of the bonded contacts per unit release force."""
        self.law = law
        self.problem = ContactProblem(law, compliance)

    @property
    def tries(self) -> float:
        """Sets of open contacts tried per instant."""
        return self.problem.tries / max(self.problem.solved, 1)

    def counts(self) -> dict[str, np.ndarray]:
        """Return the numbers of problems solved and of sets tried, for a checkpoint."""
        return {"problems": np.array([self.problem.tries, self.problem.solved])}

    def recount(self, counts: dict[str, np.ndarray]) -> None:
        """Take in again what `counts` gave."""
        self.problem.tries, self.problem.solved = (int(v) for v in counts["problems"])

    def begin(self, memory: ContactMemory) -> ContactMemory:
        """Return the memory to march from, its further state at rest unless it is known."""
        return memory if memory.inner.size == self.n_inner else ContactMemory(memory.release, self.at_rest(memory.release))

    def at_rest(self, release: np.ndarray) -> np.ndarray:
        """Return the further state (n_inner,) at rest under release forces (n_channels,) N."""
        return np.zeros(self.n_inner)

    def advance(self, tension: np.ndarray, memory: ContactMemory, scale: float) -> ContactMemory:
        """Return the memory at the next instant, its release forces among it.

        `tension` (n_channels,) N is that of the bonded contacts without the release forces of that instant; forces below 1e-12 of `scale` N
        are round-off. Raises `SolverError` if there is no answer.
        """
        return ContactMemory(self.problem.solve(tension, memory.release, scale), memory.inner)

    def support_force(self, release: np.ndarray, inner: np.ndarray) -> np.ndarray:
        """Return what stands against the supports' springs (nt, n_channels) N, of release forces and further states (nt, n_inner)."""
        return release

    def openings(self, inner: np.ndarray) -> np.ndarray | None:
        """Return the openings (nt, n_c) m of the contacts from further states (nt, n_inner); None where the release forces tell them."""
        return None
