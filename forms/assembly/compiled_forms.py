"""The compiled forms of a plate or shell: no other than its kinematics and loads need."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from types import SimpleNamespace
from typing import Any

import dolfinx.fem
import numpy as np
import ufl

from uplift.forms.contact.supports import AXES
from uplift.forms.parameters import PlateModel
from uplift.forms.shells import membrane, shell
from uplift.forms.shells.facets import Facet, common_normal, facet_of
from uplift.forms.shells.material import Material
from uplift.meshes.compat import Space, compile_form, piecewise_constant_space, vector_space
from uplift.meshes.tagged import TaggedMesh


@dataclass
class CompiledForms:
    """The compiled forms of a plate or shell: no other than its kinematics and loads need."""

    tagged: TaggedMesh
    kind: str
    degree: int
    components: tuple[str, ...]
    space: Space
    stiffness: Any
    mass: Any
    pressure: Any | None
    """Load vector of `value`, None where no pressure acts."""
    material: SimpleNamespace
    """Fields of the material, functions with one value a cell."""
    value: Any | None
    """Pressure along the normal of each cell, Pa."""

    @property
    def names(self) -> tuple[str, ...]:
        """What was compiled."""
        return ("stiffness", "mass") + (("pressure",) if self.pressure is not None else ())


def compile_plate(
    tagged: TaggedMesh,
    kind: str,
    degree: int,
    model: PlateModel,
    compiler: Callable[[Any], Any] = compile_form,
    *,
    rotary_inertia: bool = False,
) -> CompiledForms:
    """Compile what the kinematics `kind` of `uplift.forms.shells.kinematics` needs, for a displacement of `degree` (collective).

    Which loads need a form is read from `model`. All material constants are functions of the cell, so that other values and other groups
    need no new compilation.
    """
    mesh, constants = tagged.mesh, piecewise_constant_space(tagged.mesh)
    material = SimpleNamespace(**{field.name: dolfinx.fem.Function(constants) for field in fields(Material)})
    dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 2 * degree})
    value = dolfinx.fem.Function(constants) if model.pressures else None
    if kind == "plane stress":
        components: tuple[str, ...] = ("DX", "DY")
        space = vector_space(mesh, degree, 2)
        u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
        return CompiledForms(
            tagged, kind, degree, components, space,
            compiler(membrane.stiffness(u, v, material, dx)), compiler(membrane.mass(u, v, material, dx)), None, material, None,
        )
    facet = facet_of(mesh)
    layout = shell.shell_space(mesh, degree, _shell_components(tagged) if kind == "shell" else None)
    trial, test = ufl.TrialFunction(layout.space), ufl.TestFunction(layout.space)
    (u, theta), (v, psi) = layout.fields(trial), layout.fields(test)
    stiffness = _shell_stiffness(layout, facet, (u, theta), (v, psi), material, dx)
    mass = shell.mass(u, v, material, dx)
    if rotary_inertia:
        mass += shell.rotary_inertia(theta, psi, material, facet, dx)
    load = None if value is None else compiler(shell.pressure(value, v, facet, dx))
    return CompiledForms(
        tagged, kind, degree, layout.components, layout.space, compiler(stiffness), compiler(mass), load, material, value
    )


def _shell_components(tagged: TaggedMesh) -> tuple[str, ...]:
    """Return the components of a shell: a flat one whose normal is an axis does without the rotation about it."""
    normal = common_normal(tagged.mesh)
    if normal is None or np.max(np.abs(normal)) < 1 - 1e-12:
        return shell.COMPONENTS
    return tuple(name for name in shell.COMPONENTS if name != f"DR{AXES[int(np.argmax(np.abs(normal)))]}")


def _shell_stiffness(layout: shell.ShellSpace, facet: Facet, trial: Any, test: Any, material: Any, dx: Any) -> Any:
    (u, theta), (v, psi) = trial, test
    bent = shell.bending(theta, psi, material, facet, dx) + shell.shear(u, theta, v, psi, material, facet, dx, layout.degree)
    if layout.components == shell.PLATE_COMPONENTS:
        return bent
    whole = shell.membrane(u, v, material, facet, dx) + bent
    if len(layout.components) == len(shell.COMPONENTS):
        whole += shell.drilling(u, theta, v, psi, material, facet, dx)
    return whole
