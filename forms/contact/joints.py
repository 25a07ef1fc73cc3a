"""The springs, joints and point masses of a model in the rows of its system, and the order of all its contacts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from uplift.forms.assembly.numbering import Numbering
from uplift.forms.assembly.points import in_words, owned_nodes
from uplift.forms.contact.law import UpliftLaw
from uplift.forms.contact.supports import AXES, TRANSLATIONS, JointTerm, Placed, Spring, Support, joint_term
from uplift.forms.operators import Contacts, Functionals, OutputGroup
from uplift.forms.parameters import Mass, PlateModel
from uplift.meshes.checked import ModelError

Point = tuple[float, ...]

RESULTANTS = {
    "plane stress": (("base shear", 0), ("vertical reaction", 1), ("overturning moment", 5)),
    "bending": (("force Z", 2), ("moment X", 3), ("moment Y", 4)),
    "shell": tuple((f"{'force' if k < TRANSLATIONS else 'moment'} {'XYZ'[k % 3]}", k) for k in range(6)),
}
"""Name and component of the resultants of the ground's forces."""


def rigid_value(point: np.ndarray, axis: int, motion: int, center: np.ndarray) -> float:
    """Return the component `axis` at `point` of the rigid motion by 1 m along or 1 rad about axis `motion` through `center`."""
    if axis >= TRANSLATIONS or motion < TRANSLATIONS:
        return float(axis == motion)
    turn = np.zeros(3)
    turn[motion - TRANSLATIONS] = 1.0
    return float(np.cross(turn, point - center)[axis])


def resultants_of(point: np.ndarray, axis: int, center: np.ndarray) -> np.ndarray:
    """Return force and moment about `center` (6,) of a unit force along, or a unit moment about, `axis` at `point`.

    By virtual work: each is the motion of the point along `axis` under the rigid motion that it works on.
    """
    return np.array([rigid_value(point, axis, motion, center) for motion in range(6)])


@dataclass(frozen=True)
class JointPart:
    """One component of one joint whose plate node this rank owns."""

    support: Support
    point: np.ndarray
    share: float
    axis: int
    rows: np.ndarray
    """(2,) rows within this rank: the plate's dof and the joint's own."""
    term: JointTerm
    channel: int
    """Channel of the contact that this component is, or -1 for a bonded one."""


class Joints:
    """What stands on the plate nodes that this rank owns, and the contacts of all ranks in order."""

    def __init__(self, space: Any, components: tuple[str, ...], kind: str, model: PlateModel) -> None:
        """Find the nodes (collective). Raises `ModelError` for a point that is at no node."""
        self.kind = kind
        self.block = len(components)
        self.column = {axis: components.index(f"D{name}") for axis, name in enumerate(AXES) if f"D{name}" in components}
        """Column of each of the components that the space has."""
        self.center = foot_middle(model)
        self._springs = [(spring, self._nodes(space, spring, f"springs.{spring.name}")) for spring in model.springs]
        self._masses = [(mass, self._nodes(space, mass, f"masses.{mass.name}")) for mass in model.masses]
        self._parts: list[tuple[Support, np.ndarray, float, int, int, int, int]] = []
        """(support, point, share, axis, node, extra dof, channel)."""
        self.names: list[str] = []
        self.points: list[Point] = []
        self.of: list[tuple[Support, float, int]] = []
        """Support, share and axis of each channel, normal ones first."""
        self.owner: list[int] = []
        self.settles = any(support.settlement != 0 for support in model.supports if support.unilateral)
        self.n_extra = 0
        self._place_supports(space, model)

    def _place_supports(self, space: Any, model: PlateModel) -> None:
        normal = sum(len(support.points) for support in model.supports if support.unilateral)
        sideways: list[tuple[int, tuple[Support, float, int]]] = []
        for support in model.supports:
            nodes = self._nodes(space, support, f"supports.{support.name}")
            if support.unilateral and support.axis not in self.column:
                words = f"the kinematics {self.kind!r} does not move along {AXES[support.axis]}"
                raise ModelError(f"supports.{support.name}.unilateral", words)
            for number, (node, point, share) in enumerate(zip(nodes, support.points, support.factors.tolist(), strict=True), start=1):
                channels = dict.fromkeys(self.column, -1)
                if support.unilateral:
                    contact = len(self.names)
                    self.names.append(f"{support.name}{number}")
                    self.points.append(point)
                    self.of.append((support, share, support.axis))
                    channels[support.axis] = contact
                    for axis in self.column:
                        released = support.sideways == "released" and np.isfinite(support.flexibility(axis))
                        if released and axis != support.axis and axis < TRANSLATIONS:
                            channels[axis] = normal + len(sideways)
                            sideways.append((contact, (support, share, axis)))
                for axis, channel in channels.items():
                    if node >= 0 and (support.stiffness[axis] > 0 or support.contact[axis] > 0):
                        self._parts.append((support, np.array(point), share, axis, int(node), self.n_extra, channel))
                        self.n_extra += 1
        self.owner = [*range(normal), *(contact for contact, _ in sideways)]
        self.of += [of for _, of in sideways]

    @staticmethod
    def _nodes(space: Any, group: Placed, key: str) -> np.ndarray:
        try:
            return owned_nodes(space, np.asarray(group.points, dtype=float).reshape(-1, 3), group.name)
        except ModelError as error:
            raise ModelError(key, error.message) from None

    @property
    def extra_nodes(self) -> np.ndarray:
        """Local plate nodes that the extra rows belong to, in their order."""
        return np.array([node for _, _, _, _, node, _, _ in self._parts], dtype=int)

    def dof(self, node: int, axis: int) -> int:
        """Return the dof of the space that is component `axis` of a node."""
        return self.block * node + self.column[axis]

    def refuse_held(self, held: np.ndarray, comm: Any) -> None:
        """Raise `ModelError` on all ranks if a contact that can open stands under a node that a condition holds (collective).

        `held` are dofs of this rank.
        """
        wrong = [
            (f"supports.{support.name}.unilateral", f"a condition holds the plate at {in_words(point)}, where this contact should open")
            for support, point, _, axis, node, _, channel in self._parts if channel >= 0 and self.dof(node, axis) in held
        ]
        for found in comm.allgather(wrong[:1]):
            if found:
                raise ModelError(*found[0])

    def parts(self, numbering: Numbering) -> Iterator[JointPart]:
        """Give the joint components of this rank whose plate dof is free."""
        for support, point, share, axis, node, extra, channel in self._parts:
            rows = np.array([numbering.local_row[self.dof(node, axis)], numbering.extra_row(extra)])
            # The auxiliary node's mass moves along the axes and has no inertia about them.
            mass = share * support.mass if axis < TRANSLATIONS else 0.0
            term = joint_term(share * support.stiffness[axis], share * support.contact[axis], mass)
            yield JointPart(support, point, share, axis, rows, term, channel)

    def spring_ends(self, numbering: Numbering) -> Iterator[tuple[np.ndarray, int, int, float]]:
        """Give point, axis, row within this rank and stiffness of each plain spring that is not zero and stands on a free dof."""
        yield from self._ends(numbering, self._springs, tuple(self.column), lambda spring, axis: spring.stiffness[axis])

    def point_masses(self, numbering: Numbering) -> Iterator[tuple[np.ndarray, int, int, float]]:
        """Give point, axis, row within this rank and mass of each point mass along each axis that is free there."""
        yield from self._ends(numbering, self._masses, tuple(a for a in self.column if a < TRANSLATIONS), lambda mass, _: mass.mass)

    def _ends(self, numbering: Numbering, groups: Any, axes: tuple[int, ...], value: Any) -> Iterator[tuple[np.ndarray, int, int, float]]:
        group: Spring | Mass
        for group, nodes in groups:
            for point, node, share in zip(group.points, nodes, group.factors.tolist(), strict=True):
                for axis in axes:
                    if node >= 0 and value(group, axis) > 0:
                        row = int(numbering.local_row[self.dof(int(node), axis)])
                        if row >= 0:
                            yield np.array(point), axis, row, share * value(group, axis)

    def matrices(self, numbering: Numbering) -> tuple[sparse.csr_matrix, sparse.csr_matrix, sparse.coo_matrix]:
        """Return the extra entries in rows of this rank: stiffness of what stays bonded and of what can open, and mass."""
        bonded, unilateral, mass = _Entries(), _Entries(), _Entries()
        for part in self.parts(numbering):
            (bonded if part.channel < 0 else unilateral).add(part.rows, part.term.stiffness)
            mass.add(part.rows, part.term.mass)
        for _, _, row, value in self.spring_ends(numbering):
            bonded.add(np.array([row]), np.array([[value]]))
        for _, _, row, value in self.point_masses(numbering):
            mass.add(np.array([row]), np.array([[value]]))
        n = numbering.n_local
        return bonded.matrix(n).tocsr(), unilateral.matrix(n).tocsr(), mass.matrix(n).tocsr().tocoo()

    def inertia(self, numbering: Numbering, motion: int, center: np.ndarray) -> np.ndarray:
        """Return the point masses times the unit acceleration along or about axis `motion` through `center`, (n_local,)."""
        vector = np.zeros(numbering.n_local)
        for part in self.parts(numbering):
            if part.axis < TRANSLATIONS:
                acceleration = rigid_value(part.point, part.axis, motion, center)
                free = part.rows >= 0
                vector[part.rows[free]] += part.share * part.support.mass * acceleration * part.term.load[free]
        for point, axis, row, mass in self.point_masses(numbering):
            vector[row] += mass * rigid_value(point, axis, motion, center)
        return vector

    def settlement_load(self, numbering: Numbering) -> np.ndarray:
        """Return the force (n_local,) N of support springs on ground that lies away from the plate by gap or preload."""
        vector = np.zeros(numbering.n_local)
        for part in self.parts(numbering):
            if 0 <= part.channel < len(self.names):
                stiffness = part.share * part.support.stiffness[part.axis]
                vector[part.rows] -= stiffness * part.support.sign * part.support.settlement * part.term.load
        return vector

    def rigid_motion(self, motion: int, center: np.ndarray) -> np.ndarray:
        """Return the values (n_extra,) of the extra dofs under a unit rigid motion along or about an axis through `center`."""
        values = np.zeros(self.n_extra)
        for support, point, _, axis, _, extra, _ in self._parts:
            node = joint_term(support.stiffness[axis], support.contact[axis], support.mass).load
            # The auxiliary node moves with the plate: node . (1, r) = 1.
            values[extra] = (1.0 - node[0]) / node[1] * rigid_value(point, axis, motion, center)
        return values

    def contacts(self, numbering: Numbering) -> Contacts:
        """Return the contacts of all ranks, with the part of their functionals and forces that lies on this rank."""
        n_c, n_channels = len(self.names), len(self.owner)
        elongation = sparse.lil_matrix((n_channels, numbering.n_local))
        push = sparse.lil_matrix((numbering.n_local, n_channels))
        for part in self.parts(numbering):
            if part.channel >= 0:
                sign = part.support.sign if part.channel < n_c else 1.0
                elongation[part.channel, part.rows] = sign * part.term.elongation
                push[part.rows[0], part.channel] = sign
        sideways = tuple(f"{self.names[c]} sideways {AXES[axis]}" for c, (_, _, axis) in zip(self.owner[n_c:], self.of[n_c:], strict=True))
        return Contacts(
            tuple(self.names),
            np.asarray(self.points, dtype=float).reshape(-1, 3),
            Functionals((*self.names, *sideways), elongation.tocsr(), numbering.comm),
            push.tocsr(),
            UpliftLaw(
                np.array([share * support.contact[axis] for support, share, axis in self.of]),
                np.array([support.flexibility(axis) / share for support, share, axis in self.of]),
                np.asarray(self.owner, dtype=int),
                np.array([share * support.mass for support, share, _ in self.of]),
            ),
        )

    def reactions(self, numbering: Numbering) -> OutputGroup:
        """Return the resultants of all spring forces on the plate, moments about the middle of its foot."""
        wanted = RESULTANTS[self.kind]
        picked = [component for _, component in wanted]
        rows = sparse.lil_matrix((len(wanted), numbering.n_local))
        per_release = np.zeros((len(wanted), len(self.owner)))
        constant = np.zeros(len(wanted))
        for point, axis, row, value in self.spring_ends(numbering):
            for k, effect in enumerate(resultants_of(point, axis, self.center)[picked]):
                if effect:
                    rows[k, row] -= value * effect
        for part in self.parts(numbering):
            effect = resultants_of(part.point, part.axis, self.center)[picked]
            # The ground's force is that of the support spring; while a contact is open its release force stands against it.
            stiffness = part.share * part.support.stiffness[part.axis]
            for k in np.flatnonzero(effect):
                for row, weight in zip(part.rows, part.term.load, strict=True):
                    if row >= 0:
                        rows[k, row] -= stiffness * weight * effect[k]
            if part.channel >= 0:
                normal = part.channel < len(self.names)
                per_release[:, part.channel] = effect * (part.support.sign if normal else 1.0)
                if normal:
                    constant -= effect * stiffness * part.support.sign * part.support.settlement
        comm, names = numbering.comm, tuple(name for name, _ in wanted)
        units = tuple("N m" if component >= TRANSLATIONS else "N" for component in picked)
        summed = (comm.allreduce(part) if comm.size > 1 else part for part in (per_release, constant))
        return OutputGroup("reactions", names, units, rows.tocsr(), *summed)


class _Entries:
    """Collects small blocks of a sparse matrix; rows below 0, of dofs that are held, are left out."""

    def __init__(self) -> None:
        self._rows: list[int] = []
        self._columns: list[int] = []
        self._values: list[float] = []

    def add(self, rows: np.ndarray, block: np.ndarray) -> None:
        for i, row in enumerate(rows):
            for j, column in enumerate(rows):
                if row >= 0 and column >= 0:
                    self._rows.append(int(row))
                    self._columns.append(int(column))
                    self._values.append(float(block[i, j]))

    def matrix(self, n: int) -> sparse.coo_matrix:
        return sparse.coo_matrix((self._values, (self._rows, self._columns)), shape=(n, n))


def foot_middle(model: PlateModel) -> np.ndarray:
    """Return the point (3,) m about which moments are taken: the middle of the box that holds all supports and springs."""
    groups: tuple[Support, ...] | tuple[Spring, ...] = model.supports or model.springs
    points = [p for group in groups for p in group.points]
    if not points:
        return np.zeros(3)
    middle: np.ndarray = 0.5 * (np.min(points, axis=0) + np.max(points, axis=0))
    return middle
