"""Flat-facet Reissner-Mindlin shell: membrane, bending, transverse shear, drilling, mass and loads, in UFL.

Fields are Cartesian vectors (3,): displacement `u`, m, and rotation vector `theta`, rad, right-handed about X, Y, Z. A point
at height z over the mid-surface moves by u + z theta x n. Both are continuous, so that plates joined at any angle share
them. All components are Lagrange of one degree, the dofs at the same nodes; a plate in the plane XY that is only bent has
DZ, DRX and DRY alone.

Only the shear needs care, and what `shear` does depends on the degree:

- degree 2 (quadrilaterals) and 3 (both cells): the split of Arnold and Brezzi (Locking-free finite element methods for
  shells, Math. Comp. 66, 1997). A share c t2 / (h2 + c t2) of the shear energy is integrated in full, the rest at degree^2 Gauss points
  of a quadrilateral (Zienkiewicz, Taylor and Too, IJNME 3, 1971) or 3 of a triangle. In a thin plate the full share is as
  soft as bending, so it cannot lock, and it leaves no mechanism.
- degree 1 (quadrilaterals): MITC4 (Bathe and Dvorkin, IJNME 21, 1985), covariant shear strains tied at the middles of the sides.

Trial first, test last in every inner product, so that the same forms compile for real and for complex scalars.
`material` is anything with the fields of `uplift.forms.shells.material.Material`; numbers or dolfinx constants. `facet` is the mesh's
`Facet`; `dx` bears the domain and integrates polynomials of twice the degree. Forces are per unit length of a cut.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ufl

from uplift.forms.parameters import CONDITIONS
from uplift.forms.shells.facets import Facet
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import Mesh, Space, vector_space

COMPONENTS = ("DX", "DY", "DZ", "DRX", "DRY", "DRZ")
"""Components of a shell: displacements, then rotations about the axes."""

PLATE_COMPONENTS = ("DZ", "DRX", "DRY")
"""Components of a plate in the plane XY that is bent and not stretched."""

SHEAR_CORRECTION = 5 / 6

FULL_SHEAR = {("triangle", 3): 15.0, ("quadrilateral", 2): 1.0, ("quadrilateral", 3): 5.0}
"""c, the weight of the fully integrated shear, by cell and degree.

Less leaves a thin plate softer under point loads and along free edges, more stiffens short waves: figures in
drivers/evidence/reference/benchmarks.csv.
"""

DRILLING = 1.0
"""Stiffness against rotation about the normal as a share of G t.

From 1e-2 to 1 it moves the Scordelis-Lo roof by 0.2 %. With less the facets of a curved shell untwist: 1 % too soft with 1e-3, 6 %
with 1e-5.
"""

@dataclass(frozen=True)
class ShellSpace:
    """The function space of a shell and the names of its components, blocked by node."""

    space: Space
    components: tuple[str, ...]
    degree: int

    def fields(self, argument: Any) -> tuple[Any, Any]:
        """Return displacement (3,) and rotation vector (3,) of a function or argument of the space."""
        at = {name: argument[i] for i, name in enumerate(self.components)}
        return tuple(ufl.as_vector([at.get(name, 0) for name in names]) for names in (COMPONENTS[:3], COMPONENTS[3:]))


def shell_space(mesh: Mesh, degree: int, components: tuple[str, ...] | None = None) -> ShellSpace:
    """Return the space of `components`; without them of `COMPONENTS` on a mesh in space, of `PLATE_COMPONENTS` on a mesh in the plane.

    Raises `ModelError` for a degree that its cells do not have: 1 to 3 on quadrilaterals, 3 on triangles.
    """
    cell = mesh.topology.cell_type.name
    if degree != 1 and (cell, degree) not in FULL_SHEAR or (cell, degree) == ("triangle", 1):
        raise ModelError("mesh.degree", f"a shell of {cell}s has degree {'3' if cell == 'triangle' else '1 to 3'}, not {degree}")
    components = components or (COMPONENTS if mesh.geometry.dim == 3 else PLATE_COMPONENTS)
    return ShellSpace(vector_space(mesh, degree, len(components)), components, degree)


def edge_components(condition: str, normal: int, along: int) -> tuple[str, ...]:
    """Return the components that are zero on an edge of a plate; `normal` and `along` are axes 0 to 2 of plate and edge.

    clamped: all. hard, soft: simply supported, no deflection along the normal of the plate; hard also no rotation about
    the in-plane normal of the edge. sliding: the slope is kept, no rotation about the edge. symmetric: the mirror is the
    plane through the edge along the plate's normal. Raises `ModelError` for another condition or if the axes are the same.
    """
    if condition not in CONDITIONS:
        raise ModelError("", f"no edge condition {condition!r} (there are: {', '.join(CONDITIONS)})")
    if normal == along:
        raise ModelError("", "an edge cannot run along the normal of its plate")
    across = 3 - normal - along
    moves, turns = COMPONENTS[:3], COMPONENTS[3:]
    return {
        "clamped": COMPONENTS,
        "hard": (moves[normal], turns[across]),
        "soft": (moves[normal],),
        "sliding": (turns[along],),
        "symmetric": (moves[across], turns[along], turns[normal]),
    }[condition]


def membrane_strain(u: Any, facet: Facet) -> Any:
    """Return the strain (2, 2) of the mid-surface along t1 and t2."""
    return ufl.sym(facet.tangents * facet.gradient(u))


def curvature(theta: Any, facet: Facet) -> Any:
    """Return the curvature (2, 2) in 1/m: the strain at height z is the membrane strain plus z times this."""
    slope = facet.tangents * facet.gradient(theta)
    return ufl.sym(ufl.as_matrix([[slope[1, 0], slope[1, 1]], [-slope[0, 0], -slope[0, 1]]]))


def shear_strain(u: Any, theta: Any, facet: Facet) -> Any:
    """Return the transverse shear strain (2,) along t1 and t2: slope of the mid-surface plus tilt of the normal."""
    return ufl.dot(facet.normal, facet.gradient(u)) + facet.tilt(theta)


def drilling_strain(u: Any, theta: Any, facet: Facet) -> Any:
    """Return the rotation of the mid-surface in its plane less that of the field `theta` about the normal, rad."""
    slope = facet.tangents * facet.gradient(u)
    return (slope[1, 0] - slope[0, 1]) / 2 - ufl.dot(theta, facet.normal)


def _plane_stress(strain: Any, material: Any) -> Any:
    return material.young / (1 - material.poisson**2) * (
        (1 - material.poisson) * strain + material.poisson * ufl.tr(strain) * ufl.Identity(2)
    )


def membrane_force(u: Any, material: Any, facet: Facet) -> Any:
    """Return the membrane forces (2, 2) in N/m along t1 and t2, tension positive."""
    return material.thickness * _plane_stress(membrane_strain(u, facet), material)


def moment(theta: Any, material: Any, facet: Facet) -> Any:
    """Return the bending moments (2, 2) in Nm/m along t1 and t2; a positive one stretches the side that n points to."""
    return material.thickness**3 / 12 * _plane_stress(curvature(theta, facet), material)


def shear_rigidity(material: Any) -> Any:
    """Return G t in N/m."""
    return material.young * material.thickness / (2 * (1 + material.poisson))


def membrane(u: Any, v: Any, material: Any, facet: Facet, dx: Any) -> Any:
    """Return the virtual work of the membrane forces."""
    return ufl.inner(membrane_force(u, material, facet), membrane_strain(v, facet)) * dx


def bending(theta: Any, psi: Any, material: Any, facet: Facet, dx: Any) -> Any:
    """Return the virtual work of the moments."""
    return ufl.inner(moment(theta, material, facet), curvature(psi, facet)) * dx


def shear(u: Any, theta: Any, v: Any, psi: Any, material: Any, facet: Facet, dx: Any, degree: int) -> Any:
    """Return the virtual work of the transverse shear forces of fields of `degree`, free of locking.

    Displacement and rotation converge with order 2 at least in the L2 norm, whatever the thickness; with degree + 1 as long
    as the cells are not larger than the thickness. Two fields, their two test fields, material, geometry, measure and degree are eight
    parameters: forms take what they integrate one by one, trial first.
    """
    rigidity = SHEAR_CORRECTION * shear_rigidity(material)
    if degree == 1:
        metric = ufl.inv(ufl.transpose(facet.jacobian) * facet.jacobian)
        return sum(
            rigidity * ufl.inner(metric * _tied(u, theta, facet, corner), _tied(v, psi, facet, corner)) * dx(metadata=_at(corner))
            for corner in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0))
        )
    thin = FULL_SHEAR[facet.cell, degree] * material.thickness**2
    full = thin / (facet.size_squared + thin)
    work = full * rigidity * ufl.inner(shear_strain(u, theta, facet), shear_strain(v, psi, facet)) * dx
    points = dx(metadata={"quadrature_degree": 2 if facet.cell == "triangle" else 2 * degree - 1})
    return work + (1 - full) * rigidity * ufl.inner(shear_strain(u, theta, facet), shear_strain(v, psi, facet)) * points


def _tied(u: Any, theta: Any, facet: Facet, corner: tuple[float, float]) -> Any:
    """Return the covariant assumed shear strain (2,) m of MITC4 at a corner, given by its reference coordinates.

    A component is constant along its own coordinate line: its value at a corner is that at the middle of the side there.
    """
    strain = []
    for axis in range(2):
        along = facet.jacobian[:, axis]
        middle = theta + (0.5 - corner[axis]) * ufl.dot(ufl.grad(theta), along)
        slope = ufl.dot(facet.normal, ufl.dot(ufl.grad(u), along))
        strain.append(slope + ufl.dot(middle, ufl.cross(facet.normal, facet.side(axis))))
    return ufl.as_vector(strain)


def _at(corner: tuple[float, float]) -> dict[str, Any]:
    """Return the metadata of a quadrature at one corner of the reference square, which weighs a quarter of it.

    The middle of the cell, of no weight, keeps ffcx from sharing what it takes for constants between rules of one point.
    """
    points, weights = (corner, (0.5, 0.5)), (0.25, 0.0)
    return {"quadrature_rule": "custom", "quadrature_degree": 1, "quadrature_points": points, "quadrature_weights": weights}


def drilling(u: Any, theta: Any, v: Any, psi: Any, material: Any, facet: Facet, dx: Any, share: Any = DRILLING) -> Any:
    """Return the virtual work that ties the rotation about the normal to that of the mid-surface, with stiffness share G t.

    After Hughes and Brezzi (On drilling degrees of freedom, CMAME 72, 1989), whose share is 1. Rigid motions cost nothing.
    A flat mesh normal to an axis needs neither this nor the rotation about that axis. The parameters are those of `shear`, with the share
    in place of the degree.
    """
    return share * shear_rigidity(material) * ufl.inner(drilling_strain(u, theta, facet), drilling_strain(v, psi, facet)) * dx


def mass(u: Any, v: Any, material: Any, dx: Any) -> Any:
    """Return the consistent mass of the displacement."""
    return material.density * material.thickness * ufl.inner(u, v) * dx


def rotary_inertia(theta: Any, psi: Any, material: Any, facet: Facet, dx: Any) -> Any:
    """Return the mass rho t3 / 12 of the tilt of the normal; the rotation about the normal has none."""
    return material.density * material.thickness**3 / 12 * ufl.inner(facet.tilt(theta), facet.tilt(psi)) * dx


def pressure(value: Any, v: Any, facet: Facet, dx: Any) -> Any:
    """Return the virtual work of the pressure `value` in Pa, positive along n (the side that n leaves is pressed)."""
    return ufl.inner(value * facet.normal, v) * dx
