"""Labels of the rows of a system that do not depend on how the mesh is distributed: places, components, and dofs of joints."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from uplift.forms.assembly.numbering import Numbering
from uplift.meshes.compat import Space

CELLS = 2.0**40
"""Places are told apart on a grid of so many cells along the mesh's largest extent: far finer than any mesh, far coarser than round-off."""


def row_labels(space: Space, numbering: Numbering, extra_nodes: np.ndarray) -> np.ndarray:
    """Return integers (n_local, 5) that name this rank's rows: place (3), component, number (collective).

    `extra_nodes` are the local nodes that this rank's extra rows belong to, in the order of these rows. Rows of the space have the number
    0; extra rows of a node are numbered from 1, with component 0.
    """
    comm, block = numbering.comm, space.dofmap.index_map_bs
    nodes = np.asarray(space.tabulate_dof_coordinates())[: space.dofmap.index_map.size_local]
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    if len(nodes):
        low, high = nodes.min(axis=0), nodes.max(axis=0)
    comm.Allreduce(MPI.IN_PLACE, low, op=MPI.MIN)
    comm.Allreduce(MPI.IN_PLACE, high, op=MPI.MAX)
    # The offset is no fraction that a regular mesh would have, so that round-off does not move a node into the next cell.
    places = np.floor((nodes - low) * (CELLS / (high - low).max()) + 1 / np.pi).astype(np.int64)
    labels = np.zeros((numbering.n_local, 5), dtype=np.int64)
    dofs = np.flatnonzero(numbering.local_row >= 0)
    labels[numbering.local_row[dofs], :3] = places[dofs // block]
    labels[numbering.local_row[dofs], 3] = dofs % block
    seen: dict[int, int] = {}
    for number, node in enumerate(extra_nodes):
        seen[node] = seen.get(node, 0) + 1
        labels[numbering.extra_row(number)] = *places[node], 0, seen[node]
    return labels


def rigid_motions(labels: np.ndarray, components: tuple[str, ...] = ("DX", "DY")) -> np.ndarray:
    """Return the rigid motions (k, n_local) of the displacements DX, DY, DZ from labels (n_local, 5): translations, then rotations.

    Rows of joints are left at zero: a plate that moves rigidly on its joints strains them. Rotation dofs are not among what is known of.
    """
    place, plate = labels[:, :3] / CELLS - 0.5, labels[:, 4] == 0
    kind = np.where(plate, labels[:, 3], -1)
    rows = {name: kind == number for number, name in enumerate(components)}
    motions = []
    for axis in "XYZ":
        if f"D{axis}" in rows:
            motions.append(rows[f"D{axis}"].astype(float))
    for about in range(3):
        one, two = (about + 1) % 3, (about + 2) % 3
        motion = np.zeros(len(labels))
        for along, arm in ((two, place[:, one]), (one, -place[:, two])):
            if f"D{'XYZ'[along]}" in rows:
                motion += np.where(rows[f"D{'XYZ'[along]}"], arm, 0.0)
        if {f"D{'XYZ'[one]}", f"D{'XYZ'[two]}"} <= rows.keys():
            motions.append(motion)
    return np.array(motions)
