"""The resultants of the forces of the ground on the plate: of all, and of each support, spring and condition by its name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from uplift.forms.assembly.numbering import Numbering
from uplift.forms.contact.placement import JointComponent, Placement
from uplift.forms.contact.rigid_motions import resultants_of
from uplift.forms.contact.supports import TRANSLATIONS

RESULTANTS = {
    "plane stress": (("base shear", 0), ("vertical reaction", 1), ("overturning moment", 5)),
    "bending": (("force Z", 2), ("moment X", 3), ("moment Y", 4)),
    "shell": tuple((f"{'force' if k < TRANSLATIONS else 'moment'} {'XYZ'[k % 3]}", k) for k in range(6)),
}
"""Name and component of the resultants of the ground's forces."""


@dataclass(frozen=True)
class Resultant:
    """One resultant: a component of the force, or of the moment about the common point."""

    name: str
    component: int
    """0 to 5."""
    owner: str | None
    """Name of the support, spring or condition that it is of; None: of all."""

    @property
    def unit(self) -> str:
        """Its SI unit."""
        return "N m" if self.component >= TRANSLATIONS else "N"


def resultants(kind: str, owners: Sequence[str | None]) -> tuple[Resultant, ...]:
    """Return the resultants of each of the owners under the kinematics `kind`: of all (None) by their usual names, else GROUP.FX ... MZ."""
    return tuple(
        Resultant(name if owner is None else f"{owner}.{'FM'[component >= TRANSLATIONS]}{'XYZ'[component % 3]}", component, owner)
        for owner in owners for name, component in RESULTANTS[kind]
    )


@dataclass
class GroundForces:
    """Resultants as functionals of a solution: rows u + per_support_force s + constant, this rank's shares."""

    rows: sparse.lil_matrix
    """(n, n_local) N/m."""
    per_support_force: np.ndarray
    """(n, n_channels)."""
    constant: np.ndarray
    """(n,) N."""


def spring_forces(wanted: Sequence[Resultant], placement: Placement, numbering: Numbering, center: np.ndarray) -> GroundForces:
    """Return what springs and supports bring to the resultants on this rank, moments about `center` (3,) m.

    The ground's force is that of the support spring; while a contact is open its release force stands against it.
    """
    n = len(wanted)
    found = GroundForces(sparse.lil_matrix((n, numbering.n_local)), np.zeros((n, len(placement.contacts))), np.zeros(n))
    for at in placement.springs:
        row = int(numbering.local_row[at.dof])
        for k, effect in _effects(wanted, at.group, at.point, at.axis, center) if row >= 0 else ():
            found.rows[k, row] -= at.value * effect
    for component in placement.joints:
        for k, effect in _effects(wanted, component.joint.support.name, component.point, component.axis, center):
            for row, weight in zip(component.rows(numbering), component.term.load, strict=True):
                if row >= 0:
                    found.rows[k, row] -= component.stiffness * weight * effect
            _add_contact(found, k, effect, component)
    return found


def _add_contact(found: GroundForces, k: int, effect: float, component: JointComponent) -> None:
    contact = component.contact
    if contact is not None:
        found.per_support_force[k, contact.number] += effect * contact.sign
        if contact.normal:
            found.constant[k] -= effect * component.stiffness * contact.sign * component.joint.support.settlement


def _effects(
    wanted: Sequence[Resultant], owner: str, point: np.ndarray, axis: int, center: np.ndarray
) -> Iterator[tuple[int, float]]:
    """Give the number of each resultant that a unit force of an owner at a point adds to, and what it adds."""
    effect = resultants_of(point, axis, center)
    for k, resultant in enumerate(wanted):
        if resultant.owner in (None, owner) and effect[resultant.component]:
            yield k, float(effect[resultant.component])
