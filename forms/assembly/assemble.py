"""From compiled forms and parameters to the operators of a plate or shell on springs and joints."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import dolfinx.fem
import numpy as np
from petsc4py import PETSc
from scipy import sparse

from uplift.forms.assembly.compiled_forms import CompiledForms
from uplift.forms.assembly.conditions import held_by_group
from uplift.forms.assembly.full_space import FullSpace
from uplift.forms.assembly.level import shifted
from uplift.forms.assembly.loads import Inertia, load_list
from uplift.forms.assembly.nodes import at_nodes
from uplift.forms.assembly.numbering import Numbering
from uplift.forms.assembly.outputs import lifted_area, probe_outputs
from uplift.forms.assembly.reactions import Reactions, moments_about, rigid_rows
from uplift.forms.assembly.row_labels import row_labels
from uplift.forms.assembly.unrestrained import free_motions
from uplift.forms.contact import joint_matrices
from uplift.forms.contact.placement import place
from uplift.forms.contact.supports import AXES, TRANSLATIONS
from uplift.forms.operators import Contacts, LiftedArea, Operators, OutputGroup, Outputs, elongation_group
from uplift.forms.parameters import PlateModel, Probe
from uplift.forms.shells.kinematics import up_of
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import Mat, Space, Vec
from uplift.meshes.tagged import TaggedMesh

if TYPE_CHECKING:
    from uplift.forms.recovery.force_field import ForceField


@dataclass(frozen=True)
class InternalForces:
    """What a model knows of its internal forces; nothing where it does not ask for any."""

    groups: tuple[OutputGroup, ...] = ()
    """Outputs "forces" at probes, "cuts" and "cuts damping"."""
    thickness: dict[str, float] = dataclasses.field(default_factory=dict)
    """Probe -> thickness in m of the plate there."""
    normals: dict[str, np.ndarray | None] = dataclasses.field(default_factory=dict)
    """Cut -> unit normal (3,) out of its side, None for a line that closes."""
    field: ForceField | None = None
    """Section forces all over the plate, where their envelopes are asked for."""


@dataclass
class AssembledPlate:
    """The operators of a plate and the way back from their rows to its displacement field."""

    operators: Operators
    space: Space
    numbering: Numbering
    kind: str
    components: tuple[str, ...]
    total_mass: float
    """kg, plate and point masses."""
    translations: dict[str, Vec]
    """Axis -> mass times a rigid translation by 1 m along it, PETSc vectors in kg, for the axes along which the plate can move."""
    lifted_area: LiftedArea
    joint_mass: float
    """kg, of the point masses of joints alone."""
    unrestrained: tuple[str, ...]
    """Rigid motions, in words, that nothing resists with all contacts closed."""
    model: PlateModel
    """The model with the points of whatever stands on a group of the mesh."""
    forces: InternalForces
    labels: np.ndarray
    """(n_local, 5) names of the rows that do not depend on the number of ranks (see `uplift.forms.assembly.row_labels`)."""
    moments_about: np.ndarray
    """(3,) m: the point about which the moments of the reactions are taken."""
    resultant_motions: Callable[[], np.ndarray]
    """Gives the rigid motions (k, n_local) that the resultants of the ground work on, joints unstrained."""

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


def assemble_plate(compiled: CompiledForms, model: PlateModel) -> AssembledPlate:
    """Assemble the operators (collective). Raises `ModelError` for what does not fit the mesh, named by its key."""
    level = compiled.tagged.level
    model = _spelled_out(compiled, shifted(model, -level))
    field = FullSpace(compiled, model)
    by_group = held_by_group(model.conditions, compiled.tagged, compiled.space, compiled.components, compiled.kind)
    held = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *by_group.values()]))
    placement = place(compiled.space, compiled.components, compiled.kind, model)
    placement.refuse_held(held, compiled.space.mesh.comm)
    numbering = Numbering(compiled.space, held, placement.n_extra)
    bonded, unilateral, extra_mass = joint_matrices.entries(placement, numbering)
    matrices = _full_matrices(field)
    no_entries = sparse.coo_matrix((numbering.n_local, numbering.n_local))
    stiffness, mass, *damping = numbering.matrices(matrices, [(bonded + unilateral).tocoo(), extra_mass, no_entries][: len(matrices)])
    inertia = Inertia(field, numbering, placement, matrices[1])
    loads, on_held = load_list(field, numbering, placement, inertia)
    field.say_what_is_doubtful()
    translations = {name[1:]: inertia.vector(AXES.index(name[1:])) for name in compiled.components if name[1:] in AXES[:TRANSLATIONS]}
    total_mass = inertia.total_mass()
    contacts, center = joint_matrices.contacts(placement, numbering), moments_about(compiled, model, by_group)
    reactions = Reactions(compiled, model, placement, numbering).groups(by_group, matrices, on_held, center)
    for matrix in matrices:
        matrix.destroy()
    forces = _internal_forces(field, numbering, model)
    groups = [probe_outputs(compiled, numbering, model), elongation_group(contacts), *reactions, *forces.groups]
    operators = Operators(
        stiffness=stiffness,
        mass=mass,
        damping=damping[0] if damping else None,
        loads=loads,
        contacts=_at_level(contacts, level),
        outputs=Outputs.of(groups, numbering.comm),
        comm=numbering.comm,
        bonded_springs=bonded,
        unilateral_springs=unilateral,
    )
    return AssembledPlate(
        operators,
        compiled.space,
        numbering,
        compiled.kind,
        compiled.components,
        total_mass,
        translations,
        lifted_area=lifted_area(compiled, field, numbering, up_of(model, compiled.kind)),
        joint_mass=sum(support.mass * float(support.factors.sum()) for support in model.supports),
        unrestrained=free_motions(compiled, model, held),
        model=shifted(model, level),
        forces=forces,
        labels=row_labels(compiled.space, numbering, placement.extra_nodes),
        moments_about=center + np.array([0.0, 0.0, level]),
        resultant_motions=lambda: rigid_rows(field, placement, numbering, center),
    )


def _at_level(contacts: Contacts, level: float) -> Contacts:
    """Return the contacts with their points (n_c, 3) at the height of the plate in m."""
    return replace(contacts, points=contacts.points + np.array([0.0, 0.0, level])) if level else contacts


def _internal_forces(field: FullSpace, numbering: Numbering, model: PlateModel) -> InternalForces:
    """Return the outputs of internal forces that the model asks for (collective)."""
    found = InternalForces()
    if any(probe.forces for probe in model.probes):
        from uplift.forms.recovery.probe_forces import probe_forces

        group, thickness = probe_forces(field, numbering, model)
        found = replace(found, groups=(group,), thickness=thickness)
    if model.cuts:
        from uplift.forms.recovery.cuts import cut_outputs

        cuts = cut_outputs(field, numbering, model)
        found = replace(found, groups=found.groups + cuts.groups, normals=cuts.normals)
    if model.envelopes:
        from uplift.forms.recovery.force_field import force_field

        found = replace(found, field=force_field(field, numbering))
    return found


def _spelled_out(compiled: CompiledForms, model: PlateModel) -> PlateModel:
    """Return the model with the points of whatever stands on a group of the mesh."""
    field = FullSpace(compiled, model)
    found: dict[str, Any] = {}
    for key in ("supports", "springs", "masses", "forces"):
        placed = []
        for group in getattr(model, key):
            try:
                placed.append(at_nodes(group, compiled.tagged, compiled.space, compiled.degree, field.area))
            except ModelError as error:
                where = f"{'load' if key == 'forces' else key}[{group.name}]"
                raise ModelError(f"{where}.{error.key or 'group'}", error.message) from None
        found[key] = tuple(placed)
    return replace(model, probes=tuple(_at_its_point(probe, compiled.tagged) for probe in model.probes), **found)


def _at_its_point(probe: Probe, tagged: TaggedMesh) -> Probe:
    """Return a probe with the coordinates of the point that it names."""
    if not isinstance(probe.point, str):
        return probe
    try:
        points = tagged.point(probe.point)
    except ModelError as error:
        raise ModelError(f"probes[{probe.name}].point", error.message) from None
    if len(points) > 1:
        raise ModelError(f"probes[{probe.name}].point", f"expected one point, the group {probe.point!r} holds {len(points)}")
    return replace(probe, point=tuple(points[0].tolist()))


def _full_matrices(field: FullSpace) -> list[Mat]:
    """Return stiffness and mass over all dofs of the space, and where a material is damped the damping; the caller destroys them."""
    field.set_material()
    stiffness, mass = field.matrix(field.compiled.stiffness), field.matrix(field.compiled.mass)
    if not any(material.alpha > 0 or material.beta > 0 for material in field.materials):
        return [stiffness, mass]
    return [stiffness, mass, _damping(field, stiffness, mass)]


def _damping(field: FullSpace, stiffness: Mat, mass: Mat) -> Mat:
    """Return alpha K + beta M, each material with its own alpha and beta (the stiffness is linear in E, the mass in rho)."""
    same = PETSc.Mat.Structure.SAME_NONZERO_PATTERN
    if len({(m.alpha, m.beta) for m in field.materials}) == 1:
        damping = stiffness.duplicate(copy=True)
        damping.scale(field.materials[0].alpha)
        damping.axpy(field.materials[0].beta, mass, structure=same)
        return damping
    field.set_material(young=lambda m: m.alpha, density=lambda m: m.beta)
    damping, weighted = field.matrix(field.compiled.stiffness), field.matrix(field.compiled.mass)
    damping.axpy(1.0, weighted, structure=same)
    weighted.destroy()
    return damping
