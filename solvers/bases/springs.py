"""What a Krylov space has to know of springs, which damping spares, and of damping."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from uplift.forms.operators import Operators
from uplift.solvers.bases.basis import apply

log = logging.getLogger(__name__)

PROPORTIONAL = 1e-6
"""Damping of whose forces a K + b M leave no more than this part is theirs."""


def spring_forces(operators: Operators) -> tuple[np.ndarray, np.ndarray]:
    """Return this rank's rows (n_springs,) on which bonded springs pull the structure, and their stiffnesses (n_springs,) N/m.

    Dofs inside a joint are condensed: with little mass of their own they pass the force on.
    """
    springs = operators.bonded_springs
    pulled, stiffness = [], []
    for outer, inner_ in _joints(operators, springs):
        block = springs[np.ix_(outer, outer)].toarray()
        if inner_.size:
            coupling = springs[np.ix_(outer, inner_)].toarray()
            block -= coupling @ np.linalg.solve(springs[np.ix_(inner_, inner_)].toarray(), coupling.T)
        pulled += list(outer)
        stiffness += list(np.diag(block))
    return np.array(pulled, dtype=int), np.array(stiffness)


def inside_contacts(operators: Operators) -> np.ndarray:
    """Return this rank's rows of the dofs inside the joints whose contact can open."""
    inside = [inner_ for _, inner_ in _joints(operators, operators.unilateral_springs)]
    return np.concatenate([np.zeros(0, dtype=int), *inside])


def _joints(operators: Operators, springs: sparse.csr_matrix) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Give the rows of each group of connected springs: those that the structure holds as well, and those inside the group alone."""
    rows = np.flatnonzero(springs.diagonal())
    start = operators.stiffness.getOwnershipRange()[0]
    _, group = connected_components(springs, directed=False)
    order = rows[np.argsort(group[rows], kind="stable")]
    for members in np.split(order, np.flatnonzero(np.diff(group[order])) + 1) if order.size else []:
        alone = np.array([_alone(operators.stiffness, start, row, members) for row in members])
        yield members[~alone], members[alone]


def _alone(stiffness: Any, start: int, row: int, members: np.ndarray) -> bool:
    """Return whether the row of the stiffness (`row` within this rank) holds nothing outside the columns `members`."""
    columns, values = stiffness.getRow(start + row)
    return bool(np.isin(columns[values != 0] - start, members).all())


def proportional(operators: Operators, forces: np.ndarray, answers: np.ndarray) -> bool:
    """Return whether damping acts on the static `answers` (n_local, n) to `forces` (n_local, n) N as a K + b M do (collective).

    The nodes on springs are left out, which damping spares; elsewhere K times the answers is what they answer to.
    """
    if operators.damping is None:
        return True
    comm = operators.comm
    diagonal = operators.stiffness.getDiagonal()
    weight = 1 / np.sqrt(np.maximum(np.real(diagonal.array_r), np.finfo(float).tiny))[:, None]
    diagonal.destroy()
    held = (operators.bonded_springs.diagonal() != 0) | (operators.unilateral_springs.diagonal() != 0)
    damped = weight * apply(operators.damping, answers)
    total = comm.allreduce(float(np.sum(damped**2)))
    rest, *parts = (np.where(held[:, None], 0.0, a) for a in (damped, weight * forces, weight * apply(operators.mass, answers)))
    kept: list[np.ndarray] = []
    for part in parts:  # Gram-Schmidt; the two may be one, as for the load of gravity
        for known in kept:
            part = part - known * comm.allreduce(float(np.vdot(known, part)))
        square = comm.allreduce(float(np.sum(part**2)))
        if square > 0:
            kept.append(part / np.sqrt(square))
            rest = rest - kept[-1] * comm.allreduce(float(np.vdot(kept[-1], rest)))
    left = comm.allreduce(float(np.sum(rest**2)))
    log.debug("damping leaves %.1e of its forces by a K + b M", np.sqrt(left / total) if total else 0.0)
    return left <= PROPORTIONAL**2 * total
