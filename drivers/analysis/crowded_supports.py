"""Supports and springs that stand on one node, or a hair apart, where their stiffnesses add."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.forms.assembly.points import in_words
from uplift.forms.contact.supports import Spring, Support
from uplift.meshes.findings import say
from uplift.meshes.tagged import extent_of

HAIR = 0.02
"""Of the size of a cell: nodes that are meant to be two are farther apart."""


def say_crowded_supports(assembly: AssembledScene) -> None:
    """Say where springs along one axis share a place (collective)."""
    model, mesh = assembly.plate.model, assembly.tagged.mesh
    groups: tuple[Support | Spring, ...] = (*model.supports, *model.springs)
    standing = [
        (f"{group.name}.{number}", point, np.array(group.stiffness) > 0)
        for group in groups for number, point in enumerate(group.points, start=1)
    ]
    cell = extent_of(mesh.geometry.x, mesh.comm) / np.sqrt(mesh.topology.index_map(2).size_global)
    if len(standing) < 2:
        return
    points = np.array([point for _, point, _ in standing], dtype=float)
    pairs = sorted(cKDTree(points).query_pairs(HAIR * cell))
    shared = [(one, other) for one, other in pairs if np.any(standing[one][2] & standing[other][2])]
    if shared:
        one, other = shared[0]
        apart = float(np.linalg.norm(points[one] - points[other]))
        where = "stand on one node" if apart < 1e-9 * cell else f"stand {apart:.2g} m apart"
        count = len({k for pair in shared for k in pair})
        say("crowded supports", f"{count} supports or springs share a place with another along one axis: "
            f"{standing[one][0]} and {standing[other][0]} {where} at {in_words(points[one])}: their stiffnesses add")
