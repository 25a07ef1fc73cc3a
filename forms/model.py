"""A plane-stress plate on springs and joints: from a tagged mesh and its parameters to the operators of the model."""

from __future__ import annotations

from collections.abc import Callable, Iterator
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
from forms.labels import row_labels
from forms.material import Material
from forms.numbering import Numbering
from forms.operators import Contacts, Functionals, LiftedArea, Load, Operators, Reactions
from forms.parameters import PlateModel, Probe
from forms.points import interpolation, owned_nodes
from forms.signals import Constant
from forms.supports import AXES, JointTerm, Spring, Support, joint_term
from forms.uplift import UpliftLaw
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
    translations: tuple[Any, Any]
    """Mass times a rigid translation by 1 m along X and along Y, PETSc vectors in kg."""
    lifted_area: LiftedArea
    joint_mass: float
    """kg, of the point masses alone."""
    labels: np.ndarray
    """(n_local, 5) names of the rows that do not depend on the number of ranks (see `forms.labels`)."""

    def __enter__(self) -> AssembledPlate:
        """Return itself."""
        return self

    def __exit__(self, *args: object) -> None:
        """Destroy the operators and vectors."""
        self.operators.__exit__(*args)
        for vector in self.translations:
            vector.destroy()

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
    bonded, unilateral, extra_mass = joints.matrices(numbering)
    extras = [(bonded + unilateral).tocoo(), extra_mass]
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
    settlement = joints.settlement_load(numbering)
    if joints.settles:
        loads.append(Load("gaps and preloads", numbering.vector(None, None), Constant(1.0), static=True, internal=True))
        loads[-1].vector.array[:] = settlement
    translations = inertia_vector((1.0, 0.0), 1.0), inertia_vector((0.0, 1.0), 1.0)
    rigid = _rigid_translation(numbering, joints, 1)
    total_mass = float(np.real(translations[1].dot(rigid)))
    rigid.destroy()
    operators = Operators(
        stiffness=stiffness,
        mass=mass,
        damping=rest[0] if damped else None,
        loads=loads,
        contacts=joints.contacts(numbering),
        probes=_probe_functionals(forms.space, numbering, model.probes),
        comm=numbering.comm,
        bonded_springs=bonded,
        unilateral_springs=unilateral,
        reactions=joints.reactions(numbering, foot_middle(model)),
    )
    joint_mass = sum(support.mass * len(support.points) for support in model.supports)
    area = _lifted_area(numbering, translations[1], joints.inertia(numbering, (0.0, 1.0)))
    labels = row_labels(forms.space, numbering, joints.extra_nodes)
    return AssembledPlate(operators, forms.space, numbering, total_mass, translations, area, joint_mass, labels)


def _lifted_area(numbering: Numbering, inertia: Any, of_joints: np.ndarray) -> LiftedArea:
    """Return the shares of the area, which in a plate of one thickness are those of its mass without the joints'."""
    plate = np.real(inertia.array_r) - of_joints
    rows = numbering.local_row[1::2]
    rows = rows[rows >= 0]
    weights = plate[rows]
    return LiftedArea(rows, weights / numbering.comm.allreduce(float(weights.sum())), numbering.comm)


def _rigid_translation(numbering: Numbering, joints: _Joints, axis: int) -> Any:
    field_values = np.zeros(numbering.n_field)
    field_values[axis::2] = 1.0
    return numbering.vector(field_values, joints.rigid_translation(axis))


def _probe_functionals(space: Any, numbering: Numbering, probes: tuple[Probe, ...]) -> Functionals:
    names: list[str] = []
    rows: list[int] = []
    columns: list[int] = []
    weights: list[float] = []
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


def foot_middle(model: PlateModel) -> np.ndarray:
    """Return the point (2,) m about which moments are taken: the middle of the box that holds all supports and springs."""
    groups: tuple[Support, ...] | tuple[Spring, ...] = model.supports or model.springs
    points = [p for group in groups for p in group.points]
    if not points:
        return np.zeros(2)
    return 0.5 * (np.min(points, axis=0) + np.max(points, axis=0))


@dataclass(frozen=True)
class _JointPart:
    """One component of one joint whose plate node this rank owns."""

    support: Support
    point: tuple[float, float]
    axis: int
    rows: np.ndarray
    """(2,) rows within this rank: the plate's dof and the joint's own."""
    term: JointTerm
    channel: int
    """Channel of the contact that this component is, or -1 for a bonded one."""


class _Joints:
    """The springs and joints whose plate nodes this rank owns, and the order of all contacts on all ranks."""

    def __init__(self, space: Any, model: PlateModel) -> None:
        self.supports = model.supports
        self.springs = [(spring, self._nodes(space, spring, f"springs.{spring.name}")) for spring in model.springs]
        self._parts: list[tuple[Support, tuple[float, float], int, int, int, int]] = []
        """(support, point, axis, dof of the plate, extra dof, channel)."""
        self.names: list[str] = []
        self.points: list[tuple[float, float]] = []
        self.of: list[Support] = []
        """Support of each contact."""
        self.owner: list[int] = []
        self.settles = any(support.settlement != 0 for support in model.supports if support.unilateral)
        self.n_extra = 0
        normal = sum(len(support.points) for support in model.supports if support.unilateral)
        sideways: list[int] = []
        for support in model.supports:
            nodes = self._nodes(space, support, f"supports.{support.name}")
            for number, (node, point) in enumerate(zip(nodes, support.points, strict=True), start=1):
                channels = [-1, -1]
                if support.unilateral:
                    contact = len(self.names)
                    self.names.append(f"{support.name}{number}")
                    self.points.append(point)
                    self.of.append(support)
                    channels[support.axis] = contact
                    if support.sideways == "released" and np.isfinite(support.flexibility(1 - support.axis)):
                        channels[1 - support.axis] = normal + len(sideways)
                        sideways.append(contact)
                if node >= 0:
                    self._add(support, point, int(node), channels)
        self.owner = [*range(normal), *sideways]

    def _add(self, support: Support, point: tuple[float, float], node: int, channels: list[int]) -> None:
        for axis in range(2):
            if support.stiffness[axis] == 0 and support.contact[axis] == 0:
                continue  # nothing holds the auxiliary node here, and nothing ties it to the plate
            self._parts.append((support, point, axis, 2 * node + axis, self.n_extra, channels[axis]))
            self.n_extra += 1

    @staticmethod
    def _nodes(space: Any, group: Spring | Support, key: str) -> np.ndarray:
        try:
            return owned_nodes(space, np.asarray(group.points, dtype=float).reshape(-1, 2), group.name)
        except ModelError as error:
            raise ModelError(key, error.message) from None

    @property
    def extra_nodes(self) -> np.ndarray:
        """Local plate nodes that the extra rows belong to, in their order."""
        return np.array([dof // 2 for _, _, _, dof, _, _ in self._parts], dtype=int)

    def parts(self, numbering: Numbering) -> Iterator[_JointPart]:
        """Give the joint components of this rank."""
        for support, point, axis, dof, extra, channel in self._parts:
            rows = np.array([numbering.local_row[dof], numbering.extra_row(extra)])
            term = joint_term(support.stiffness[axis], support.contact[axis], support.mass)
            yield _JointPart(support, point, axis, rows, term, channel)

    def spring_ends(self, numbering: Numbering) -> Iterator[tuple[tuple[float, float], int, int, float]]:
        """Give point, axis, row within this rank and stiffness of each plain spring that is not zero."""
        for spring, nodes in self.springs:
            for point, node in zip(spring.points, nodes, strict=True):
                for axis in range(2):
                    if node >= 0 and spring.stiffness[axis] > 0:
                        yield point, axis, int(numbering.local_row[2 * node + axis]), spring.stiffness[axis]

    def matrices(self, numbering: Numbering) -> tuple[sparse.csr_matrix, sparse.csr_matrix, sparse.coo_matrix]:
        """Return the extra entries in rows of this rank: stiffness of what stays bonded and of what can open, and mass."""
        shape = (numbering.n_local, numbering.n_local)
        bonded, unilateral, mass = (sparse.lil_matrix(shape) for _ in range(3))
        for part in self.parts(numbering):
            grid = np.ix_(part.rows, part.rows)
            (bonded if part.channel < 0 else unilateral)[grid] += part.term.stiffness
            mass[grid] += part.term.mass
        for _, _, row, value in self.spring_ends(numbering):
            bonded[row, row] += value
        return bonded.tocsr(), unilateral.tocsr(), mass.tocoo()

    def inertia(self, numbering: Numbering, direction: tuple[float, float]) -> np.ndarray:
        """Return the point masses times the unit acceleration `direction`, (n_local,) kg."""
        vector = np.zeros(numbering.n_local)
        for part in self.parts(numbering):
            vector[part.rows] += part.support.mass * direction[part.axis] * part.term.load
        return vector

    def settlement_load(self, numbering: Numbering) -> np.ndarray:
        """Return the force (n_local,) N of support springs on ground that lies away from the plate by gap or preload."""
        vector = np.zeros(numbering.n_local)
        for part in self.parts(numbering):
            if 0 <= part.channel < len(self.names):
                stiffness = part.support.stiffness[part.axis]
                vector[part.rows] -= stiffness * part.support.sign * part.support.settlement * part.term.load
        return vector

    def rigid_translation(self, axis: int) -> np.ndarray:
        """Return the values of the extra dofs when everything moves by 1 m along `axis`."""
        values = np.zeros(self.n_extra)
        for support, _, component, _, extra, _ in self._parts:
            if component == axis:
                node = joint_term(support.stiffness[axis], support.contact[axis], support.mass).load
                # The auxiliary node moves with the plate: node . (1, r) = 1.
                values[extra] = (1.0 - node[0]) / node[1]
        return values

    def contacts(self, numbering: Numbering) -> Contacts:
        """Return the contacts of all ranks, with the part of their functionals and forces that lies on this rank."""
        n_c, n_channels = len(self.names), len(self.owner)
        elongation = sparse.lil_matrix((n_channels, numbering.n_local))
        push = sparse.lil_matrix((numbering.n_local, n_channels))
        for part in self.parts(numbering):
            if part.channel >= 0:
                sign = part.support.sign if part.channel < n_c else 1.0
                elongation[part.channel, part.rows] = sign * part.term.elongation
                push[part.rows[0], part.channel] = sign
        supports = [self.of[contact] for contact in self.owner]
        axes = [s.axis if channel < n_c else 1 - s.axis for channel, s in enumerate(supports)]
        names = tuple(self.names) + tuple(f"{self.names[c]} sideways" for c in self.owner[n_c:])
        return Contacts(
            tuple(self.names),
            np.asarray(self.points, dtype=float).reshape(-1, 2),
            Functionals(names, elongation.tocsr(), numbering.comm),
            push.tocsr(),
            UpliftLaw(
                np.array([s.contact[axis] for s, axis in zip(supports, axes, strict=True)]),
                np.array([s.flexibility(axis) for s, axis in zip(supports, axes, strict=True)]),
                np.asarray(self.owner, dtype=int),
            ),
        )

    def reactions(self, numbering: Numbering, middle: np.ndarray) -> Reactions:
        """Return the resultants of all spring forces on the plate, moments about the point `middle` (2,) m."""
        rows = sparse.lil_matrix((3, numbering.n_local))
        per_release = np.zeros((3, len(self.owner)))
        constant = np.zeros(3)

        def effects(point: tuple[float, float], axis: int) -> np.ndarray:
            """Shear, vertical and moment (3,) of a unit force along `axis` at `point`."""
            arm = np.asarray(point) - middle
            return np.array([1.0, 0.0, -arm[1]] if axis == 0 else [0.0, 1.0, arm[0]])

        for point, axis, row, value in self.spring_ends(numbering):
            for k, effect in enumerate(effects(point, axis)):
                rows[k, row] -= value * effect
        for part in self.parts(numbering):
            effect = effects(part.point, part.axis)
            # The ground's force is that of the support spring; while a contact is open its release force stands against it.
            stiffness = part.support.stiffness[part.axis]
            for k in range(3):
                for row, weight in zip(part.rows, part.term.load, strict=True):
                    rows[k, row] -= stiffness * weight * effect[k]
            if part.channel >= 0:
                normal = part.channel < len(self.names)
                per_release[:, part.channel] = effect * (part.support.sign if normal else 1.0)
                if normal:
                    constant -= effect * stiffness * part.support.sign * part.support.settlement
        total = Functionals(("base shear", "vertical reaction", "overturning moment"), rows.tocsr(), numbering.comm)
        return Reactions(total, total.total(per_release), total.total(constant))
