"""The law of contact as the time integrations use it: from one instant to the next, with all that it remembers in one object."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uplift.forms.contact.law import UpliftLaw
from uplift.solvers.contact.auxiliary_nodes import AuxiliaryNodes
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
    """The law of uplift in steps of one length, for one compliance of the structure in a step.

    Auxiliary nodes without mass have no state of their own; those whose mass counts in a step are integrated along (`AuxiliaryNodes`).
    """

    def __init__(self, law: UpliftLaw, compliance: np.ndarray, step: float) -> None:
        """Take the tensions (n_channels, n_channels) of the bonded contacts per unit release force, and the length of a step in s."""
        self.law = law
        self.problem = ContactProblem(law, compliance)
        self._nodes = AuxiliaryNodes(law, step)
        self._with_nodes = self._nodes.any
        self.n_inner = 4 * law.n_contacts if self._with_nodes else 0
        """Numbers of further state."""

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
        """Return the memory to march from: nodes at rest, unless their motion is known."""
        if memory.inner.size == self.n_inner:
            return memory
        inner = self._nodes.at_rest(memory.release).ravel() if self._with_nodes else np.zeros(0)
        return ContactMemory(memory.release, inner)

    def advance(self, tension: np.ndarray, memory: ContactMemory, scale: float) -> ContactMemory:
        """Return the memory at the next instant, its release forces among it.

        `tension` (n_channels,) N is that of the bonded contacts without the release forces of that instant; forces below 1e-12 of `scale` N
        are round-off. Raises `SolverError` if there is no answer.
        """
        if not self._with_nodes:
            return ContactMemory(self.problem.solve(tension, memory.release, scale), memory.inner)
        motion = memory.inner.reshape(4, -1)
        release, motion = self._nodes.solve(self.problem, tension, memory.release, motion, scale)
        return ContactMemory(release, motion.ravel())

    def support_force(self, release: np.ndarray, inner: np.ndarray) -> np.ndarray:
        """Return what stands against the supports' springs (nt, n_channels) N, of release forces and further states (nt, n_inner)."""
        return self._nodes.on_ground(release, self._motion(inner)) if self._with_nodes else release

    def openings(self, inner: np.ndarray) -> np.ndarray | None:
        """Return the openings (nt, n_c) m of the contacts from further states (nt, n_inner); None where the release forces tell them."""
        return self._nodes.gap(self._motion(inner)) if self._with_nodes else None

    def _motion(self, inner: np.ndarray) -> np.ndarray:
        return inner.reshape(len(inner), 4, -1).transpose(1, 0, 2)
