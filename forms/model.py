"""A plate or shell on springs and joints: from a tagged mesh and its parameters to the operators of the model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from types import SimpleNamespace
from typing import Any

import dolfinx.fem
import numpy as np
import ufl
from dolfinx.fem.petsc import assemble_matrix, assemble_vector
from petsc4py import PETSc
from scipy import sparse

from forms import membrane, shell
from forms.conditions import held_dofs
from forms.facets import Facet, common_normal, facet_of
from forms.joints import Joints, rigid_value
from forms.kinematics import up_of
from forms.labels import row_labels
from forms.material import Material
from forms.nodes import at_nodes
from forms.numbering import Numbering
from forms.operators import Functionals, LiftedArea, Load, Operators
from forms.parameters import Force, Part, PlateModel, Pressure
from forms.points import interpolation, owned_nodes
from forms.rigid import free_motions
from forms.signals import Constant
from forms.supports import AXES, TRANSLATIONS
from meshes.checked import ModelError
from meshes.releases import compile_form, piecewise_constant_space, vector_space
from meshes.tagged import TaggedMesh


@dataclass
class CompiledForms:
    """The compiled forms of a plate or shell: no other than its kinematics and loads need."""

    tagged: TaggedMesh
    kind: str
    degree: int
    components: tuple[str, ...]
    space: Any
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
    loose: tuple[str, ...]
    """Rigid motions, in words, that nothing resists with all contacts closed."""
    model: PlateModel
    """The model with the points of whatever stands on a group of the mesh."""
    labels: np.ndarray
    """(n_local, 5) names of the rows that do not depend on the number of ranks (see `forms.labels`)."""

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


def compile_plate(
    tagged: TaggedMesh,
    kind: str,
    degree: int,
    compiler: Callable[[Any], Any] = compile_form,
    *,
    rotary_inertia: bool = False,
    pressure: bool = False,
) -> CompiledForms:
    """Compile what the kinematics `kind` of `forms.kinematics` needs, for a displacement of `degree` (collective).

    All material constants are functions of the cell, so that other values and other groups need no new compilation.
    """
    mesh, constants = tagged.mesh, piecewise_constant_space(tagged.mesh)
    material = SimpleNamespace(**{field.name: dolfinx.fem.Function(constants) for field in fields(Material)})
    dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 2 * degree})
    value = dolfinx.fem.Function(constants) if pressure else None
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


class _Field:
    """Matrices and vectors over all dofs of the space, before any dof is left out."""

    def __init__(self, forms: CompiledForms, model: PlateModel) -> None:
        self.forms = forms
        self.tagged = forms.tagged
        self._cells = {part.group: self._cells_of(part) for part in model.parts}
        self.materials = [model.material, *(part.material for part in model.parts)]
        self.model = model

    def _cells_of(self, part: Part) -> np.ndarray:
        try:
            return self.tagged.cells(part.group)
        except ModelError as error:
            raise ModelError(f"parts[{part.group}]", error.message) from None

    def set_material(self, **factors: Callable[[Material], float]) -> None:
        """Set every material function; `factors` name fields that are multiplied by a number of the material."""
        for field in fields(Material):
            function = getattr(self.forms.material, field.name)
            factor = factors.get(field.name, lambda _: 1.0)
            function.x.array[:] = getattr(self.model.material, field.name) * factor(self.model.material)
            for part in self.model.parts:
                function.x.array[self._cells[part.group]] = getattr(part.material, field.name) * factor(part.material)

    def matrix(self, form: Any) -> Any:
        """Assemble a matrix with the present material."""
        matrix = assemble_matrix(form)
        matrix.assemble()
        return matrix

    def area(self, group: str) -> np.ndarray:
        """Return the area (n_owned nodes,) in m2 of a group of cells that belongs to each node (collective)."""
        cells = self.tagged.cells(group)
        self.set_material()
        density, thickness = self.forms.material.density.x.array, self.forms.material.thickness.x.array
        inside = np.zeros(len(density))
        inside[cells] = 1.0
        density[:] = inside / thickness
        mass = self.matrix(self.forms.mass)
        ones, shares = mass.createVecRight(), mass.createVecLeft()
        block = len(self.forms.components)
        ones.array.reshape(-1, block)[:, 0] = 1.0
        mass.mult(ones, shares)
        area: np.ndarray = np.real(shares.array_r.reshape(-1, block)[:, 0]).copy()
        for thing in (mass, ones, shares):
            thing.destroy()
        return area

    def rigid(self, motion: int, center: np.ndarray) -> np.ndarray:
        """Return the rigid motion along or about an axis (n_field,) at the owned nodes."""
        owned = self.forms.space.dofmap.index_map.size_local
        at = self.forms.space.tabulate_dof_coordinates()[:owned]
        values = np.zeros((owned, len(self.forms.components)))
        for column, name in enumerate(self.forms.components):
            axis = AXES.index(name[1:])
            if axis >= TRANSLATIONS or motion < TRANSLATIONS:
                values[:, column] = rigid_value(at[0], axis, motion, center) if owned else 0.0
            else:
                turn = np.eye(3)[motion - TRANSLATIONS]
                values[:, column] = np.cross(turn, at - center)[:, axis]
        return values.ravel()

    def pressure(self, pressure: Pressure) -> np.ndarray:
        """Return the load vector (n_field,) of a pressure (collective)."""
        value = self.forms.value
        assert value is not None
        value.x.array[:] = 0.0 if pressure.group else pressure.value
        if pressure.group:
            value.x.array[self.tagged.cells(pressure.group)] = pressure.value
        vector = assemble_vector(self.forms.pressure)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        owned = self.forms.space.dofmap.index_map.size_local * len(self.forms.components)
        values: np.ndarray = vector.array_r[:owned].copy()
        vector.destroy()
        return values


def assemble_plate(forms: CompiledForms, model: PlateModel) -> AssembledPlate:
    """Assemble the operators (collective). Raises `ModelError` for what does not fit the mesh, named by its key."""
    field = _Field(forms, model)
    field.model = model = _spelled_out(forms, field, model)
    held = held_dofs(model.conditions, forms.tagged, forms.space, forms.components, forms.kind)
    joints = Joints(forms.space, forms.components, forms.kind, model)
    joints.refuse_held(held, forms.space.mesh.comm)
    numbering = Numbering(forms.space, held, joints.n_extra)
    bonded, unilateral, extra_mass = joints.matrices(numbering)
    field.set_material()
    matrices = [field.matrix(forms.stiffness), field.matrix(forms.mass)]
    extras = [(bonded + unilateral).tocoo(), extra_mass]
    damped = any(material.alpha > 0 or material.beta > 0 for material in field.materials)
    if damped:
        matrices.append(_damping(forms, field, matrices))
        extras.append(sparse.coo_matrix((numbering.n_local, numbering.n_local)))
    stiffness, mass, *rest = numbering.matrices(matrices, extras)
    inertia = _Inertia(field, numbering, joints, matrices[1])
    up = up_of(model, forms.kind)
    loads = _loads(forms, field, numbering, joints, inertia, model)
    translations = {name[1:]: inertia.vector(AXES.index(name[1:])) for name in forms.components if name[1:] in AXES[:TRANSLATIONS]}
    total_mass = inertia.total_mass()
    for matrix in matrices:
        matrix.destroy()
    operators = Operators(
        stiffness=stiffness,
        mass=mass,
        damping=rest[0] if damped else None,
        loads=loads,
        contacts=joints.contacts(numbering),
        probes=_probe_functionals(forms, numbering, model),
        comm=numbering.comm,
        bonded_springs=bonded,
        unilateral_springs=unilateral,
        reactions=joints.reactions(numbering),
    )
    area = _lifted_area(forms, field, numbering, up)
    joint_mass = sum(support.mass * float(support.factors.sum()) for support in model.supports)
    loose = free_motions(forms, model, held)
    labels = row_labels(forms.space, numbering, joints.extra_nodes)
    return AssembledPlate(
        operators, forms.space, numbering, forms.kind, forms.components, total_mass, translations, area, joint_mass, loose, model, labels
    )


def _spelled_out(forms: CompiledForms, field: _Field, model: PlateModel) -> PlateModel:
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


def _damping(forms: CompiledForms, field: _Field, matrices: list[Any]) -> Any:
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


class _Inertia:
    """The mass of the whole model times rigid motions of the base."""

    def __init__(self, field: _Field, numbering: Numbering, joints: Joints, mass: Any) -> None:
        self._field, self._numbering, self._joints, self._mass = field, numbering, joints, mass

    def _of_field(self, motion: int, center: np.ndarray) -> np.ndarray:
        moved, force = self._mass.createVecRight(), self._mass.createVecLeft()
        moved.array[:] = self._field.rigid(motion, center)
        self._mass.mult(moved, force)
        values: np.ndarray = np.real(force.array_r).copy()
        moved.destroy()
        force.destroy()
        return values

    def vector(self, motion: int, center: np.ndarray | None = None) -> Any:
        """Return the mass times the unit rigid motion along or about an axis through `center` (PETSc vector of the system)."""
        center = np.zeros(3) if center is None else center
        vector = self._numbering.vector(self._of_field(motion, center))
        vector.array[:] += self._joints.inertia(self._numbering, motion, center)
        return vector

    def total_mass(self) -> float:
        """Return the mass in kg of plate, joints and point masses, held nodes included (collective)."""
        axis = next(AXES.index(name[1:]) for name in self._field.forms.components)
        here = float(self._field.rigid(axis, np.zeros(3)) @ self._of_field(axis, np.zeros(3)))
        model = self._field.model
        points = sum(group.mass * float(group.factors.sum()) for groups in (model.supports, model.masses) for group in groups)
        return float(self._numbering.comm.allreduce(here)) + points


def _loads(
    forms: CompiledForms, field: _Field, numbering: Numbering, joints: Joints, inertia: _Inertia, model: PlateModel
) -> list[Load]:
    loads = []
    if model.gravity != 0:
        vector = inertia.vector(up_of(model, forms.kind))
        vector.scale(-model.gravity)
        loads.append(Load("gravity", vector, Constant(1.0), static=True))
    for motion in model.motions:
        total = numbering.vector()
        for axis, value in enumerate(motion.direction):
            if value != 0:
                part = inertia.vector(axis, np.array(motion.center))
                total.axpy(-value, part)
                part.destroy()
        loads.append(Load("ground motion", total, motion.signal))
    for force in model.forces:
        vector = _force_vector(force, forms, numbering, joints)
        loads.append(Load(force.name, vector, force.signal or Constant(1.0), static=force.signal is None))
    for pressure in model.pressures:
        try:
            vector = numbering.vector(field.pressure(pressure))
        except ModelError as error:
            raise ModelError(f"load[{pressure.name}].group", error.message) from None
        loads.append(Load(pressure.name, vector, pressure.signal or Constant(1.0), static=pressure.signal is None))
    if joints.settles:
        loads.append(Load("gaps and preloads", numbering.vector(), Constant(1.0), static=True, internal=True))
        loads[-1].vector.array[:] = joints.settlement_load(numbering)
    return loads


def _force_vector(force: Force, forms: CompiledForms, numbering: Numbering, joints: Joints) -> Any:
    try:
        nodes = owned_nodes(forms.space, np.asarray(force.points, dtype=float).reshape(-1, 3), force.name)
    except ModelError as error:
        raise ModelError(f"load[{force.name}].points", error.message) from None
    for axis in np.flatnonzero(force.components):
        if axis not in joints.column:
            raise ModelError(f"load[{force.name}].force", f"the kinematics {forms.kind!r} has nothing along {AXES[axis]}")
    values = np.zeros(numbering.n_field)
    for node, share in zip(nodes, force.factors, strict=True):
        for axis, value in enumerate(force.components):
            if node >= 0 and value != 0:
                values[joints.dof(int(node), axis)] += share * value
    return numbering.vector(values)


def _lifted_area(forms: CompiledForms, field: _Field, numbering: Numbering, up: int) -> LiftedArea:
    """Return the shares of the area that belong to the vertical displacements of the nodes."""
    model, name = field.model, f"D{AXES[up]}"
    if name not in forms.components:
        return LiftedArea(np.zeros(0, dtype=int), np.zeros(0), numbering.comm)
    surfaces = [n for n, (d, _) in forms.tagged.groups.items() if d == 2]
    groups = [model.uplift_group] if model.uplift_group else surfaces
    try:
        weights = np.sum([field.area(group) for group in groups], axis=0)
    except ModelError as error:
        raise ModelError("output.uplift_group", error.message) from None
    rows = numbering.local_row[forms.components.index(name) :: len(forms.components)]
    total = numbering.comm.allreduce(float(weights.sum()))
    return LiftedArea(rows[rows >= 0], weights[rows >= 0] / total, numbering.comm)


def _probe_functionals(forms: CompiledForms, numbering: Numbering, model: PlateModel) -> Functionals:
    names: list[str] = []
    rows: list[int] = []
    columns: list[int] = []
    weights: list[float] = []
    block = len(forms.components)
    for probe in model.probes:
        try:
            nodes, shape = interpolation(forms.space, np.asarray(probe.point), f"probe {probe.name}")
        except ModelError as error:
            raise ModelError("probes", error.message) from None
        for column, component in enumerate(forms.components):
            if component[1:] not in AXES[:TRANSLATIONS] and not probe.rotations:
                continue
            local = numbering.local_row[block * nodes + column]
            free = local >= 0
            rows += [len(names)] * int(free.sum())
            columns += list(local[free])
            weights += list(shape[free])
            names.append(f"{probe.name}.{component}")
    local_rows = sparse.csr_matrix((weights, (rows, columns)), shape=(len(names), numbering.n_local))
    return Functionals(tuple(names), local_rows, numbering.comm)
