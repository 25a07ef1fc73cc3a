"""The dense model that the exact time integration works on, taken from the operators of a model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg, sparse

from uplift.forms.contact.law import UpliftLaw
from uplift.forms.operators import Operators
from uplift.meshes.checked import ModelError


@dataclass(frozen=True)
class DenseModel:
    """M u'' + C u' + K u = loads @ histories(t) + push @ r with contacts bonded in K; plain numpy arrays, the same on every rank.

    The release forces r (n_c,) N follow from the tensions t = stiffness * (elongation @ u): r >= 0, t - r <= 0, r (t - r) = 0.
    Gaps and preloads are in the loads, as the settlement of support springs.
    """

    mass: np.ndarray
    """(n, n) kg, positive semidefinite."""
    damping: np.ndarray
    """(n, n) N s/m, zero where nothing is damped."""
    stiffness: np.ndarray
    """(n, n) N/m."""
    loads: np.ndarray
    """(n, n_loads)."""
    histories: tuple[Callable[[np.ndarray], np.ndarray], ...]
    """Of each load: its values (nt,) at times (nt,) s."""
    static: tuple[bool, ...]
    """Of each load: whether it acts before time 0."""
    internal: tuple[bool, ...]
    """Of each load: whether it stands for strained springs and does no work from outside."""
    push: np.ndarray
    """(n, n_c): unit release force of each contact on the structure."""
    elongation: np.ndarray
    """(n_c, n): elongation of each bonded contact, positive when it opens."""
    law: UpliftLaw
    """Of n_c contacts with one component each, and no masses."""
    names: tuple[str, ...]
    """Of the contacts."""
    outputs: np.ndarray
    """(n_o, n): linear part of what is observed."""
    output_release: np.ndarray
    """(n_o, n_c): what a unit release force adds to it."""
    output_constant: np.ndarray
    """(n_o,)."""
    output_names: tuple[str, ...]
    output_units: tuple[str, ...]
    springs: np.ndarray
    """(n, n) N/m: the part of K that is plain springs and bonded joints."""
    unilateral: np.ndarray
    """(n, n) N/m: the part of K that is joints whose contact can open."""
    output_velocity: np.ndarray | None = None
    """(n_o, n): weights of the velocity in what is observed; None: zero."""


def dense_model(operators: Operators) -> DenseModel:
    """Gather the operators on every rank (collective).

    Raises `ModelError` for sideways forces that are released and for joints with mass.
    """
    law = operators.contacts.law
    if law.n_channels > law.n_contacts:
        raise ModelError(
            "supports", "the exact method keeps sideways forces: set sideways = \"bonded\", or take a method that steps in time"
        )
    if law.mass.any():
        raise ModelError("supports", "the exact method takes joints without mass: set mass = 0, or take a method that steps in time")
    n = operators.n
    layout, linear = operators.outputs.layout, _dense(operators.outputs.local, n, operators.comm)
    kept = [group for group in operators.outputs.groups if group.name != "elongation"]
    damping = operators.damping
    return DenseModel(
        mass=whole_matrix(operators.mass),
        damping=np.zeros((n, n)) if damping is None else whole_matrix(damping),
        stiffness=whole_matrix(operators.stiffness),
        loads=_stacked(operators, np.stack([np.real(load.vector.array_r) for load in operators.loads], axis=1))
        if operators.loads
        else np.zeros((n, 0)),
        histories=tuple(load.history for load in operators.loads),
        static=tuple(load.static for load in operators.loads),
        internal=tuple(load.internal for load in operators.loads),
        push=_stacked(operators, operators.contacts.push.toarray()),
        elongation=linear[layout["elongation"]],
        law=law,
        names=operators.contacts.names,
        outputs=np.concatenate([linear[layout[group.name]] for group in kept]),
        output_release=np.concatenate([_or_zero(group.per_support_force, (len(group.names), law.n_channels)) for group in kept]),
        output_constant=np.concatenate([_or_zero(group.constant, (len(group.names),)) for group in kept]),
        output_names=tuple(name for group in kept for name in group.names),
        output_units=tuple(unit for group in kept for unit in group.units),
        springs=_square(operators, operators.bonded_springs.toarray()),
        unilateral=_square(operators, operators.unilateral_springs.toarray()),
        output_velocity=_velocity_rows(operators, [layout[group.name] for group in kept]),
    )


def _velocity_rows(operators: Operators, kept: list[slice]) -> np.ndarray | None:
    if operators.outputs.per_velocity is None:
        return None
    moved = _dense(operators.outputs.per_velocity, operators.n, operators.comm)
    return np.concatenate([moved[rows] for rows in kept])


def _or_zero(values: np.ndarray | None, shape: tuple[int, ...]) -> np.ndarray:
    return np.zeros(shape) if values is None else values


def _stacked(operators: Operators, local: np.ndarray) -> np.ndarray:
    """Return the rows of all ranks, one below the other."""
    return np.concatenate(operators.comm.allgather(np.ascontiguousarray(local)))


def whole_matrix(matrix: Any) -> np.ndarray:
    """Return a PETSc matrix as an array (n, n) on every rank (collective)."""
    indptr, indices, data = matrix.getValuesCSR()
    shape = (matrix.getLocalSize()[0], matrix.getSize()[1])
    local = sparse.csr_matrix((np.real(data), indices, indptr), shape=shape).toarray()
    return np.concatenate(matrix.comm.tompi4py().allgather(local))


def _dense(local: sparse.csr_matrix, n: int, comm: Any) -> np.ndarray:
    """Return rows (k, n) on the whole solution from each rank's part of them."""
    return np.concatenate(comm.allgather(local.toarray()), axis=1).reshape(-1, n)


def _square(operators: Operators, local: np.ndarray) -> np.ndarray:
    """Return blocks (n_local, n_local) of all ranks as the diagonal blocks of one matrix (n, n)."""
    whole: np.ndarray = linalg.block_diag(*operators.comm.allgather(local))
    return whole
