"""Parameters of the generalised-alpha family of time integration."""

from __future__ import annotations

from dataclasses import dataclass

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
