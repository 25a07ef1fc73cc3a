"""The state of a model at one instant, and the loads that act on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from uplift.forms.operators import Operators


@dataclass
class State:
    """Displacement, velocity and acceleration (PETSc vectors) and release forces at one instant; `with` destroys it."""

    displacement: Any
    velocity: Any
    acceleration: Any
    release: np.ndarray
    """(n_channels,) N."""
    nodes: np.ndarray | None = None
    """(4, n_c): the motion of auxiliary nodes with mass, see `uplift.solvers.contact.auxiliary_nodes`; None: at rest, or without mass."""

    def copy(self) -> State:
        """Return an independent copy."""
        vectors = self.displacement.copy(), self.velocity.copy(), self.acceleration.copy()
        return State(*vectors, self.release.copy(), None if self.nodes is None else self.nodes.copy())

    def __enter__(self) -> State:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Destroy the vectors."""
        for vector in (self.displacement, self.velocity, self.acceleration):
            vector.destroy()


def at_rest(operators: Operators) -> State:
    """Return the state of zero displacement, velocity, acceleration and release forces."""
    return State(
        operators.new_vector(), operators.new_vector(), operators.new_vector(), np.zeros(operators.contacts.law.n_channels)
    )


def add_push(operators: Operators, release: np.ndarray, vector: Any) -> None:
    """Add release forces (n_channels,) N to a load vector."""
    if release.any():
        vector.array[:] += operators.contacts.push @ release


def tensions(operators: Operators, displacement: Any) -> np.ndarray:
    """Return the tensions (n_channels,) N of the bonded contacts under a displacement vector (collective)."""
    elongation = operators.contacts.elongation
    return operators.contacts.law.tension(elongation.total(elongation.partial(np.real(displacement.array_r))))


def load_values(operators: Operators, times: np.ndarray, *, static_only: bool = False) -> np.ndarray:
    """Return the load histories (nt, n_loads) at `times` (nt,) s; with `static_only` those of the static loads alone."""
    columns = [
        load.history(times) if load.static or not static_only else np.zeros(len(times)) for load in operators.loads
    ]
    return np.stack(columns, axis=1) if columns else np.zeros((len(times), 0))


def load_scale(operators: Operators, values: np.ndarray) -> float:
    """Return the largest nodal load in N that the load histories (nt, n_loads) ever make: what round-off in forces is measured by."""
    largest = np.max(np.abs(values), axis=0, initial=0.0)
    nodal = [load.vector.norm(PETSc.NormType.NORM_INFINITY) for load in operators.loads]
    return float(np.max(largest * nodal, initial=0.0))


def loads_at(operators: Operators, values: np.ndarray, release: np.ndarray) -> Any:
    """Return a new vector of the loads for values (n_loads,) of their histories and release forces (n_channels,) N."""
    right = operators.new_vector()
    for value, load in zip(values, operators.loads, strict=True):
        right.axpy(value, load.vector)
    add_push(operators, release, right)
    return right
