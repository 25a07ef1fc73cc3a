"""TODO."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from uplift.forms.contact.law import UpliftLaw
from uplift.forms.operators import Operators, Reactions
from uplift.solvers.bases.basis import Basis, inner, projected_matrices
from uplift.solvers.errors import SolverError


@dataclass(frozen=True)
class ReducedModel:
    """The projection of a model on a basis: small dense arrays, the same on every rank."""

    basis: Basis
    stiffness: np.ndarray
    """(m, m) V^T K V."""
    mass: np.ndarray
    """(m, m) V^T M V, positive definite."""
    damping: np.ndarray
    """(m, m) V^T C V, zero where the model has no damping."""
    loads: np.ndarray
    """(m, n_loads): generalised forces of the loads."""
    histories: tuple[Callable[[np.ndarray], np.ndarray], ...]
    """Of each load: its values (nt,) at times (nt,) s."""
    static: tuple[bool, ...]
    """Of each load: whether it already acts before time 0."""
    push: np.ndarray
    """(m, n_channels): generalised forces of the unit release forces."""
    probes: np.ndarray
    """(n_probes, m): displacements of the probes of each vector."""
    elongation: np.ndarray
    """(n_channels, m): elongations of the contacts of each vector."""
    resultants: np.ndarray
    """(3, m): linear part of the reactions of each vector; no rows where the model knows no ground."""
    reactions: Reactions | None
    law: UpliftLaw
    largest: np.ndarray
    """(n_loads,): largest nodal load of each load vector in the model itself."""

    def load_scale(self, values: np.ndarray) -> float:
        """Return the largest nodal load in N that the load histories (nt, n_loads) ever make."""
        return float(np.max(np.max(np.abs(values), axis=0, initial=0.0) * self.largest, initial=0.0))

    def load_values(self, times: np.ndarray, *, static_only: bool = False) -> np.ndarray:
        """Return the load histories (nt, n_loads) at `times` (nt,) s; with `static_only` those of the static loads alone."""
        values = np.zeros((len(times), len(self.histories)))
        for j, (history, static) in enumerate(zip(self.histories, self.static, strict=True)):
            if static or not static_only:
                values[:, j] = history(times)
        return values

    def field(self, coordinates: np.ndarray) -> np.ndarray:
        """Return this rank's part (n_local,) of the solution with coordinates (m,)."""
        return self.basis.vectors @ coordinates


def project(operators: Operators, basis: Basis, *, diagonal: bool = False) -> ReducedModel:
    """Project a model on a basis (collective).

    `diagonal` keeps only the diagonals of the projected stiffness, mass and damping, as modelisation B of SDLS119 does;
    with modes it drops the damping between modes, nothing else. Raises `SolverError` if the basis is not independent
    in the norm of the mass.
    """
    V, comm = basis.vectors, operators.comm
    known = basis.projected or projected_matrices(operators, V)

    def kept(full: np.ndarray) -> np.ndarray:
        return np.diag(np.diag(full)) if diagonal else full

    mass = kept(known.mass)
    size = np.sqrt(np.diag(mass))
    if not (np.all(size > 0) and np.linalg.eigvalsh(mass / np.outer(size, size))[0] > 1e-12):
        raise SolverError("the vectors of the basis are linearly dependent, or one of them moves no mass")
    reactions = operators.reactions
    observed = [operators.probes, operators.contacts.elongation] + ([reactions.functionals] if reactions else [])
    probes, elongation, *resultants = (functionals.total(functionals.partial(V)) for functionals in observed)
    return ReducedModel(
        basis=basis,
        stiffness=kept(known.stiffness),
        mass=mass,
        damping=kept(known.damping),
        loads=inner(V, np.stack([np.real(load.vector.array_r) for load in operators.loads], axis=1), comm)
        if operators.loads
        else np.zeros((basis.size, 0)),
        histories=tuple(load.history for load in operators.loads),
        static=tuple(load.static for load in operators.loads),
        push=inner(V, operators.contacts.push.toarray(), comm),
        probes=probes,
        elongation=elongation,
        resultants=resultants[0] if resultants else np.zeros((0, basis.size)),
        reactions=reactions,
        law=operators.contacts.law,
        largest=np.array([load.vector.norm(PETSc.NormType.NORM_INFINITY) for load in operators.loads]),
    )
