"""Rigid motions of a plate, and of each part of its mesh, that nothing resists."""

from __future__ import annotations

from collections.abc import Iterator

import dolfinx.fem
import numpy as np

from uplift.forms.assembly.compiled_forms import CompiledForms
from uplift.forms.assembly.nodes import to_owners
from uplift.forms.assembly.points import owned_nodes
from uplift.forms.contact.rigid_motions import foot_middle
from uplift.forms.contact.supports import AXES, TRANSLATIONS
from uplift.forms.parameters import PlateModel
from uplift.meshes.checked import ModelError
from uplift.meshes.parts import MeshPart
from uplift.meshes.tagged import extent_of

MOTIONS = {
    "plane stress": {0: "sliding along X", 1: "moving along Y", 5: "rotation"},
    "bending": {2: "moving along Z", 3: "rotation about X", 4: "rotation about Y"},
    "shell": {k: f"{'moving along' if k < 3 else 'rotation about'} {'XYZ'[k % 3]}" for k in range(6)},
}
"""Rigid motions of each kinematics, in words."""

FREE = 1e-13
"""Of the largest resistance, or of 1: less is round-off of coordinates, whose squares it is made of."""


def free_motions(compiled: CompiledForms, model: PlateModel, held: np.ndarray) -> tuple[str, ...]:
    """Return in words the rigid motions that no spring resists with all contacts closed, however weakly (collective).

    `held` are the dofs of this rank's nodes that conditions hold. Nothing is returned for a plate that is held. Of a mesh in several
    parts each is looked at by itself; a part at which nothing stands, but at a node by which it hangs on another, is refused by a
    `ModelError` with its name.
    """
    parts = compiled.tagged.parts
    resisted, standing = _resistances(compiled, model, held, parts)
    words = list(MOTIONS[compiled.kind].values())
    if not parts:
        return tuple(_free(resisted[0], words))
    for part, stands in zip(parts, standing, strict=True):
        if not stands:
            raise ModelError("mesh", f"nothing holds the part {part.name}: it shares no side of a cell with what is held, and no support, "
                                     "spring or condition stands on it")
    return tuple(f"{motion} of {part.name}" for part, r in zip(parts, resisted, strict=True) for motion in _free(r, words))


def _free(resisted: np.ndarray, words: list[str]) -> list[str]:
    values, motions = np.linalg.eigh(resisted)
    unrestrained = motions[:, values <= FREE * max(float(values[-1]), 1.0)]
    return [words[int(np.argmax(np.abs(motion)))] for motion in unrestrained.T]


def _resistances(
    compiled: CompiledForms, model: PlateModel, held: np.ndarray, parts: tuple[MeshPart, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the sum of r r^T of all that holds each part (parts, motions, motions), one part where there are none, on every rank.

    And how many components are held (parts,) at nodes of each part that belong to no other. r are the motions of a held point along the
    axis that is held, under 1 m along and 1 rad times the extent about each axis.
    """
    comm, space = compiled.space.mesh.comm, compiled.space
    picked, center = list(MOTIONS[compiled.kind]), foot_middle(model)
    at = space.tabulate_dof_coordinates()
    reach = extent_of(at, comm)
    members = _members(compiled, parts) if parts else None
    present = [AXES.index(name[1:]) for name in compiled.components]
    total = np.zeros((max(len(parts), 1), len(picked), len(picked)))
    standing = np.zeros(len(total), dtype=int)

    def resist(points: np.ndarray, axis: int, nodes: np.ndarray) -> None:
        rows = _motions_of(points, axis, center)[:, picked]
        rows = rows * np.where(np.array(picked) < TRANSLATIONS, 1.0, 1.0 / reach) * (1.0 if axis < TRANSLATIONS else reach)
        for number in range(len(total)):
            inside = np.ones(len(rows), dtype=bool) if members is None else members[nodes, number]
            total[number] += rows[inside].T @ rows[inside]
            standing[number] += np.sum(inside if members is None else inside & (members[nodes].sum(axis=1) == 1))

    for column, axis in enumerate(present):
        nodes = held[held % len(present) == column] // len(present)
        resist(at[nodes], axis, nodes)
    for name, points, axes in _holding(model, present):
        nodes = owned_nodes(space, points, name) if parts else np.zeros(len(points) if comm.rank == 0 else 0, dtype=int)
        here = nodes >= 0
        for axis in axes:
            resist(points[: len(nodes)][here], axis, nodes[here])
    return np.asarray(sum(comm.allgather(total))), np.asarray(sum(comm.allgather(standing)))


def _holding(model: PlateModel, present: list[int]) -> Iterator[tuple[str, np.ndarray, list[int]]]:
    """Give name, points (n, 3) m and the axes that are held of all springs and supports."""
    for spring in model.springs:
        yield spring.name, np.reshape(spring.points, (-1, 3)), [axis for axis in present if spring.stiffness[axis] > 0]
    for support in model.supports:
        yield support.name, np.reshape(support.points, (-1, 3)), [axis for axis in present if np.isfinite(support.flexibility(axis))]


def _motions_of(points: np.ndarray, axis: int, center: np.ndarray) -> np.ndarray:
    """Return the component `axis` (n, 6) of points (n, 3) m under each rigid motion: 1 m along and 1 rad about the axes by `center`."""
    rows = np.zeros((len(points), len(AXES)))
    rows[:, axis] = 1.0
    if axis < TRANSLATIONS:
        for turn in range(TRANSLATIONS):
            rows[:, TRANSLATIONS + turn] = np.cross(np.eye(3)[turn], points - center)[:, axis]
    return rows


def _members(compiled: CompiledForms, parts: tuple[MeshPart, ...]) -> np.ndarray:
    """Tell which of the owned nodes (n, parts) belong to which part (collective); a node at which two of them hang belongs to both."""
    space, tagged = compiled.space, compiled.tagged
    columns = []
    for part in parts:
        cells = np.concatenate([tagged.cell_tags.find(tag) for tag in part.surfaces]).astype(np.int32)
        indicator = np.zeros(len(space.tabulate_dof_coordinates()))
        space.mesh.topology.create_connectivity(2, 2)  # dolfinx 0.9 asks for it
        indicator[dolfinx.fem.locate_dofs_topological(space, 2, np.sort(cells))] = 1.0
        columns.append(to_owners(space, indicator) > 0)
    return np.column_stack(columns)
