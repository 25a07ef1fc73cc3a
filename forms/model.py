"""A plane-stress plate on springs and joints: from a tagged mesh and its parameters to the operators of the model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from types import SimpleNamespace
from typing import Any

import dolfinx.fem
import numpy as np
import ufl
from dolfinx.fem.petsc import assemble_matrix, assemble_vector
from petsc4py import PETSc
from scipy import sparse

from forms import membrane
from forms.material import Material
from forms.numbering import Numbering
from forms.operators import Contacts, Functionals, Load, Operators
from forms.parameters import PlateModel, Probe
from forms.points import interpolation, owned_nodes
from forms.signals import Constant
from forms.supports import AXES, Spring, Support, joint_term
from forms.uplift import CompressionOnly
from meshes.checked import ModelError
from meshes.releases import compile_form, vector_space
from meshes.tagged import TaggedMesh


@dataclass
class CompiledForms:
    """The compiled forms of a plate; `direction` is the unit acceleration (2,) that the inertia form is assembled for."""

    space: Any
    stiffness: Any
    mass: Any
    inertia: Any
    direction: Any


@dataclass
class AssembledPlate:
    """The operators of a plate and the way back from their rows to its displacement field."""

    operators: Operators
    space: Any
    numbering: Numbering
    total_mass: float
    """kg, plate and point masses."""
    joint_mass: float
    """kg, of the point masses alone."""

    def displacement(self, values: np.ndarray) -> np.ndarray:
        """Return the nodal displacements (owned and ghost nodes, 2) m from this rank's part of a solution (collective)."""
        u = dolfinx.fem.Function(self.space)
        u.x.array[: self.numbering.n_field] = self.numbering.field(values)
        u.x.scatter_forward()
        return np.real(u.x.array).reshape(-1, 2).copy()


def as_constants(material: Material, mesh: Any) -> Any:
    """Return the material's numbers as constants of `mesh`, so that another value needs no new compilation."""
    values = {field.name: getattr(material, field.name) for field in fields(material)}
    return SimpleNamespace(**{n: dolfinx.fem.Constant(mesh, PETSc.ScalarType(v)) for n, v in values.items()})


def compile_plate(
    tagged: TaggedMesh, degree: int, material: Material, compiler: Callable[[Any], Any] = compile_form
) -> CompiledForms:
    """Compile stiffness, mass and inertia of a membrane of `degree`, integrated with degree + 1 Gauss points a direction."""
    space = vector_space(tagged.mesh, degree, 2)
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    constants = as_constants(material, tagged.mesh)
    direction = dolfinx.fem.Constant(tagged.mesh, np.zeros(2, dtype=PETSc.ScalarType))
    dx = ufl.Measure("dx", domain=tagged.mesh, metadata={"quadrature_degree": 2 * degree})
    return CompiledForms(
        space,
        compiler(membrane.stiffness(u, v, constants, dx)),
        compiler(membrane.mass(u, v, constants, dx)),
        compiler(membrane.inertia(direction, v, constants, dx)),
        direction,
    )


def assemble_plate(forms: CompiledForms, model: PlateModel) -> AssembledPlate:
    """Assemble the operators (collective). Raises `ModelError` for a support, spring or probe that does not fit the mesh."""
    joints = _Joints(forms.space, model)
    numbering = Numbering(forms.space, np.zeros(0, dtype=int), joints.n_extra)
    fields = []
    for form in (forms.stiffness, forms.mass):
        matrix = assemble_matrix(form)
        matrix.assemble()
        fields.append(matrix)
    material = model.material
    damped = material.alpha > 0 or material.beta > 0
    extra_stiffness, extra_mass = joints.matrices(numbering)
    extras = [extra_stiffness, extra_mass]
    if damped:
        damping = fields[0].duplicate(copy=True)
        damping.scale(material.alpha)
        damping.axpy(material.beta, fields[1], structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        fields.append(damping)
        extras.append(sparse.coo_matrix((numbering.n_local, numbering.n_local)))
    stiffness, mass, *rest = numbering.matrices(fields, extras)
    for matrix in fields:
        matrix.destroy()

    def inertia_vector(direction: tuple[float, float], factor: float) -> Any:
        forms.direction.value[:] = direction
        assembled = assemble_vector(forms.inertia)
        assembled.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        vector = numbering.vector(assembled.array[: numbering.n_field])
        assembled.destroy()
        vector.array[:] += joints.inertia(numbering, direction)
        vector.scale(factor)
        return vector

    loads = []
    if model.gravity != 0:
        loads.append(Load("gravity", inertia_vector((0.0, -1.0), model.gravity), Constant(1.0), static=True))
    for motion in model.motions:
        loads.append(Load("ground motion", inertia_vector(motion.direction, -1.0), motion.signal))
    weight = inertia_vector((0.0, 1.0), 1.0)
    total_mass = float(np.real(weight.dot(_rigid_translation(numbering, joints, 1))))
    operators = Operators(
        stiffness=stiffness,
        mass=mass,
        damping=rest[0] if damped else None,
        loads=loads,
        contacts=joints.contacts(numbering),
        probes=_probe_functionals(forms.space, numbering, model.probes),
        comm=numbering.comm,
    )
    joint_mass = sum(support.mass * len(support.points) for support in model.supports)
    return AssembledPlate(operators, forms.space, numbering, total_mass, joint_mass)


def _rigid_translation(numbering: Numbering, joints: _Joints, axis: int) -> Any:
    field_values = np.zeros(numbering.n_field)
    field_values[axis::2] = 1.0
    return numbering.vector(field_values, joints.rigid_translation(axis))


def _probe_functionals(space: Any, numbering: Numbering, probes: tuple[Probe, ...]) -> Functionals:
    names, rows, columns, weights = [], [], [], []
    for probe in probes:
        try:
            nodes, shape = interpolation(space, np.asarray(probe.point), f"probe {probe.name}")
        except ModelError as error:
            raise ModelError("probes", error.message) from None
        for axis, component in enumerate(AXES):
            local = numbering.local_row[2 * nodes + axis]
            free = local >= 0
            rows += [len(names)] * int(free.sum())
            columns += list(local[free])
            weights += list(shape[free])
            names.append(f"{probe.name}.D{component}")
    local_rows = sparse.csr_matrix((weights, (rows, columns)), shape=(len(names), numbering.n_local))
    return Functionals(tuple(names), local_rows, numbering.comm)


class _Joints:
    """The springs and joints whose plate nodes this rank owns, and the order of all contacts on all ranks."""

    def __init__(self, space: Any, model: PlateModel) -> None:
        self.supports = model.supports
        self.springs = [(spring, self._nodes(space, spring, f"springs.{spring.name}")) for spring in model.springs]
        self.joints: list[tuple[Support, int, int, int, int]] = []
        """(support, component, local dof of the plate, extra dof, number of its contact or -1) of each owned joint component."""
        self.names: list[str] = []
        self.points: list[tuple[float, float]] = []
        self.stiffness: list[float] = []
        self.n_extra = 0
        for support in model.supports:
            nodes = self._nodes(space, support, f"supports.{support.name}")
            for number, (node, point) in enumerate(zip(nodes, support.points, strict=True), start=1):
                contact = -1
                if support.unilateral:
                    contact = len(self.names)
                    self.names.append(f"{support.name}{number}")
                    self.points.append(point)
                    self.stiffness.append(support.contact[support.axis])
                if node < 0:
                    continue
                for axis in range(2):
                    if support.stiffness[axis] == 0 and support.contact[axis] == 0:
                        continue  # nothing holds the auxiliary node here, and nothing ties it to the plate
                    here = contact if support.unilateral and axis == support.axis else -1
                    self.joints.append((support, axis, 2 * int(node) + axis, self.n_extra, here))
                    self.n_extra += 1

    @staticmethod
    def _nodes(space: Any, group: Spring | Support, key: str) -> np.ndarray:
        try:
            return owned_nodes(space, np.asarray(group.points, dtype=float).reshape(-1, 2), group.name)
        except ModelError as error:
            raise ModelError(key, error.message) from None

    def _terms(self, numbering: Numbering) -> Any:
        for support, axis, dof, extra, contact in self.joints:
            rows = np.array([numbering.local_row[dof], numbering.extra_row(extra)])
            yield support, axis, contact, rows, joint_term(support.stiffness[axis], support.contact[axis], support.mass)

    def matrices(self, numbering: Numbering) -> tuple[sparse.coo_matrix, sparse.coo_matrix]:
        """Return the extra entries of stiffness and mass in rows of this rank."""
        rows, columns, stiffness, mass = [], [], [], []
        for _, _, _, pair, term in self._terms(numbering):
            grid = np.meshgrid(pair, pair, indexing="ij")
            rows += list(grid[0].ravel())
            columns += list(grid[1].ravel())
            stiffness += list(term.stiffness.ravel())
            mass += list(term.mass.ravel())
        for spring, nodes in self.springs:
            for node in nodes[nodes >= 0]:
                for axis in range(2):
                    if spring.stiffness[axis] > 0:
                        row = numbering.local_row[2 * node + axis]
                        rows.append(row)
                        columns.append(row)
                        stiffness.append(spring.stiffness[axis])
                        mass.append(0.0)
        shape = (numbering.n_local, numbering.n_local)
        return sparse.coo_matrix((stiffness, (rows, columns)), shape), sparse.coo_matrix((mass, (rows, columns)), shape)

    def inertia(self, numbering: Numbering, direction: tuple[float, float]) -> np.ndarray:
        """Return the point masses times the unit acceleration `direction`, (n_local,) kg."""
        vector = np.zeros(numbering.n_local)
        for support, axis, _, rows, term in self._terms(numbering):
            vector[rows] += support.mass * direction[axis] * term.load
        return vector

    def rigid_translation(self, axis: int) -> np.ndarray:
        """Return the values of the extra dofs when everything moves by 1 m along `axis`."""
        values = np.zeros(self.n_extra)
        for support, component, _, extra, _ in self.joints:
            if component == axis:
                node = joint_term(support.stiffness[axis], support.contact[axis], support.mass).load
                # The auxiliary node moves with the plate: node . (1, r) = 1.
                values[extra] = (1.0 - node[0]) / node[1]
        return values

    def contacts(self, numbering: Numbering) -> Contacts:
        """Return the contacts of all ranks, with the part of their functionals and forces that lies on this rank."""
        n_c = len(self.names)
        elongation = sparse.lil_matrix((n_c, numbering.n_local))
        push = sparse.lil_matrix((numbering.n_local, n_c))
        for support, _, contact, rows, term in self._terms(numbering):
            if contact >= 0:
                elongation[contact, rows] = support.sign * term.elongation
                push[rows[0], contact] = support.sign
        return Contacts(
            tuple(self.names),
            np.asarray(self.points, dtype=float).reshape(-1, 2),
            Functionals(tuple(self.names), elongation.tocsr(), numbering.comm),
            push.tocsr(),
            CompressionOnly(np.asarray(self.stiffness)),
        )
