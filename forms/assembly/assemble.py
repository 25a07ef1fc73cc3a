"""From compiled forms and parameters to the operators of a plate or shell on springs and joints."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import dolfinx.fem
import numpy as np
from petsc4py import PETSc
from scipy import sparse

from uplift.forms.assembly.compiled_forms import CompiledForms
from uplift.forms.assembly.conditions import held_dofs
from uplift.forms.assembly.full_space import FullSpace
from uplift.forms.assembly.loads import Inertia, load_list
from uplift.forms.assembly.nodes import at_nodes
from uplift.forms.assembly.numbering import Numbering
from uplift.forms.assembly.outputs import lifted_area, probe_functionals
from uplift.forms.assembly.row_labels import row_labels
from uplift.forms.assembly.unrestrained import free_motions
from uplift.forms.contact import joint_matrices
from uplift.forms.contact.placement import place
from uplift.forms.contact.rigid_motions import foot_middle
from uplift.forms.contact.supports import AXES, TRANSLATIONS
from uplift.forms.operators import LiftedArea, Operators
from uplift.forms.parameters import PlateModel
from uplift.forms.shells.kinematics import up_of
from uplift.meshes.checked import ModelError


@dataclass
class AssembledPlate:
    """The operators of a plate and the way back from their rows to its displacement field."""

    operators: Operators
    space: Any
    numbering: Numbering
    kind: str
    components: tuple[str, ...]
    total_mass: float
    """kg, plate and point masses."""
    translations: dict[str, Any]
    """Axis -> mass times a rigid translation by 1 m along it, PETSc vectors in kg, for the axes along which the plate can move."""
    lifted_area: LiftedArea
    joint_mass: float
    """kg, of the point masses of joints alone."""
    unrestrained: tuple[str, ...]
    """Rigid motions, in words, that nothing resists with all contacts closed."""
    model: PlateModel
    """The model with the points of whatever stands on a group of the mesh."""
    labels: np.ndarray
    """(n_local, 5) names of the rows that do not depend on the number of ranks (see `uplift.forms.assembly.row_labels`)."""

    def __enter__(self) -> AssembledPlate:
        """Return itself."""
        return self

    def __exit__(self, *args: object) -> None:
        """Destroy the operators and vectors."""
        self.operators.__exit__(*args)
        for vector in self.translations.values():
            vector.destroy()

    def displacement(self, values: np.ndarray) -> np.ndarray:
        """Return the nodal displacements (owned and ghost nodes, 3) m from this rank's part of a solution (collective)."""
        u = dolfinx.fem.Function(self.space)
        u.x.array[: self.numbering.n_field] = self.numbering.field(values)
        u.x.scatter_forward()
        nodal = np.real(u.x.array).reshape(-1, len(self.components))
        moved = np.zeros((len(nodal), TRANSLATIONS))
        for column, name in enumerate(self.components):
            if name[1:] in AXES[:TRANSLATIONS]:
                moved[:, AXES.index(name[1:])] = nodal[:, column]
        return moved


def assemble_plate(forms: CompiledForms, model: PlateModel) -> AssembledPlate:
    """Assemble the operators (collective). Raises `ModelError` for what does not fit the mesh, named by its key."""
    field = FullSpace(forms, model)
    field.model = model = _spelled_out(forms, field, model)
    held = held_dofs(model.conditions, forms.tagged, forms.space, forms.components, forms.kind)
    placement = place(forms.space, forms.components, forms.kind, model)
    placement.refuse_held(held, forms.space.mesh.comm)
    numbering = Numbering(forms.space, held, placement.n_extra)
    bonded, unilateral, extra_mass = joint_matrices.entries(placement, numbering)
    field.set_material()
    matrices = [field.matrix(forms.stiffness), field.matrix(forms.mass)]
    extras = [(bonded + unilateral).tocoo(), extra_mass]
    damped = any(material.alpha > 0 or material.beta > 0 for material in field.materials)
    if damped:
        matrices.append(_damping(forms, field, matrices))
        extras.append(sparse.coo_matrix((numbering.n_local, numbering.n_local)))
    stiffness, mass, *rest = numbering.matrices(matrices, extras)
    inertia = Inertia(field, numbering, placement, matrices[1])
    up = up_of(model, forms.kind)
    loads = load_list(forms, field, numbering, placement, inertia, model)
    translations = {name[1:]: inertia.vector(AXES.index(name[1:])) for name in forms.components if name[1:] in AXES[:TRANSLATIONS]}
    total_mass = inertia.total_mass()
    for matrix in matrices:
        matrix.destroy()
    operators = Operators(
        stiffness=stiffness,
        mass=mass,
        damping=rest[0] if damped else None,
        loads=loads,
        contacts=joint_matrices.contacts(placement, numbering),
        probes=probe_functionals(forms, numbering, model),
        comm=numbering.comm,
        bonded_springs=bonded,
        unilateral_springs=unilateral,
        reactions=joint_matrices.reactions(placement, numbering, forms.kind, foot_middle(model)),
    )
    area = lifted_area(forms, field, numbering, up)
    joint_mass = sum(support.mass * float(support.factors.sum()) for support in model.supports)
    unrestrained = free_motions(forms, model, held)
    labels = row_labels(forms.space, numbering, placement.extra_nodes)
    return AssembledPlate(
        operators, forms.space, numbering, forms.kind, forms.components, total_mass, translations, area, joint_mass, unrestrained,
        model, labels,
    )


def _spelled_out(forms: CompiledForms, field: FullSpace, model: PlateModel) -> PlateModel:
    """Return the model with the points of whatever stands on a group of the mesh."""
    found: dict[str, Any] = {}
    for key in ("supports", "springs", "masses", "forces"):
        placed = []
        for group in getattr(model, key):
            try:
                placed.append(at_nodes(group, forms.tagged, forms.space, forms.degree, field.area))
            except ModelError as error:
                where = f"{'load' if key == 'forces' else key}[{group.name}]"
                raise ModelError(f"{where}.{error.key or 'group'}", error.message) from None
        found[key] = tuple(placed)
    return replace(model, **found)


def _damping(forms: CompiledForms, field: FullSpace, matrices: list[Any]) -> Any:
    """Return alpha K + beta M, each material with its own alpha and beta (the stiffness is linear in E, the mass in rho)."""
    alphas, betas = ({getattr(m, name) for m in field.materials} for name in ("alpha", "beta"))
    if len(alphas) == 1 and len(betas) == 1:
        damping = matrices[0].duplicate(copy=True)
        damping.scale(alphas.pop())
        mass, beta = matrices[1], betas.pop()
    else:
        field.set_material(young=lambda m: m.alpha, density=lambda m: m.beta)
        damping, mass, beta = field.matrix(forms.stiffness), field.matrix(forms.mass), 1.0
    damping.axpy(beta, mass, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    if mass is not matrices[1]:
        mass.destroy()
    return damping
