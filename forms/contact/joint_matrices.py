"""What joints, springs and point masses add to a system: entries, inertia, settlement and contacts."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from uplift.forms.assembly.numbering import Numbering
from uplift.forms.contact.law import UpliftLaw
from uplift.forms.contact.placement import NodeValue, Placement
from uplift.forms.contact.rigid_motions import rigid_value
from uplift.forms.contact.supports import TRANSLATIONS
from uplift.forms.operators import Contacts, Functionals


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


def held_inertia(placement: Placement, numbering: Numbering, motion: int, center: np.ndarray) -> np.ndarray:
    """Return the same of the masses that stand on held dofs of the plate, (n_field,)."""
    vector = np.zeros(numbering.n_field)
    for component in placement.joints:
        if component.axis < TRANSLATIONS and component.rows(numbering)[0] < 0:
            acceleration = rigid_value(component.point, component.axis, motion, center)
            vector[component.dof] += component.mass * acceleration * component.term.load[0]
    for at in placement.masses:
        if numbering.local_row[at.dof] < 0:
            vector[at.dof] += at.value * rigid_value(at.point, at.axis, motion, center)
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
