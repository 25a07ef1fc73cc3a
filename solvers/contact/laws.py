"""Which law the contacts of a model follow from one instant to the next."""

from __future__ import annotations

import numpy as np

from uplift.forms.contact.law import UpliftLaw
from uplift.solvers.contact.auxiliary_nodes import AuxiliaryNodes
from uplift.solvers.contact.memory import ContactMemory, ContactStep


def contact_step(law: UpliftLaw, compliance: np.ndarray, step: float) -> ContactStep:
    """Return the law in steps of `step` s: auxiliary nodes are integrated along where the mass of one counts in a step.

    `compliance` (n_channels, n_channels) holds the tensions of the bonded contacts per unit release force.
    """
    nodes = AuxiliaryNodes(law, step)
    return StepWithNodes(law, compliance, nodes) if nodes.any else ContactStep(law, compliance)


class StepWithNodes(ContactStep):
    """The law of uplift with auxiliary nodes of some mass; its further state is their motion."""

    def __init__(self, law: UpliftLaw, compliance: np.ndarray, nodes: AuxiliaryNodes) -> None:
        """Take what `ContactStep` takes, and the nodes in steps of one length."""
        super().__init__(law, compliance)
        self._nodes = nodes
        self.n_inner = 4 * law.n_contacts

    def at_rest(self, release: np.ndarray) -> np.ndarray:
        """Return the motion (n_inner,) of nodes at rest under release forces (n_channels,) N."""
        return self._nodes.at_rest(release).ravel()

    def advance(self, tension: np.ndarray, memory: ContactMemory, scale: float) -> ContactMemory:
        """Return the memory at the next instant, as `ContactStep.advance` does."""
        motion = memory.inner.reshape(4, -1)
        release, motion = self._nodes.solve(self.problem, tension, memory.release, motion, scale)
        return ContactMemory(release, motion.ravel())

    def support_force(self, release: np.ndarray, inner: np.ndarray) -> np.ndarray:
        """Return what stands against the supports' springs (nt, n_channels) N, of release forces and motions (nt, n_inner)."""
        return self._nodes.on_ground(release, _by_kind(inner))

    def openings(self, inner: np.ndarray) -> np.ndarray | None:
        """Return the openings (nt, n_c) m of the contacts from motions (nt, n_inner)."""
        return self._nodes.gap(_by_kind(inner))


def _by_kind(inner: np.ndarray) -> np.ndarray:
    """Return motions (nt, n_inner) as `AuxiliaryNodes` takes them, (4, nt, n_c)."""
    return inner.reshape(len(inner), 4, -1).transpose(1, 0, 2)
