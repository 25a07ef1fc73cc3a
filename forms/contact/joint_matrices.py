"""What joints, springs and point masses add to a system: entries, inertia, settlement, contacts and the resultants of the ground."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from uplift.forms.assembly.numbering import Numbering
from uplift.forms.contact.law import UpliftLaw
from uplift.forms.contact.placement import NodeValue, Placement
from uplift.forms.contact.rigid_motions import resultants_of, rigid_value
from uplift.forms.contact.supports import TRANSLATIONS
from uplift.forms.operators import Contacts, Functionals, OutputGroup

RESULTANTS = {
    "plane stress": (("base shear", 0), ("vertical reaction", 1), ("overturning moment", 5)),
    "bending": (("force Z", 2), ("moment X", 3), ("moment Y", 4)),
    "shell": tuple((f"{'force' if k < TRANSLATIONS else 'moment'} {'XYZ'[k % 3]}", k) for k in range(6)),
}
"""Name and component of the resultants of the ground's forces."""


def entries(placement: Placement, numbering: Numbering) -> tuple[sparse.csr_matrix, sparse.csr_matrix, sparse.coo_matrix]:
    """Return the extra entries in rows of this rank: stiffness of what stays bonded and of what can open, and mass."""
    bonded, unilateral, mass = _Entries(), _Entries(), _Entries()
    for component in placement.joints:
        rows, term = component.rows(numbering), component.term
        (bonded if component.contact is None else unilateral).add(rows, term.stiffness)
        mass.add(rows, term.mass)
    for values, total in ((placement.springs, bonded), (placement.masses, mass)):
        for at, row in _free(values, numbering):
            total.add(np.array([row]), np.array([[at.value]]))
    n = numbering.n_local
    return bonded.matrix(n).tocsr(), unilateral.matrix(n).tocsr(), mass.matrix(n).tocsr().tocoo()


def inertia(placement: Placement, numbering: Numbering, motion: int, center: np.ndarray) -> np.ndarray:
    """Return the point masses times the unit acceleration along or about axis `motion` through `center`, (n_local,)."""
    vector = np.zeros(numbering.n_local)
    for component in placement.joints:
        if component.axis < TRANSLATIONS:
            acceleration = rigid_value(component.point, component.axis, motion, center)
            rows = component.rows(numbering)
            free = rows >= 0
            vector[rows[free]] += component.mass * acceleration * component.term.load[free]
    for at, row in _free(placement.masses, numbering):
        vector[row] += at.value * rigid_value(at.point, at.axis, motion, center)
    return vector


def settlement_load(placement: Placement, numbering: Numbering) -> np.ndarray:
    """Return the force (n_local,) N of support springs on ground that lies away from the plate by gap or preload."""
    vector = np.zeros(numbering.n_local)
    for component in placement.joints:
        contact = component.contact
        if contact is not None and contact.normal:
            settlement = contact.sign * component.joint.support.settlement
            vector[component.rows(numbering)] -= component.stiffness * settlement * component.term.load
    return vector


def contacts(placement: Placement, numbering: Numbering) -> Contacts:
    """Return the contacts of all ranks, with the part of their functionals and forces that lies on this rank."""
    components = placement.contacts
    normal = components[: placement.n_contacts]
    elongation = sparse.lil_matrix((len(components), numbering.n_local))
    direction = sparse.lil_matrix((numbering.n_local, len(components)))
    for component in placement.joints:
        if component.contact is not None:
            rows, number, sign = component.rows(numbering), component.contact.number, component.contact.sign
            elongation[number, rows] = sign * component.term.elongation
            direction[rows[0], number] = sign
    placed = [(c.joint.support, c.joint.tributary, c.axis) for c in components]
    return Contacts(
        tuple(c.name for c in normal),
        np.asarray([c.joint.point for c in normal], dtype=float).reshape(-1, 3),
        Functionals(tuple(c.name for c in components), elongation.tocsr(), numbering.comm),
        direction.tocsr(),
        UpliftLaw(
            np.array([tributary * support.contact[axis] for support, tributary, axis in placed]),
            np.array([support.flexibility(axis) / tributary for support, tributary, axis in placed]),
            np.array([c.contact_of for c in components], dtype=int),
            np.array([tributary * support.mass for support, tributary, _ in placed]),
        ),
    )


def reactions(placement: Placement, numbering: Numbering, kind: str, center: np.ndarray) -> OutputGroup:
    """Return the resultants of all spring forces on the plate under the kinematics `kind`, moments about `center` (3,) m."""
    wanted = RESULTANTS[kind]
    picked = [component for _, component in wanted]
    rows = sparse.lil_matrix((len(wanted), numbering.n_local))
    per_release = np.zeros((len(wanted), len(placement.contacts)))
    constant = np.zeros(len(wanted))
    for at, row in _free(placement.springs, numbering):
        effect = resultants_of(at.point, at.axis, center)[picked]
        for k in np.flatnonzero(effect):
            rows[k, row] -= at.value * effect[k]
    for component in placement.joints:
        effect = resultants_of(component.point, component.axis, center)[picked]
        # The ground's force is that of the support spring; while a contact is open its release force stands against it.
        for row, weight in zip(component.rows(numbering), component.term.load, strict=True):
            for k in np.flatnonzero(effect) if row >= 0 else ():
                rows[k, row] -= component.stiffness * weight * effect[k]
        contact = component.contact
        if contact is not None:
            per_release[:, contact.number] = effect * contact.sign
            if contact.normal:
                constant -= effect * component.stiffness * contact.sign * component.joint.support.settlement
    comm, names = numbering.comm, tuple(name for name, _ in wanted)
    units = tuple("N m" if component >= TRANSLATIONS else "N" for component in picked)
    summed = (comm.allreduce(part) if comm.size > 1 else part for part in (per_release, constant))
    return OutputGroup("reactions", names, units, rows.tocsr(), *summed)


def _free(values: tuple[NodeValue, ...], numbering: Numbering) -> list[tuple[NodeValue, int]]:
    """Return the springs or masses whose dof is free, each with its row within this rank."""
    rows = [(at, int(numbering.local_row[at.dof])) for at in values]
    return [(at, row) for at, row in rows if row >= 0]


class _Entries:
    """Collects small blocks of a sparse matrix; rows below 0, of dofs that are held, are left out."""

    def __init__(self) -> None:
        self._rows: list[int] = []
        self._columns: list[int] = []
        self._values: list[float] = []

    def add(self, rows: np.ndarray, block: np.ndarray) -> None:
        free = np.flatnonzero(rows >= 0)
        for i in free:
            for j in free:
                self._rows.append(int(rows[i]))
                self._columns.append(int(rows[j]))
                self._values.append(float(block[i, j]))

    def matrix(self, n: int) -> sparse.coo_matrix:
        return sparse.coo_matrix((self._values, (self._rows, self._columns)), shape=(n, n))
