"""Rigid motions of a plate that nothing resists."""

from __future__ import annotations

import numpy as np

from uplift.forms.assembly.compiled_forms import CompiledForms
from uplift.forms.contact.rigid_motions import foot_middle, resultants_of
from uplift.forms.contact.supports import AXES
from uplift.forms.parameters import PlateModel
from uplift.meshes.tagged import extent_of

MOTIONS = {
    "plane stress": {0: "sliding along X", 1: "moving along Y", 5: "rotation"},
    "bending": {2: "moving along Z", 3: "rotation about X", 4: "rotation about Y"},
    "shell": {k: f"{'moving along' if k < 3 else 'rotation about'} {'XYZ'[k % 3]}" for k in range(6)},
}
"""Rigid motions of each kinematics, in words."""


def free_motions(compiled: CompiledForms, model: PlateModel, held: np.ndarray) -> tuple[str, ...]:
    """Return in words the rigid motions that no spring resists with all contacts closed, however weakly (collective).

    `held` are the dofs of this rank's nodes that conditions hold. Nothing is returned for a plate that is held.
    """
    words, center = MOTIONS[compiled.kind], foot_middle(model)
    picked = list(words)
    at = compiled.space.tabulate_dof_coordinates()
    reach = extent_of(at, compiled.space.mesh.comm)
    scale = np.where(np.array(picked) < 3, 1.0, 1.0 / reach)
    present = [AXES.index(name[1:]) for name in compiled.components]
    resisted = np.zeros((len(picked), len(picked)))

    def resist(point: np.ndarray, axis: int) -> None:
        row = resultants_of(point, axis, center)[picked] * (scale if axis < 3 else scale * reach)
        resisted[:] += np.outer(row, row)

    for dof in held:
        resist(at[dof // len(present)], present[dof % len(present)])
    resisted[:] = sum(compiled.space.mesh.comm.allgather(resisted))
    for spring in model.springs:
        for axis in present:
            if spring.stiffness[axis] > 0:
                for point in spring.points:
                    resist(np.array(point), axis)
    for support in model.supports:
        for axis in present:
            if np.isfinite(support.flexibility(axis)):
                for point in support.points:
                    resist(np.array(point), axis)
    values, motions = np.linalg.eigh(resisted)
    unrestrained = motions[:, values <= 1e-13 * max(float(values[-1]), 1.0)]
    return tuple(words[picked[int(np.argmax(np.abs(motion)))]] for motion in unrestrained.T)
