"""Section forces at points of cells, as weights on the dofs of each cell.

The strains are those of `uplift.forms.shells.shell` and `uplift.forms.shells.membrane`, written for many cells and points at once in any
axes (1, 2, n) of the plate, and with them N = t D(eps), M = t^3 / 12 D(kappa) and V = 5/6 G t gamma. They are taken where the element has
them best (Barlow, IJNME 10 (1976) 243): at degree^2 Gauss points of a quadrilateral, where its reduced shear is integrated, and at the 3
points of a triangle. A quadrilateral of degree 1 has its shear from the strains that MITC4 ties, the mean of those at its corners.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from uplift.forms.assembly.compiled_forms import CompiledForms
from uplift.forms.contact.supports import AXES, TRANSLATIONS
from uplift.forms.shells.shell import SHEAR_CORRECTION
from uplift.meshes.compat import geometry_cells

basix: Any = importlib.import_module("basix")

MEMBRANE, MOMENTS, SHEARS = ("N11", "N22", "N12"), ("M11", "M22", "M12"), ("V1", "V2")

UNITS = {"N": "N/m", "M": "N m/m", "V": "N/m"}
"""By the first letter of a component."""

NODES = {("triangle", 3): 1, ("triangle", 6): 2, ("quadrilateral", 4): 1, ("quadrilateral", 9): 2}
"""Order of the geometry of a cell by its nodes."""

CORNERS = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)])
"""Of the reference square."""


def names_of(kind: str) -> tuple[str, ...]:
    """Return the components of the section forces under the kinematics `kind`."""
    return {"plane stress": MEMBRANE, "bending": MOMENTS + SHEARS}.get(kind, MEMBRANE + MOMENTS + SHEARS)


class SectionForces:
    """The section forces of a plate, at the points of its cells at which they are best."""

    def __init__(self, compiled: CompiledForms) -> None:
        """Take the compiled forms, whose material functions must have their values when `rows` is called."""
        mesh, self.compiled = compiled.tagged.mesh, compiled
        cell = mesh.topology.cell_name()
        self.names = names_of(compiled.kind)
        self._tied = compiled.degree == 1 and compiled.kind != "plane stress"
        self.points = _points(cell, compiled.degree)
        """(n_points, 2): in the reference cell."""
        self._cells, self._x = geometry_cells(mesh), mesh.geometry.x
        self._shape = _element(cell, compiled.degree)
        self._geometry = _element(cell, NODES[cell, self._cells.shape[1]])
        self._flat = mesh.geometry.dim == 2

    def positions(self, cells: np.ndarray) -> np.ndarray:
        """Return where the points of some cells lie, (n_cells, n_points, 3) m."""
        return np.einsum("qk,ckx->cqx", self._geometry.tabulate(0, self.points)[0, :, :, 0], self._x[self._cells[cells]])

    def normals(self, cells: np.ndarray) -> np.ndarray:
        """Return the normals of some cells at their points, (n_cells, n_points, 3): of pressure, in the plane the axis Z."""
        return self._normals(self._tangents(cells, self.points))

    def _tangents(self, cells: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the derivatives of the position by the reference coordinates, (n_cells, n_points, 3, 2) m."""
        slopes = self._geometry.tabulate(1, points)[1:, :, :, 0]
        return np.einsum("aqk,ckx->cqxa", slopes, self._x[self._cells[cells]])

    def _normals(self, tangents: np.ndarray) -> np.ndarray:
        across = np.cross(tangents[..., 0], tangents[..., 1])
        if self._flat:
            across = np.zeros_like(across) + np.array([0.0, 0.0, 1.0])
        normals: np.ndarray = across / np.linalg.norm(across, axis=-1, keepdims=True)
        return normals

    def rows(self, cells: np.ndarray, first: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return the weights (n_cells, n_points, n_components, n_nodes, n_block) on the dofs of each cell.

        `first` (n_cells, n_points, 3) is axis 1 and `normals`, in the same shape, the normal that moments and shear forces are meant for.
        """
        second = np.cross(normals, first)
        tangents = self._tangents(cells, self.points)
        gradients = self._gradients(tangents, self.points, (first, second))
        values = self._shape.tabulate(0, self.points)[0, :, :, 0]
        parts = []
        if MEMBRANE[0] in self.names:
            parts.append(self._stretch(cells, gradients, (first, second)))
        if MOMENTS[0] in self.names:
            parts.append(self._bending(cells, gradients, (first, second)))
            if self._tied:
                slip = self._tied_shear(cells, (first, second), normals)
            else:
                slip = self._slip(gradients, np.broadcast_to(values, (len(cells), *values.shape)), (first, second), normals)
            parts.append(self._value("shear", cells) * slip)
        return np.concatenate(parts, axis=2)

    def _gradients(self, tangents: np.ndarray, points: np.ndarray, along: tuple[np.ndarray, ...]) -> np.ndarray:
        """Return the derivatives of the shape functions along unit vectors, (n_along, n_cells, n_points, n_nodes) 1/m."""
        slopes = self._shape.tabulate(1, points)[1:, :, :, 0]
        dual = _dual(tangents)
        return np.stack([np.einsum("cqx,cqxa,aqk->cqk", direction, dual, slopes) for direction in along])

    def _value(self, name: str, cells: np.ndarray) -> np.ndarray:
        """Return a rigidity of some cells, (n_cells, 1, 1, 1, 1)."""
        young, poisson, t = (np.real(getattr(self.compiled.material, key).x.array[cells]) for key in ("young", "poisson", "thickness"))
        plane = young / (1 - poisson**2)
        values = {"poisson": poisson, "stretch": plane * t, "bending": plane * t**3 / 12,
                  "shear": SHEAR_CORRECTION * young * t / (2 * (1 + poisson))}
        return values[name].reshape(-1, 1, 1, 1, 1)

    def _components(self) -> list[tuple[int, int]]:
        """Return column and axis of the components of a node."""
        return [(column, AXES.index(name[1:])) for column, name in enumerate(self.compiled.components)]

    def _law(self, strain: np.ndarray, cells: np.ndarray, rigidity: str) -> np.ndarray:
        """Return the law of plane stress on strains whose axis 2 holds 11, 22 and 12 (half the angle)."""
        poisson = self._value("poisson", cells)
        one, two, both = strain[:, :, 0:1], strain[:, :, 1:2], strain[:, :, 2:3]
        whole = np.concatenate([one + poisson * two, two + poisson * one, (1 - poisson) * both], axis=2)
        return self._value(rigidity, cells) * whole

    def _stretch(self, cells: np.ndarray, gradients: np.ndarray, along: tuple[np.ndarray, ...]) -> np.ndarray:
        strain = np.zeros((*gradients.shape[1:3], 3, gradients.shape[3], len(self.compiled.components)))
        for column, axis in self._components():
            if axis < TRANSLATIONS:
                one, two = (direction[..., axis, None] for direction in along)
                strain[:, :, 0, :, column] = one * gradients[0]
                strain[:, :, 1, :, column] = two * gradients[1]
                strain[:, :, 2, :, column] = (one * gradients[1] + two * gradients[0]) / 2
        return self._law(strain, cells, "stretch")

    def _bending(self, cells: np.ndarray, gradients: np.ndarray, along: tuple[np.ndarray, ...]) -> np.ndarray:
        strain = np.zeros((*gradients.shape[1:3], 3, gradients.shape[3], len(self.compiled.components)))
        for column, axis in self._components():
            if axis >= TRANSLATIONS:
                one, two = (direction[..., axis - TRANSLATIONS, None] for direction in along)
                strain[:, :, 0, :, column] = two * gradients[0]
                strain[:, :, 1, :, column] = -one * gradients[1]
                strain[:, :, 2, :, column] = (two * gradients[1] - one * gradients[0]) / 2
        return self._law(strain, cells, "bending")

    def _slip(self, gradients: np.ndarray, values: np.ndarray, along: tuple[np.ndarray, ...], normals: np.ndarray) -> np.ndarray:
        """Return the transverse shear strains (n_cells, n_points, 2, n_nodes, n_block) along two directions."""
        strain = np.zeros((*gradients.shape[1:3], 2, gradients.shape[3], len(self.compiled.components)))
        for column, axis in self._components():
            if axis < TRANSLATIONS:
                strain[:, :, :, :, column] = np.moveaxis(normals[..., axis, None] * gradients, 0, 2)
            else:
                tilt = [direction[..., axis - TRANSLATIONS, None] * values for direction in (along[1], along[0])]
                strain[:, :, 0, :, column], strain[:, :, 1, :, column] = tilt[0], -tilt[1]
        return strain

    def _tied_shear(self, cells: np.ndarray, along: tuple[np.ndarray, ...], normals: np.ndarray) -> np.ndarray:
        """Return the mean over the corners of the shear strains of MITC4, along two directions of the middle."""
        tangents = self._tangents(cells, CORNERS)
        own, dual = self._normals(tangents), _dual(tangents)
        sign = np.sign(np.sum(own * normals[:, :1], axis=-1, keepdims=True))
        own = sign * own
        slopes = self._shape.tabulate(1, CORNERS)[1:, :, :, 0]
        n_nodes = slopes.shape[2]
        total = np.zeros((len(cells), 1, 2, n_nodes, len(self.compiled.components)))
        for q, corner in enumerate(CORNERS):
            for k in range(2):
                middle = corner.copy()
                middle[k] = 0.5
                values = self._shape.tabulate(0, middle[None])[0, 0, :, 0]
                turned = np.cross(own[:, q], tangents[:, q, :, k])
                covariant = np.zeros((len(cells), n_nodes, len(self.compiled.components)))
                for column, axis in self._components():
                    by = own[:, q, axis, None] * slopes[k, q] if axis < TRANSLATIONS else turned[:, axis - TRANSLATIONS, None] * values
                    covariant[:, :, column] = by
                for a, direction in enumerate(along):
                    weight = np.sum(direction[:, 0] * dual[:, q, :, k], axis=-1)
                    total[:, 0, a] += weight[:, None, None] * covariant / len(CORNERS)
        return total


def _dual(tangents: np.ndarray) -> np.ndarray:
    """Return the vectors (..., 3, 2) in the plane of the tangents (..., 3, 2) whose products with them are 0 and 1."""
    return tangents @ np.linalg.inv(np.swapaxes(tangents, -1, -2) @ tangents)


def _element(cell: str, degree: int) -> Any:
    return basix.create_element(basix.ElementFamily.P, getattr(basix.CellType, cell), degree, basix.LagrangeVariant.gll_warped)


def _points(cell: str, degree: int) -> np.ndarray:
    """Return the points of the reference cell at which section forces are best."""
    order = 2 * degree - 1 if cell == "quadrilateral" else min(2 * (degree - 1), 2)
    points: np.ndarray = basix.make_quadrature(getattr(basix.CellType, cell), max(order, 0))[0]
    return points
