"""The local frame of the flat facets of a shell, as UFL expressions of the cell, and the plane that a flat mesh lies in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl

from uplift.meshes.checked import ModelError
from uplift.meshes.compat import Mesh, geometry_cells

FLAT = 1e-9
"""Largest sine of the angle between two cells' normals in one plane; coordinates in a file of 12 digits stay below."""

CORNERS = {"triangle": 3, "quadrilateral": 4}


@dataclass(frozen=True)
class Facet:
    """The frame (t1, t2, n) of a facet: constant in a triangle, pointwise in a quadrilateral (which may be warped).

    In space, t1 follows the first edge of the cell and n = t1 x t2 its node order (right hand). In the plane,
    (t1, t2, n) are the axes X, Y, Z. All vectors are unit vectors with three components.
    """

    cell: str
    """"triangle" or "quadrilateral"."""
    diameter: Any
    """Longest distance between two corners of the cell, m."""
    jacobian: Any
    """Derivatives of the position by the reference coordinates, (gdim, 2) m."""
    directions: Any
    """t1 and t2 in the coordinates of the mesh, (2, gdim)."""
    tangents: Any
    """t1 and t2, (2, 3)."""
    normal: Any
    """n, (3,)."""

    def gradient(self, field: Any) -> Any:
        """Return the derivatives (3, 2) of the Cartesian components of `field` (3,) along t1 and t2."""
        return ufl.grad(field) * ufl.transpose(self.directions)

    def tilt(self, rotation: Any) -> Any:
        """Return the components (2,) along t1 and t2 of rotation x n: how far the tip of the normal moves."""
        return ufl.as_vector((ufl.dot(rotation, self.tangents[1, :]), -ufl.dot(rotation, self.tangents[0, :])))

    def side(self, axis: int) -> Any:
        """Return the derivative (3,) m of the position by the reference coordinate `axis`."""
        column = [self.jacobian[i, axis] for i in range(self.jacobian.ufl_shape[0])]
        return ufl.as_vector([*column, *[0] * (3 - len(column))])

    @property
    def size_squared(self) -> Any:
        """The square of the cell's size in m2, one number a cell: half that of its longest diagonal or side."""
        return self.diameter**2 / 2


def facet_of(mesh: Mesh) -> Facet:
    """Return the frame of the cells of a two-dimensional `mesh` in the plane or in space.

    Raises `ModelError` for cells with more nodes than corners: a facet is flat, whatever the degree of the displacement.
    """
    domain = mesh.ufl_domain()
    cell = mesh.topology.cell_type.name
    if geometry_cells(mesh).shape[1] != CORNERS[cell]:
        raise ModelError("mesh.file", "a plate that bends needs a mesh of the first order, with nodes at the corners of its cells alone")
    jacobian, diameter = ufl.Jacobian(domain), ufl.CellDiameter(domain)
    if mesh.geometry.dim == 2:
        axes = ufl.Identity(3)
        return Facet(cell, diameter, jacobian, ufl.Identity(2), ufl.as_matrix([[1, 0, 0], [0, 1, 0]]), axes[:, 2])
    first = jacobian[:, 0] / ufl.sqrt(ufl.dot(jacobian[:, 0], jacobian[:, 0]))
    across = ufl.cross(jacobian[:, 0], jacobian[:, 1])
    normal = across / ufl.sqrt(ufl.dot(across, across))
    second = ufl.cross(normal, first)
    tangents = ufl.as_matrix([[t[i] for i in range(3)] for t in (first, second)])
    return Facet(cell, diameter, jacobian, tangents, tangents, normal)


def common_normal(mesh: Mesh) -> np.ndarray | None:
    """Return the unit normal (3,) of the plane that all cells are parallel to, None where they fold (collective).

    Its largest component is positive. A flat mesh whose normal is an axis needs no rotation about that axis.
    """
    owned = mesh.topology.index_map(2).size_local
    corners = mesh.geometry.x[geometry_cells(mesh)[:owned, : CORNERS[mesh.topology.cell_type.name]]]
    edges = corners[:, 1:] - corners[:, :1]
    normals = np.concatenate([np.cross(edges[:, 0], edges[:, k]) for k in range(1, edges.shape[1])])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    first = [n for n in mesh.comm.allgather(normals[:1]) if len(n)][0][0]
    first = first * np.sign(first[np.argmax(np.abs(first))])
    bent = np.max(np.linalg.norm(np.cross(normals, first), axis=1), initial=0.0)
    return first if max(mesh.comm.allgather(bent)) <= FLAT else None
