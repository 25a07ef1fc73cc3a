"""The generalised-alpha family of time integration: its parameters and, in one place, its formulas.

u1 = u0 + dt v0 + dt^2 ((1/2 - beta) a0 + beta a1),  v1 = v0 + dt ((1 - gamma) a0 + gamma a1), and with * for the known parts of u1, v1,

    A a1 = f_alpha - alpha_m M a0 - C v_alpha* - K u_alpha*,    A = (1 - alpha_m) M + (1 - alpha_f) (gamma dt C + beta dt^2 K),

x_alpha = (1 - alpha_f) x1 + alpha_f x0. Second order for gamma = 1/2 - alpha_m + alpha_f, else first; unconditionally stable for the
parameters that `Scheme` admits. With constant steps a scheme is a rational function of the shift z = exp(-s dt): written for the generating
function U(z) = sum_n u_n z^n, the recurrences give (K + s(z) C + s2(z) M) U(z) = F(z) with

    s2 = m (1 - z)^2 / (dt^2 p),  s = (1 - z) (gamma + (1 - gamma) z) / (dt p),
    p = beta + (1/2 + gamma - 2 beta) z + (1/2 - gamma + beta) z^2,  m = (1 - alpha_m + alpha_m z) / (1 - alpha_f + alpha_f z),

for the trapezoidal rule s = 2 (1 - z) / (dt (1 + z)), s2 = s^2.

Sources: N. M. Newmark, J. Eng. Mech. Div. ASCE 85 (1959) 67; Hughes, The Finite Element Method, chapter 9; Chung and Hulbert,
J. Appl. Mech. 60 (1993) 371; Lubich, Numer. Math. 52 (1988) 129 and 413.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.meshes.checked import Checked, ModelError, quantity


@dataclass(frozen=True)
class Scheme(Checked):
    """Parameters of the generalised-alpha family of time integration; the defaults are the average-acceleration rule.

    alpha_m = alpha_f = 0 is Newmark's method, alpha_m = 0 the method of Hilber, Hughes and Taylor. Inertia acts at the
    instant t + (1 - alpha_m) dt of each step, all other forces at t + (1 - alpha_f) dt.
    Source: Chung and Hulbert, J. Appl. Mech. 60 (1993) 371.
    """

    beta: float = quantity("weight of the new acceleration in the displacement", default=0.25, above=0.0, at_most=1.0)
    gamma: float = quantity("weight of the new acceleration in the velocity", default=0.5, at_least=0.5, at_most=2.0)
    alpha_m: float = quantity("weight of the old acceleration in the inertia", default=0.0, at_least=-1.0, at_most=0.5)
    alpha_f: float = quantity("weight of the old state in all other forces", default=0.0, at_least=0.0, at_most=0.5)

    def check(self) -> None:
        """Refuse parameters that are only conditionally stable: the joints' frequencies exceed any limit."""
        if 2 * self.beta < self.gamma * (1 - 1e-12):
            raise ModelError("beta", f"expected >= gamma / 2 = {self.gamma / 2:g} for unconditional stability, got {self.beta:g}")
        if self.alpha_m > self.alpha_f:
            raise ModelError("alpha_m", f"expected <= alpha_f = {self.alpha_f:g} for unconditional stability, got {self.alpha_m:g}")

    def effective(self, step: float) -> tuple[float, float, float]:
        """Return the weights of mass, damping and stiffness in the matrix A of a step of `step` s."""
        keep = 1 - self.alpha_f
        return 1 - self.alpha_m, keep * self.gamma * step, keep * self.beta * step**2

    def predictor(self, step: float) -> tuple[tuple[float, float], float]:
        """Return the weights of v0 and a0 in the known part of u1, and of a0 in that of v1."""
        return (step, step**2 * (0.5 - self.beta)), step * (1 - self.gamma)

    def corrector(self, step: float) -> tuple[float, float]:
        """Return the weights of a1 in u1 and in v1."""
        return step**2 * self.beta, step * self.gamma

    def symbol(self, z: np.ndarray, step: float) -> Symbol:
        """Return the scheme as a function of the shift z (n,), complex, for steps of `step` s."""
        beta, gamma = self.beta, self.gamma
        p = beta + (0.5 + gamma - 2 * beta) * z + (0.5 - gamma + beta) * z**2
        late = 1 - self.alpha_f + self.alpha_f * z
        inertia = (1 - self.alpha_m + self.alpha_m * z) / late
        slope = (beta * (1 - z) + gamma * z) / p
        return Symbol(
            s=(1 - z) * (gamma + (1 - gamma) * z) / (step * p),
            s_squared=inertia * (1 - z) ** 2 / (step**2 * p),
            initial_load=(self.alpha_f - self.alpha_m) / late - inertia * slope,
            initial_damping=step * (gamma / (1 - z) - (gamma + (1 - gamma) * z) / (1 - z) * slope),
        )


@dataclass(frozen=True)
class Symbol:
    """What stands for the derivatives in the generating functions of a scheme, at some points z, each (n,) complex."""

    s: np.ndarray
    """Factor of C in 1/s."""
    s_squared: np.ndarray
    """Factor of M in 1/s2, the instant of the inertia included."""
    initial_load: np.ndarray
    """What multiplies the load f0 at time 0 beside its own transform, for a start from rest with a0 = M^-1 f0."""
    initial_damping: np.ndarray
    """What multiplies C a0, in s."""


def hilber_hughes_taylor(alpha: float) -> Scheme:
    """Return the method of Hilber, Hughes and Taylor with dissipation 0 <= alpha <= 1/3 (second order, 0: none)."""
    if not 0 <= alpha <= 1 / 3:
        raise ModelError("alpha", f"expected >= 0 and <= 1/3, got {alpha!r}")
    return Scheme((1 + alpha) ** 2 / 4, 0.5 + alpha, 0.0, alpha)


def generalised_alpha(rho_infinity: float) -> Scheme:
    """Return the generalised-alpha method with spectral radius 0 <= rho_infinity <= 1 at high frequency (1: no dissipation)."""
    if not 0 <= rho_infinity <= 1:
        raise ModelError("rho_infinity", f"expected >= 0 and <= 1, got {rho_infinity!r}")
    alpha_m = (2 * rho_infinity - 1) / (rho_infinity + 1)
    alpha_f = rho_infinity / (rho_infinity + 1)
    return Scheme((1 - alpha_m + alpha_f) ** 2 / 4, 0.5 - alpha_m + alpha_f, alpha_m, alpha_f)
