"""What is observed of a model, as rows of the state of one contact set."""

from __future__ import annotations

import numpy as np

from uplift.solvers.time_domain.exact.contact_set import Augmented, ContactSet
from uplift.solvers.time_domain.exact.first_order import FirstOrder
from uplift.solvers.time_domain.exact.model import DenseModel


def carried_by_stiff(model: DenseModel, system: FirstOrder) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the weights (n_o, n_dofs) of velocity and acceleration in forces that stiff shapes carry; None where there are none.

    A stiff shape, such as that of a spring of 1e15 N/m, follows f - C u' - M u'' at once. Its displacement hardly matters, and the march
    takes that of f alone; but times its stiffness it is the force of the spring, of which damping and inertia are a part.
    """
    forces = np.array([unit not in ("m", "rad") for unit in model.output_units], dtype=bool)
    if not system.stiff.shape[1] or not forces.any():
        return None
    weights = (forces[:, None] * model.outputs) @ system.stiff
    return weights @ (system.stiff.T @ model.damping), weights @ (system.stiff.T @ model.mass)


class Observed:
    """The rows of outputs, contact forces and gaps, n_o + 2 n_c of them, and of the displacements of all dofs."""

    def __init__(self, model: DenseModel, system: FirstOrder, base: Augmented) -> None:
        """Take the model, its system and the state that it is marched in."""
        self._model, self._system, self._base = model, system, base
        self.n_outputs, self.n_contacts = len(model.outputs), len(model.names)
        self._x, self._f = model.outputs @ system.T, model.outputs @ system.U
        self._r = model.outputs @ system.W + model.output_release
        self._carried = carried_by_stiff(model, system)

    def rows(self, regime: ContactSet) -> np.ndarray:
        """Return (n_o + 2 n_c, N): outputs, contact forces N (compression positive) and gaps m."""
        linear = self._base.rows(self._x, self._f) + self._r @ regime.release
        linear[:, self._base.n] += self._model.output_constant
        if self._model.output_velocity is not None:
            linear += self._model.output_velocity @ self.displacement(regime) @ regime.generator
        if self._carried is not None:
            velocity = self.displacement(regime) @ regime.generator
            linear -= self._carried[0] @ velocity + self._carried[1] @ velocity @ regime.generator
        force = np.where(regime.open[:, None], 0.0, regime.margin)
        return np.concatenate([linear, force, self.gap(regime)])

    def gap(self, regime: ContactSet) -> np.ndarray:
        """Return (n_c, N) m: gaps, zero where closed."""
        gaps: np.ndarray = self._model.law.flexibility[:, None] * regime.release
        return gaps

    def displacement(self, regime: ContactSet) -> np.ndarray:
        """Return (n_dofs, N)."""
        whole: np.ndarray = self._base.rows(self._system.T, self._system.U) + self._system.W @ regime.release
        return whole
