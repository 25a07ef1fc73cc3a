"""The outputs that hold what the ground does to the plate: by springs and supports, and by conditions."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from uplift.forms.assembly.compiled_forms import CompiledForms
from uplift.forms.assembly.full_space import FullSpace
from uplift.forms.assembly.held_forces import effects_on_held, held_forces
from uplift.forms.assembly.numbering import Numbering
from uplift.forms.contact.ground_forces import RESULTANTS, Resultant, resultants, spring_forces
from uplift.forms.contact.placement import Placement
from uplift.forms.contact.rigid_motions import foot_middle
from uplift.forms.operators import OutputGroup
from uplift.forms.parameters import PlateModel
from uplift.meshes.compat import Mat

BY_GROUP = "reactions by group"
"""Name of the group of outputs with the resultants of each support, spring and condition."""

INERTIA = "inertia of "
"""What the name of a group begins with that holds the inertia of another one's resultants."""


def moments_about(compiled: CompiledForms, model: PlateModel, held: dict[str, np.ndarray]) -> np.ndarray:
    """Return the point (3,) m about which moments are taken: the middle of the box of all supports or springs, else of the conditions.

    Collective.
    """
    if model.supports or model.springs:
        return foot_middle(model)
    nodes = np.unique(np.concatenate([np.zeros(0, dtype=int), *(dofs // len(compiled.components) for dofs in held.values())]))
    parts = compiled.space.mesh.comm.allgather(compiled.space.tabulate_dof_coordinates()[nodes])
    points = np.concatenate(parts)
    return 0.5 * (points.min(axis=0) + points.max(axis=0)) if len(points) else np.zeros(3)


def rigid_rows(field: FullSpace, placement: Placement, numbering: Numbering, center: np.ndarray) -> np.ndarray:
    """Return the rigid motions (k, n_local) of the resultants, moments about `center` (3,) m, with contacts and joints unstrained."""
    motions = [component for _, component in RESULTANTS[field.compiled.kind]]
    found = np.zeros((len(motions), numbering.n_local))
    for row, motion in zip(found, motions, strict=True):
        whole = field.rigid(motion, center)
        row[: numbering.n_free] = whole[numbering.local_row >= 0]
        for component in placement.joints:  # its own dof is the motion of its node, or a strain
            row[numbering.extra_row(component.extra)] = max(component.term.load[1], 0.0) * whole[component.dof]
    return found


class Reactions:
    """Resultants of the forces of the ground: of all of them, and of each support, spring and condition by its name."""

    def __init__(self, compiled: CompiledForms, model: PlateModel, placement: Placement, numbering: Numbering) -> None:
        """Take the model and what stands on it."""
        self._compiled, self._placement, self._numbering = compiled, placement, numbering
        self._names = [*(group.name for groups in (model.supports, model.springs) for group in groups)]

    def groups(self, held: dict[str, np.ndarray], matrices: list[Mat], on_held: np.ndarray, center: np.ndarray) -> list[OutputGroup]:
        """Return "reactions", `BY_GROUP` and, where conditions hold anything, the groups of their inertia (collective).

        `held` are the dofs by condition group; `matrices` and `on_held` are those of `held_forces`; moments are about `center` (3,) m.
        """
        owners = list(dict.fromkeys([*self._names, *held]))
        conditions = bool(self._numbering.comm.allreduce(sum(len(dofs) for dofs in held.values())))
        found, inertias = [], []
        for name, of in (("reactions", [None]), (BY_GROUP, owners)):
            wanted = resultants(self._compiled.kind, of)
            group = self._group(name, wanted, center)
            if conditions:
                group, inertia = self._with_conditions(group, wanted, held, (matrices, on_held, center))
                inertias.append(inertia)
            found.append(group)
        return [*found, *inertias]

    def _group(self, name: str, wanted: tuple[Resultant, ...], center: np.ndarray) -> OutputGroup:
        comm = self._numbering.comm
        springs = spring_forces(wanted, self._placement, self._numbering, center)
        force, constant = comm.allreduce(springs.per_support_force), comm.allreduce(springs.constant)
        names, units = tuple(one.name for one in wanted), tuple(one.unit for one in wanted)
        return OutputGroup(name, names, units, springs.rows.tocsr(), force, constant)

    def _with_conditions(
        self, group: OutputGroup, wanted: tuple[Resultant, ...], held: dict[str, np.ndarray], system: tuple[Any, ...]
    ) -> tuple[OutputGroup, OutputGroup]:
        """Return a group with what conditions hold added, and the group of its inertia."""
        (matrices, on_held, center), compiled, numbering = system, self._compiled, self._numbering
        effects = effects_on_held(wanted, held, compiled.space, compiled.components, numbering.n_field, center)
        part = held_forces(effects, matrices, self._placement, numbering, on_held)
        inertia = OutputGroup(INERTIA + group.name, group.names, tuple("kg m" for _ in wanted), part.inertia)
        whole = OutputGroup(
            group.name, group.names, group.units, sparse.csr_matrix(group.local + part.rows), group.per_support_force, group.constant,
            per_velocity=part.per_velocity, per_load=numbering.comm.allreduce(part.per_load), inertia=inertia.name,
        )
        return whole, inertia
