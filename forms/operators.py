"""The operators of a model: the one object that stands between the forms and the solvers.

M u'' + C u' + K u = sum over loads of vector(l) * history(l)(t) + push @ contact release forces

with every contact bonded in K. A solver needs nothing else, so a model may as well be a two-dof oscillator. A model that is projected
on a basis is an `Operators` again: its dofs are the coordinates of the basis, and `reconstruct` is the way back.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy import sparse

from uplift.forms.contact.law import UpliftLaw


def _sum_over_ranks(partial: np.ndarray, comm: Any) -> np.ndarray:
    if comm.size == 1:
        return partial
    partial = np.ascontiguousarray(partial)
    total = np.empty_like(partial)
    comm.Allreduce(partial, total, op=MPI.SUM)
    return total


@dataclass(frozen=True)
class Functionals:
    """Sparse linear functionals of the solution, such as the displacement of a probe."""

    names: tuple[str, ...]
    local: sparse.csr_matrix
    """(n_functionals, n_local): weights on this rank's part of a solution; the value is the sum over ranks."""
    comm: Any

    def partial(self, values: np.ndarray) -> np.ndarray:
        """Return this rank's share of the functionals (n_functionals,) of its part (n_local,) of a solution."""
        return self.local @ values

    def total(self, partial: np.ndarray) -> np.ndarray:
        """Return the sum over ranks of shares of any shape (collective)."""
        return _sum_over_ranks(partial, self.comm)


@dataclass(frozen=True)
class LiftedArea:
    """The share of the plate's area whose nodes have risen: a nodal field, 1 where DY > 0 and else 0, integrated over the cells."""

    rows: np.ndarray
    """Rows within this rank of the vertical displacements of its nodes."""
    weights: np.ndarray
    """Area of the plate that belongs to each of them, as a part of the whole."""
    comm: Any

    def partial(self, values: np.ndarray) -> np.ndarray:
        """Return this rank's share of the lifted area, in percent, for its part (n_local, ...) of solutions."""
        return 100.0 * (self.weights @ (values[self.rows] > 0))

    def total(self, partial: np.ndarray) -> np.ndarray:
        """Return the sum over ranks of shares of any shape (collective)."""
        return _sum_over_ranks(partial, self.comm)


@dataclass(frozen=True)
class Load:
    """A load: a vector in space times a function of time."""

    name: str
    vector: Any
    """PETSc vector in N (times the unit of `history`)."""
    history: Callable[[np.ndarray], np.ndarray]
    """Values (nt,) at times (nt,) s."""
    static: bool = False
    """Whether it already acts before time 0, as gravity does."""
    internal: bool = False
    """Whether it stands for the strain of springs at zero displacement and so does no work from outside."""
    largest: float | None = None
    """Largest nodal force in N of the vector before it was projected on a basis; None: that of `vector` itself."""


@dataclass(frozen=True)
class Contacts:
    """The unilateral contacts of a model, in the order of its supports, and their channels (see `uplift.forms.contact.law`)."""

    names: tuple[str, ...]
    points: np.ndarray
    """(n_c, 2) m."""
    elongation: Functionals
    """Elongation of each channel in m, positive when it opens."""
    push: sparse.csr_matrix
    """(n_local, n_channels): this rank's part of the unit release force of each channel on the plate."""
    law: UpliftLaw


def no_contacts(n_local: int, comm: Any) -> Contacts:
    """Return the contacts of a model that has none."""
    nothing = Functionals((), sparse.csr_matrix((0, n_local)), comm)
    return Contacts((), np.zeros((0, 2)), nothing, sparse.csr_matrix((n_local, 0)), UpliftLaw(np.zeros(0), np.zeros(0)))


@dataclass(frozen=True)
class OutputGroup:
    """Outputs of one kind: rows y = local u + per_velocity u' + per_support_force s + constant, each with a name and a unit.

    s (n_channels,) are the forces that stand against the supports' springs: the release forces, where auxiliary nodes have no mass.
    """

    name: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    """SI unit of each row; m and rad are told apart."""
    local: sparse.csr_matrix
    """(n, n_local): weights on this rank's part of a solution; the value is the sum over ranks."""
    per_support_force: np.ndarray | None = None
    """(n, n_channels); None: zero."""
    constant: np.ndarray | None = None
    """(n,), of springs that are strained at zero displacement; None: zero."""
    per_velocity: sparse.csr_matrix | None = None
    """(n, n_local) s times the unit of `local`: weights on this rank's part of the velocity; None: zero."""

    @property
    def moving(self) -> np.ndarray:
        """Which rows (n,) are displacements: their unit is m."""
        return np.array([unit == "m" for unit in self.units], dtype=bool)


@dataclass(frozen=True)
class Outputs:
    """All that is observed of a model: one sparse matrix, its rows in groups."""

    groups: tuple[OutputGroup, ...]
    local: sparse.csr_matrix
    """(n_rows, n_local): the groups' rows one below the other."""
    per_velocity: sparse.csr_matrix | None
    """(n_rows, n_local): their weights on the velocity; None where no group has any, so that nobody pays for it."""
    comm: Any

    @staticmethod
    def of(groups: Sequence[OutputGroup], comm: Any) -> Outputs:
        """Return the outputs of some groups, of which there is at least one."""
        local = sparse.vstack([group.local for group in groups], format="csr")
        moved = [sparse.csr_matrix(g.local.shape) if g.per_velocity is None else g.per_velocity for g in groups]
        damped = any(group.per_velocity is not None for group in groups)
        return Outputs(tuple(groups), local, sparse.vstack(moved, format="csr") if damped else None, comm)

    @property
    def layout(self) -> dict[str, slice]:
        """The rows of each group."""
        ends = np.cumsum([0, *(len(group.names) for group in self.groups)]).tolist()
        return {group.name: slice(a, b) for group, a, b in zip(self.groups, ends[:-1], ends[1:], strict=True)}

    def __getitem__(self, name: str) -> OutputGroup:
        """Return a group by its name."""
        return next(group for group in self.groups if group.name == name)

    def partial(self, values: np.ndarray) -> np.ndarray:
        """Return this rank's share of the linear parts (n_rows, ...) of its part (n_local, ...) of solutions."""
        return self.local @ values

    def total(self, partial: np.ndarray) -> np.ndarray:
        """Return the sum over ranks of shares of any shape (collective)."""
        return _sum_over_ranks(partial, self.comm)

    def velocity_rows(self, values: np.ndarray) -> np.ndarray | None:
        """Return the parts (n_rows, ...) that velocities (n_local, ...) on this rank make, summed over the ranks; None: no such part."""
        return None if self.per_velocity is None else self.total(self.per_velocity @ values)

    def linear(self, name: str, values: np.ndarray) -> np.ndarray:
        """Return the linear parts (n, ...) of one group for this rank's part (n_local, ...) of solutions (collective)."""
        return self.total(self[name].local @ values)

    def values(self, linear: np.ndarray, support_force: np.ndarray) -> np.ndarray:
        """Return the outputs (nt, n_rows) from their linear parts (nt, n_rows) and the support forces (nt, n_channels) N."""
        whole = linear.copy()
        for group, rows in zip(self.groups, self.layout.values(), strict=True):
            if group.per_support_force is not None:
                whole[:, rows] += support_force @ group.per_support_force.T
            if group.constant is not None:
                whole[:, rows] += group.constant
        return whole

    def projected(self, vectors: np.ndarray, comm: Any) -> Outputs:
        """Return the outputs of coordinates of `vectors` (n_local, m), whole on every rank, with communicator `comm` (collective)."""
        whole, moved = self.total(self.partial(vectors)), self.velocity_rows(vectors)
        groups = []
        for group, rows in zip(self.groups, self.layout.values(), strict=True):
            damped = None if group.per_velocity is None or moved is None else sparse.csr_matrix(moved[rows])
            groups.append(replace(group, local=sparse.csr_matrix(whole[rows]), per_velocity=damped))
        return Outputs.of(groups, comm)


@dataclass(frozen=True)
class Reduction:
    """The basis that the dofs of a projected model are coordinates of."""

    vectors: np.ndarray
    """(n_local, m): this rank's rows in the model that was projected."""
    comm: Any
    """Of that model: the projected one is the same on all its ranks."""


@dataclass
class Operators:
    """Matrices, loads, contacts and outputs of a model; it owns its PETSc objects (`with` closes them)."""

    stiffness: Any
    mass: Any
    damping: Any | None
    """None where the model has no damping."""
    loads: list[Load]
    contacts: Contacts
    outputs: Outputs
    """Groups "probes", "elongation" and "reactions", the last one empty where the model knows no ground."""
    comm: Any
    bonded_springs: sparse.csr_matrix
    """(n_local, n_local) N/m: the part of the stiffness that is plain springs and bonded components of joints."""
    unilateral_springs: sparse.csr_matrix
    """(n_local, n_local) N/m: the part that is components of joints whose contact can open."""
    reduction: Reduction | None = None
    """None where the dofs are those of the model itself."""

    n: int = field(init=False)
    """Number of dofs."""
    n_local: int = field(init=False)
    """Number of dofs of this rank."""

    def __post_init__(self) -> None:
        """Note the sizes, which may be asked for when the matrices are gone."""
        self.n, self.n_local = int(self.stiffness.getSize()[0]), int(self.stiffness.getLocalSize()[0])

    @property
    def probes(self) -> OutputGroup:
        """The displacements and rotations of the probes."""
        return self.outputs["probes"]

    @property
    def reactions(self) -> OutputGroup:
        """The resultants of the forces of the ground on the plate."""
        return self.outputs["reactions"]

    @property
    def world(self) -> Any:
        """The communicator of all ranks that work on the model."""
        return self.comm if self.reduction is None else self.reduction.comm

    def reconstruct(self, values: np.ndarray) -> np.ndarray:
        """Return this rank's part (..., rows) of the displacements for its part (..., n_local) of solutions."""
        return values if self.reduction is None else values @ self.reduction.vectors.T

    def new_vector(self) -> Any:
        """Return a new zero vector of the system; the caller destroys it."""
        return self.stiffness.createVecRight()

    def __enter__(self) -> Operators:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Destroy the matrices and load vectors."""
        for thing in (self.stiffness, self.mass, self.damping, *(load.vector for load in self.loads)):
            if thing is not None:
                thing.destroy()


def probe_group(names: tuple[str, ...], local: sparse.csr_matrix) -> OutputGroup:
    """Return displacements of probes: in rad where a name ends in .DRX, .DRY, .DRZ, else in m."""
    turned = [name.rsplit(".", 1)[-1].startswith("DR") for name in names]
    return OutputGroup("probes", names, tuple("rad" if turns else "m" for turns in turned), local)


def elongation_group(contacts: Contacts) -> OutputGroup:
    """Return the elongations of the contacts' channels."""
    names = contacts.elongation.names
    return OutputGroup("elongation", names, ("m",) * len(names), contacts.elongation.local)


def no_reactions(n_local: int) -> OutputGroup:
    """Return the reactions of a model that knows no ground."""
    return OutputGroup("reactions", (), (), sparse.csr_matrix((0, n_local)))
