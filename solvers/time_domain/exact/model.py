"""The dense model that the exact time integration works on, taken from the operators of a model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uplift.forms.contact.law import UpliftLaw
from uplift.forms.operators import Functionals, Operators
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
    springs: np.ndarray
    """(n, n) N/m: the part of K that is plain springs and bonded joints."""
    unilateral: np.ndarray
    """(n, n) N/m: the part of K that is joints whose contact can open."""


def dense_model(operators: Operators) -> DenseModel:
    """Gather the operators on every rank (collective).

    Raises `ModelError` for sideways forces that are released and for joints with mass.
    """
    law = operators.contacts.law
    if law.n_channels > law.n_contacts:
        raise ModelError(
            "supports", "sideways = \"released\" needs a method that steps in time: the exact method keeps sideways forces bonded"
        )
    if law.mass.any():
        raise ModelError("supports", "the exact method takes joints without mass: set mass = 0, or take a method that steps in time")
    n = operators.n
    probes, elongation = _dense(operators.probes, n), _dense(operators.contacts.elongation, n)
    outputs, release, constant = [probes], [np.zeros((len(probes), law.n_channels))], [np.zeros(len(probes))]
    names = operators.probes.names
    if operators.reactions is not None:
        reactions = operators.reactions
        outputs.append(_dense(reactions.functionals, n))
        release.append(reactions.per_release)
        constant.append(reactions.constant)
        names = (*names, *reactions.functionals.names)
    damping = operators.damping
    return DenseModel(
        mass=_whole(operators.mass),
        damping=np.zeros((n, n)) if damping is None else _whole(damping),
        stiffness=_whole(operators.stiffness),
        loads=_stacked(operators, np.stack([np.real(load.vector.array_r) for load in operators.loads], axis=1))
        if operators.loads
        else np.zeros((n, 0)),
        histories=tuple(load.history for load in operators.loads),
        static=tuple(load.static for load in operators.loads),
        internal=tuple(load.internal for load in operators.loads),
        push=_stacked(operators, operators.contacts.push.toarray()),
        elongation=elongation,
        law=law,
        names=operators.contacts.names,
        outputs=np.concatenate(outputs),
        output_release=np.concatenate(release),
        output_constant=np.concatenate(constant),
        output_names=names,
        springs=_square(operators, operators.bonded_springs.toarray()),
        unilateral=_square(operators, operators.unilateral_springs.toarray()),
    )


def _stacked(operators: Operators, local: np.ndarray) -> np.ndarray:
    """Return the rows of all ranks, one below the other."""
    return np.concatenate(operators.comm.allgather(np.ascontiguousarray(local)))


def _whole(matrix: object) -> np.ndarray:
    """Return a PETSc matrix as an array (n, n)."""
    from scipy import sparse

    indptr, indices, data = matrix.getValuesCSR()  # type: ignore[attr-defined]
    shape = (matrix.getLocalSize()[0], matrix.getSize()[1])  # type: ignore[attr-defined]
    local = sparse.csr_matrix((np.real(data), indices, indptr), shape=shape).toarray()
    return np.concatenate(matrix.comm.tompi4py().allgather(local))  # type: ignore[attr-defined]


def _dense(functionals: Functionals, n: int) -> np.ndarray:
    """Return the weights (n_functionals, n) on the whole solution."""
    parts = functionals.comm.allgather(functionals.local.toarray())
    return np.concatenate(parts, axis=1).reshape(-1, n)


def _square(operators: Operators, local: np.ndarray) -> np.ndarray:
    """Return blocks (n_local, n_local) of all ranks as the diagonal blocks of one matrix (n, n)."""
    from scipy.linalg import block_diag

    whole: np.ndarray = block_diag(*operators.comm.allgather(local))
    return whole
