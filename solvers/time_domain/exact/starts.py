"""States that an exact march begins from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.solvers.contact.step import ContactProblem, settled_release
from uplift.solvers.errors import SolverError
from uplift.solvers.time_domain.exact.model import DenseModel


@dataclass(frozen=True)
class Start:
    """What a march begins from."""

    displacement: np.ndarray
    """(n_dofs,)."""
    velocity: np.ndarray
    """(n_dofs,)."""
    release: np.ndarray
    """(n_c,) N."""


def rest_start(model: DenseModel) -> Start:
    """Return the state of no displacement, velocity and release force."""
    n = len(model.mass)
    return Start(np.zeros(n), np.zeros(n), np.zeros(len(model.names)))


def static_start(model: DenseModel) -> Start:
    """Return the state of rest under the static loads, contacts lifted where they pull.

    Raises `ModelError` if the loads lift or tip the structure off its contacts and nothing else holds it.
    """
    values = np.array([h(np.zeros(1))[0] if static else 0.0 for h, static in zip(model.histories, model.static, strict=True)])
    force = model.loads @ values
    try:
        answers = np.linalg.solve(model.stiffness, np.column_stack([force, model.push]))
    except np.linalg.LinAlgError:
        raise SolverError("nothing holds the structure: it has no static state") from None
    pull = model.law.stiffness[:, None] * model.elongation
    problem = ContactProblem(model.law, pull @ answers[:, 1:])
    release = settled_release(problem, pull @ answers[:, 0], float(np.abs(force).max(initial=0.0)))
    return Start(answers @ np.concatenate([[1.0], release]), np.zeros(len(force)), release)
