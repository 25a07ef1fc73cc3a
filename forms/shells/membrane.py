"""Plane-stress membrane of a plate in its own plane: stiffness, consistent mass and body force, in UFL.

Trial first, test last in every inner product, so that the same forms compile for real and for complex scalars.
`material` is anything with the fields of `uplift.forms.shells.material.Material`; numbers or dolfinx constants.
"""

from __future__ import annotations

from typing import Any

import ufl


def strain(u: Any) -> Any:
    """Return the small strain tensor (2, 2) of the displacement `u`."""
    return ufl.sym(ufl.grad(u))


def membrane_force(u: Any, material: Any) -> Any:
    """Return the membrane force tensor (2, 2) in N/m, tension positive, by Hooke's law in plane stress."""
    stretch = material.young * material.thickness / (1 - material.poisson**2)
    eps = strain(u)
    return stretch * ((1 - material.poisson) * eps + material.poisson * ufl.tr(eps) * ufl.Identity(2))


def stiffness(u: Any, v: Any, material: Any, dx: Any) -> Any:
    """Return the virtual work of the membrane forces."""
    return ufl.inner(membrane_force(u, material), strain(v)) * dx


def mass(u: Any, v: Any, material: Any, dx: Any) -> Any:
    """Return the consistent mass."""
    return material.density * material.thickness * ufl.inner(u, v) * dx
