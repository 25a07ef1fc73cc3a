"""Fields of displacement and velocity that initial conditions give a plate."""

from __future__ import annotations

import numpy as np

from uplift.forms.assembly.nodes import nodes_of
from uplift.forms.assembly.numbering import Numbering
from uplift.forms.contact.supports import AXES, TRANSLATIONS
from uplift.forms.initial_conditions import InitialCondition, Turn
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import Space
from uplift.meshes.groups import names_in
from uplift.meshes.tagged import TaggedMesh


def initial_fields(
    given: tuple[InitialCondition, ...], tagged: TaggedMesh, space: Space, numbering: Numbering, components: tuple[str, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the displacements m and rad, and their rates per s, of the owned dofs of `space`, (n_field,) each (collective).

    `components` are those of a node. Modes are left out. Raises `ModelError` for a group that the mesh does not have, and for a
    condition that moves no dof that is free.
    """
    owned = space.dofmap.index_map.size_local
    points = space.tabulate_dof_coordinates()[:owned] + np.array([0.0, 0.0, tagged.level])
    columns = [AXES.index(name[1:]) for name in components]
    free = numbering.local_row.reshape(owned, len(components)) >= 0
    fields = np.zeros((2, owned, len(components)))
    for number, condition in enumerate(given, start=1):
        nodes = _nodes(condition, number, tagged, space)
        pairs = (condition.displacement, condition.rotation), (condition.velocity, condition.spin)
        motions = np.stack([_motion(points[nodes], moved, turn)[:, columns] for moved, turn in pairs])
        moving = bool(np.any((motions != 0) & free[nodes]))
        if condition.moves and condition.mode is None and not any(tagged.mesh.comm.allgather(moving)):
            raise ModelError(f"initial[{number}].group", "moves nothing: none of its nodes is free to move so")
        fields[:, nodes] += motions
    return fields[0].ravel(), fields[1].ravel()


def _nodes(condition: InitialCondition, number: int, tagged: TaggedMesh, space: Space) -> np.ndarray:
    if not condition.group:
        return np.arange(space.dofmap.index_map.size_local)
    try:
        return np.unique(np.concatenate([nodes_of(tagged, space, name) for name in names_in(condition.group)]))
    except ModelError as error:
        raise ModelError(f"initial[{number}].group", error.message) from None


def _motion(points: np.ndarray, moved: tuple[float, ...], turn: Turn | None) -> np.ndarray:
    """Return translations and rotations (n, 6) of points (n, 3) m."""
    motion = np.zeros((len(points), len(AXES)))
    motion[:, :TRANSLATIONS] = moved
    if turn is not None:
        motion[:, :TRANSLATIONS] += turn.at(points)
        motion[:, TRANSLATIONS:] = turn.vector
    return motion
