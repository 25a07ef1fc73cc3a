"""Who stands where: the joints, springs and point masses on the plate nodes of this rank, and the contacts of all ranks in order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uplift.forms.assembly.numbering import NodeDofs, Numbering
from uplift.forms.assembly.points import in_words, owned_nodes
from uplift.forms.contact.supports import AXES, TRANSLATIONS, JointTerm, Placed, Point, Support, joint_term
from uplift.forms.parameters import PlateModel
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import Space


@dataclass(frozen=True, eq=False)
class Joint:
    """A support at one of its points."""

    support: Support
    name: str
    """Name of the support and number of the point, from 1."""
    point: Point
    tributary: float
    """Factor of stiffnesses, mass and preload here: 1, or the tributary length in m or area in m2."""
    node: int
    """Local node of the space that this rank owns at the point, or -1."""

    @property
    def key(self) -> str:
        """Entry of the scene that the support comes from."""
        return f"supports.{self.support.name}"


@dataclass(frozen=True, eq=False)
class ContactComponent:
    """One component of the force in a contact that can open: its normal force, or a sideways force that is released with it."""

    joint: Joint
    axis: int
    number: int
    """Place among all contact components of all ranks, normal ones first."""
    contact_of: int
    """Number of the contact, that of its normal component."""

    @property
    def normal(self) -> bool:
        """Whether it is the normal force of its contact."""
        return self.number == self.contact_of

    @property
    def sign(self) -> float:
        """Sense along the axis in which the plate moves when the contact opens; +1 for sideways components."""
        return self.joint.support.sign if self.normal else 1.0

    @property
    def name(self) -> str:
        """Name in tables."""
        return self.joint.name if self.normal else f"{self.joint.name} sideways {AXES[self.axis]}"


@dataclass(frozen=True, eq=False)
class JointComponent:
    """One component of a joint whose plate node this rank owns."""

    joint: Joint
    axis: int
    dof: int
    """Dof of the space: the plate's displacement or rotation along the axis."""
    extra: int
    """Number among the extra dofs of this rank: the joint's own dof."""
    contact: ContactComponent | None
    """None for a component that stays bonded."""

    @property
    def point(self) -> np.ndarray:
        """Where the joint stands, (3,) m."""
        return np.array(self.joint.point)

    @property
    def stiffness(self) -> float:
        """Stiffness of the support spring, N/m or N m/rad."""
        return self.joint.tributary * self.joint.support.stiffness[self.axis]

    @property
    def mass(self) -> float:
        """Mass in kg of the auxiliary node, which moves along the axes and has no inertia about them."""
        return self.joint.tributary * self.joint.support.mass if self.axis < TRANSLATIONS else 0.0

    @property
    def term(self) -> JointTerm:
        """Its matrices in the unknowns (plate's dof, joint's own dof)."""
        return joint_term(self.stiffness, self.joint.tributary * self.joint.support.contact[self.axis], self.mass)

    def rows(self, numbering: Numbering) -> np.ndarray:
        """Return the rows (2,) within this rank of plate's and joint's dof; the first is -1 where a condition holds the plate."""
        return np.array([numbering.local_row[self.dof], numbering.extra_row(self.extra)])


@dataclass(frozen=True, eq=False)
class NodeValue:
    """A plain spring, or a point mass, along one axis of a plate node that this rank owns."""

    group: str
    """Name of the springs or masses."""
    point: np.ndarray
    """(3,) m."""
    axis: int
    dof: int
    """Dof of the space."""
    value: float
    """Stiffness in N/m or N m/rad, or mass in kg."""


@dataclass(frozen=True, eq=False)
class Placement:
    """What stands on the plate nodes that this rank owns, and the contacts of all ranks in order."""

    joints: tuple[JointComponent, ...]
    """In the order of their extra dofs."""
    springs: tuple[NodeValue, ...]
    masses: tuple[NodeValue, ...]
    contacts: tuple[ContactComponent, ...]
    """Of all ranks: the normal components in the order of the supports and their points, then the sideways ones."""

    @property
    def n_extra(self) -> int:
        """Number of dofs that the joints of this rank add."""
        return len(self.joints)

    @property
    def n_contacts(self) -> int:
        """Number of contacts of all ranks."""
        return sum(component.normal for component in self.contacts)

    @property
    def extra_nodes(self) -> np.ndarray:
        """Local plate nodes that the extra dofs belong to, in their order."""
        return np.array([component.joint.node for component in self.joints], dtype=int)

    @property
    def settles(self) -> bool:
        """Whether any contact has a gap or a preload."""
        return any(component.joint.support.settlement != 0 for component in self.contacts if component.normal)

    def refuse_held(self, held: np.ndarray, comm: Any) -> None:
        """Raise `ModelError` on all ranks if a contact that can open stands under a node that a condition holds (collective).

        `held` are dofs of this rank.
        """
        wrong = [
            (f"{at.joint.key}.unilateral", f"a condition holds the plate at {in_words(at.point)}, where this contact should open")
            for at in self.joints if at.contact is not None and at.dof in held
        ]
        for found in comm.allgather(wrong[:1]):
            if found:
                raise ModelError(*found[0])


def place(space: Space, components: tuple[str, ...], kind: str, model: PlateModel) -> Placement:
    """Find the nodes of all supports, springs and masses of a model (collective).

    `components` are those of a node of `space` under the kinematics `kind`. Raises `ModelError` for a point that is at no node and
    for a contact that opens along an axis without a component.
    """
    dofs = NodeDofs(components)
    springs = [
        value for spring in model.springs
        for value in _node_values(spring, _nodes(space, spring, f"springs.{spring.name}"), spring.stiffness, dofs)
    ]
    masses = [
        value for mass in model.masses
        for value in _node_values(mass, _nodes(space, mass, f"masses.{mass.name}"), (mass.mass,) * TRANSLATIONS, dofs)
    ]
    joints = [joint for support in model.supports for joint in _joints(space, support)]
    for joint in joints:
        if joint.support.unilateral and joint.support.axis not in dofs.column:
            words = f"the kinematics {kind!r} does not move along {AXES[joint.support.axis]}"
            raise ModelError(f"{joint.key}.unilateral", words)
    contacts = _contact_components(joints, dofs)
    return Placement(_joint_components(joints, contacts, dofs), tuple(springs), tuple(masses), contacts)


def _nodes(space: Space, group: Placed, key: str) -> np.ndarray:
    try:
        return owned_nodes(space, np.asarray(group.points, dtype=float).reshape(-1, 3), group.name)
    except ModelError as error:
        raise ModelError(key, error.message) from None


def _node_values(group: Placed, nodes: np.ndarray, values: Sequence[float], dofs: NodeDofs) -> list[NodeValue]:
    """Return what is not zero of `values` along the axes at those nodes of a group that this rank owns."""
    axes = [axis for axis, value in enumerate(values) if value > 0 and axis in dofs.column]
    return [
        NodeValue(group.name, np.array(point), axis, dofs.dof(int(node), axis), tributary * values[axis])
        for point, node, tributary in zip(group.points, nodes, group.factors.tolist(), strict=True) if node >= 0
        for axis in axes
    ]


def _joints(space: Space, support: Support) -> list[Joint]:
    nodes = _nodes(space, support, f"supports.{support.name}")
    return [
        Joint(support, f"{support.name}.{number}", point, tributary, int(node))
        for number, (point, tributary, node) in enumerate(zip(support.points, support.factors.tolist(), nodes, strict=True), start=1)
    ]


def _contact_components(joints: list[Joint], dofs: NodeDofs) -> tuple[ContactComponent, ...]:
    """Return the components of all contacts, normal ones first."""
    unilateral = [joint for joint in joints if joint.support.unilateral]
    normal = [ContactComponent(joint, joint.support.axis, contact, contact) for contact, joint in enumerate(unilateral)]
    released = [
        (joint, axis, contact) for contact, joint in enumerate(unilateral) if joint.support.follows_sideways
        for axis in dofs.column
        if axis < TRANSLATIONS and axis != joint.support.axis and np.isfinite(joint.support.flexibility(axis))
    ]
    sideways = [ContactComponent(joint, axis, len(normal) + k, contact) for k, (joint, axis, contact) in enumerate(released)]
    return (*normal, *sideways)


def _joint_components(joints: list[Joint], contacts: tuple[ContactComponent, ...], dofs: NodeDofs) -> tuple[JointComponent, ...]:
    """Return the components of those joints that stand on nodes of this rank, where a spring gives them a meaning."""
    contact_at = {(contact.joint, contact.axis): contact for contact in contacts}
    springy = [
        (joint, axis) for joint in joints if joint.node >= 0
        for axis in dofs.column if joint.support.stiffness[axis] > 0 or joint.support.contact[axis] > 0
    ]
    return tuple(
        JointComponent(joint, axis, dofs.dof(joint.node, axis), extra, contact_at.get((joint, axis)))
        for extra, (joint, axis) in enumerate(springy)
    )
