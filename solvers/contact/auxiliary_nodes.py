"""Auxiliary nodes with a mass of their own under open contacts.

The solvers keep every contact bonded and push the plate alone with its release force r. That leaves the plate with the contact's net
force, but the auxiliary node follows the plate, as if it were still bonded. A node of no mass does not notice: the true one is away from it
by w = -r / k, k the support spring, and so is the gap. A node of mass m is away by the motion of an oscillator of its own,

    m w'' + k w = -r,

which no other part of the structure feels. With k_c the stiffness of the contact, the law is then, for the net tension f = q + D r - r of
`uplift.solvers.contact.step`,

    f <= 0,   r - k_c w >= 0,   f (r - k_c w) = 0,

and since one step gives w = (known part) - c r, the second condition is a lower bound of r: the same small problem with its origin moved.
(In exact arithmetic this is the pair of forces r on the plate and -r on the node. That pair would have to be as large as k_c times the
gap, 1e13 N for a centimetre, and lose eight digits; here all forces keep the size of the contact forces.)

The oscillators are stepped by generalised-alpha with spectral radius 0 at high frequency, of second order for nodes whose motion the step
resolves and without memory for those that it does not, whose w is -r / k: one treatment from 0 kg upwards. Where the step cannot tell the
two apart the latter is taken.
"""

from __future__ import annotations

import numpy as np

from uplift.forms.contact.law import UpliftLaw
from uplift.solvers.contact.step import ContactProblem

COUNTING_MASS = 1e-3
"""A mass counts if it adds more than this part to the support spring's stiffness in a step, 2 m / dt^2 against k."""


class AuxiliaryNodes:
    """The auxiliary nodes of a model's contacts in steps of one length; `inertia_matters` says under which contacts a mass counts.

    Their motion is an array (4, n_c): w in m, its velocity, its acceleration, and the part of the release force above its lower bound.
    """

    def __init__(self, law: UpliftLaw, step: float) -> None:
        """Take the law, which knows the masses, and the length of a step in s."""
        n_c = law.n_contacts
        self._step, self._mass, self._contact = step, law.mass[:n_c], law.stiffness[:n_c]
        self._support = 1 / np.maximum(law.flexibility[:n_c] - 1 / self._contact, np.finfo(float).tiny)
        self.inertia_matters = 2 * self._mass > COUNTING_MASS * step**2 * self._support
        self.any = bool(self.inertia_matters.any())
        self._effective = np.where(self.inertia_matters, 2 * self._mass, 0.0) + step**2 * self._support
        self._yield = step**2 / self._effective
        """(n_c,) m/N: c, what a release force of this instant takes from w."""

    def at_rest(self, release: np.ndarray) -> np.ndarray:
        """Return the motion (4, n_c) of nodes at rest under release forces (n_channels,) N."""
        return self.in_equilibrium(release, np.zeros_like(release))

    def in_equilibrium(self, release: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Return the motion (4, n_c) of nodes under release forces (n_channels,) N that grow by `rate` N/s, without a swing."""
        acting, growing = release[: len(self._mass)], rate[: len(self._mass)]
        return np.stack([-acting / self._support, -growing / self._support, np.zeros_like(acting), acting])

    def solve(
        self, problem: ContactProblem, tension: np.ndarray, before: np.ndarray, motion: np.ndarray, scale: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the release forces (n_channels,) N of the next instant and the motion (4, n_c) there.

        The arguments are those of `ContactProblem.solve` and the motion of the instant before.
        """
        n_c, dt = len(self._mass), self._step
        w, v, a, _ = motion
        ahead, rate = w + dt * v - 0.5 * dt**2 * a, v - 0.5 * dt * a
        inertia = np.where(self.inertia_matters, self._mass * a, 0.0)
        known = np.where(self.inertia_matters, ahead + self._yield * (inertia - self._support * ahead), 0.0)
        least = self._contact * known / (1 + self._contact * self._yield)
        start = before.copy()
        start[:n_c] = motion[3]
        release = problem.solve(tension + problem.shift(least), start, scale)
        above = release[:n_c].copy()
        release[:n_c] += least
        acting = release[:n_c]
        new = (inertia - self._support * ahead - acting) / self._effective
        free = np.stack([ahead + dt**2 * new, rate + 1.5 * dt * new, new, above])
        return release, np.where(self.inertia_matters, free, np.stack([-acting / self._support, 0 * acting, 0 * acting, above]))

    def gap(self, motion: np.ndarray) -> np.ndarray:
        """Return the openings (..., n_c) m, zero where closed, of motions (4, ..., n_c)."""
        return motion[3] * (1 / self._contact + self._yield)

    def on_ground(self, release: np.ndarray, motion: np.ndarray) -> np.ndarray:
        """Return what stands against the support springs' force on bonded nodes, (..., n_channels) N: -k w, without mass r itself."""
        force = release.copy()
        force[..., : len(self._mass)] = -self._support * motion[0]
        return force
