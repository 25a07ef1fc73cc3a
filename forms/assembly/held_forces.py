"""The forces with which conditions hold their dofs: the rows of K u + C v + M a - f that the system leaves out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from uplift.forms.assembly.numbering import Numbering
from uplift.forms.contact.ground_forces import Resultant
from uplift.forms.contact.placement import Placement
from uplift.forms.contact.rigid_motions import resultants_of
from uplift.forms.contact.supports import AXES
from uplift.meshes.compat import Mat


@dataclass(frozen=True)
class HeldForces:
    """Parts of some resultants: rows u + per_velocity v + inertia a + per_load h, h the load histories; this rank's shares."""

    rows: sparse.csr_matrix
    """(n, n_local) N/m."""
    per_velocity: sparse.csr_matrix | None
    """(n, n_local) N s/m; None without damping."""
    inertia: sparse.csr_matrix
    """(n, n_local) kg."""
    per_load: np.ndarray
    """(n, n_loads) N."""


def effects_on_held(
    wanted: Sequence[Resultant], held: dict[str, np.ndarray], space: Any, components: tuple[str, ...], n_field: int, center: np.ndarray
) -> np.ndarray:
    """Return what a unit force on each held dof of this rank adds to the resultants, (n, n_field); `held` are dofs by condition group.

    A dof that several conditions hold belongs to the first. Many parameters because a dof says its point and axis by all of them.
    """
    effects, at, taken = np.zeros((len(wanted), n_field)), space.tabulate_dof_coordinates(), np.zeros(n_field, dtype=bool)
    for group, dofs in held.items():
        for dof in dofs[~taken[dofs]]:
            effect = resultants_of(at[dof // len(components)], AXES.index(components[dof % len(components)][1:]), center)
            effects[:, dof] = [effect[one.component] if one.owner in (None, group) else 0.0 for one in wanted]
        taken[dofs] = True
    return effects


def held_forces(
    effects: np.ndarray, matrices: Sequence[Mat], placement: Placement, numbering: Numbering, on_held: np.ndarray
) -> HeldForces:
    """Return the resultants of the forces on held dofs (collective).

    `effects` (n, n_field) are those of unit forces there, `matrices` stiffness, mass and where there is one damping over all dofs of
    the space, `on_held` (n_loads, n_field) the loads on held dofs. The matrices are symmetric: what free dofs do to held ones is found
    by products with the effects.
    """
    stiffness, mass, *damping = (sparse.lil_matrix(_on_free(matrix, effects, numbering)) for matrix in matrices)
    for component in placement.joints:
        plate, own = component.rows(numbering)
        if plate < 0:  # the joint's own dof pulls at a plate dof that is held
            for k in np.flatnonzero(effects[:, component.dof]):
                stiffness[k, own] += effects[k, component.dof] * component.term.stiffness[0, 1]
                mass[k, own] += effects[k, component.dof] * component.term.mass[0, 1]
    return HeldForces(stiffness.tocsr(), damping[0].tocsr() if damping else None, mass.tocsr(), -effects @ on_held.T)


def _on_free(matrix: Mat, effects: np.ndarray, numbering: Numbering) -> np.ndarray:
    """Return the rows (n, n_local) of effects (n, n_field) times a symmetric matrix, at the free dofs of the space."""
    given, product = matrix.createVecRight(), matrix.createVecLeft()
    found, free = np.zeros((len(effects), numbering.n_local)), numbering.local_row >= 0
    for row, effect in zip(found, effects, strict=True):
        given.array[:] = effect
        matrix.mult(given, product)
        row[: numbering.n_free] = np.real(product.array_r)[free]
    given.destroy()
    product.destroy()
    return found
