"""The state of a model at one instant, what acts on it, and some instants of a march in a row."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from uplift.forms.operators import Load, Operators
from uplift.solvers.contact.memory import ContactMemory, closed


@dataclass
class State:
    """Displacement, velocity and acceleration (PETSc vectors) and the contacts at one instant; `with` destroys it."""

    displacement: Any
    velocity: Any
    acceleration: Any
    contacts: ContactMemory

    @property
    def release(self) -> np.ndarray:
        """Release forces (n_channels,) N."""
        return self.contacts.release

    def copy(self) -> State:
        """Return an independent copy."""
        return State(self.displacement.copy(), self.velocity.copy(), self.acceleration.copy(), self.contacts)

    def __enter__(self) -> State:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Destroy the vectors."""
        for vector in (self.displacement, self.velocity, self.acceleration):
            vector.destroy()


def at_rest(operators: Operators) -> State:
    """Return the state of zero displacement, velocity, acceleration and release forces."""
    vectors = operators.new_vector(), operators.new_vector(), operators.new_vector()
    return State(*vectors, closed(operators.contacts.law.n_channels))


@dataclass(frozen=True)
class Drive:
    """What acts on a model at the instants of a march."""

    values: np.ndarray
    """(steps + 1, n_loads) of the load histories."""
    scale: float
    """N: forces below 1e-12 of it are round-off to the contacts."""
    release: np.ndarray | None = None
    """(steps + 1, n_channels) N: release forces that are known; None: they follow from the law, or are zero."""

    @staticmethod
    def of(operators: Operators, times: np.ndarray, release: np.ndarray | None = None) -> Drive:
        """Return the loads at `times` (steps + 1,) s; `release` as in the class."""
        values = load_values(operators, times)
        return Drive(values, load_scale(operators, values), release)

    @staticmethod
    def static(operators: Operators, steps: int) -> Drive:
        """Return the static loads alone, at all instants."""
        values = load_values(operators, np.zeros(1), static_only=True)
        return Drive(np.repeat(values, steps + 1, axis=0), load_scale(operators, values))


@dataclass(frozen=True)
class Instants:
    """Some instants of a march in a row, this rank's rows; arrays may be views that the next ones overwrite."""

    first: int
    """Number of the first of them, counted in steps from time 0."""
    displacement: np.ndarray
    """(k, n_local) m."""
    velocity: np.ndarray
    """(k, n_local) m/s."""
    acceleration: np.ndarray
    """(k, n_local) m/s2."""
    release: np.ndarray
    """(k, n_channels) N."""
    inner: np.ndarray
    """(k, n_inner): further state of the contacts."""

    def archived(self, every: int) -> tuple[np.ndarray, np.ndarray]:
        """Return which of these instants are archived, and their rows in an archive of every `every`-th step."""
        numbers = self.first + np.arange(len(self.displacement))
        which = np.flatnonzero(numbers % every == 0)
        return which, numbers[which] // every


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
    columns = [load.history(times) if load.static or not static_only else np.zeros(len(times)) for load in operators.loads]
    return np.stack(columns, axis=1) if columns else np.zeros((len(times), 0))


def load_scale(operators: Operators, values: np.ndarray) -> float:
    """Return the largest nodal load in N that the load histories (nt, n_loads) ever make: what round-off in forces is measured by."""
    largest = np.max(np.abs(values), axis=0, initial=0.0)
    return float(np.max(largest * [largest_nodal(load) for load in operators.loads], initial=0.0))


def largest_nodal(load: Load) -> float:
    """Return the largest nodal force in N of a load's vector, before a projection if there was one (collective)."""
    return float(load.vector.norm(PETSc.NormType.NORM_INFINITY)) if load.largest is None else load.largest


def loads_at(operators: Operators, values: np.ndarray, release: np.ndarray) -> Any:
    """Return a new vector of the loads for values (n_loads,) of their histories and release forces (n_channels,) N."""
    right = operators.new_vector()
    for value, load in zip(values, operators.loads, strict=True):
        right.axpy(value, load.vector)
    add_push(operators, release, right)
    return right
