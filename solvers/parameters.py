"""Parameters of the solution methods."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.checked import Checked, ModelError, quantity


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


@dataclass(frozen=True)
class Window(Checked):
    """The window of the discrete Fourier transform and the band that is solved."""

    length: float = quantity("length of the window", "s", above=0.0, at_most=1e9)
    samples: int = quantity("samples in the window, even", at_least=2, at_most=100_000_000)
    cutoff: float = quantity("highest frequency solved", "Hz", above=0.0)

    def check(self) -> None:
        """Refuse an odd number of samples and a band beyond the Nyquist frequency."""
        if self.samples % 2:
            raise ModelError("samples", f"expected an even number, got {self.samples}")
        nyquist = self.samples / (2 * self.length)
        if self.cutoff > nyquist:
            raise ModelError("cutoff", f"expected <= {nyquist:g} Hz, half the sampling rate, got {self.cutoff:g}")

    @property
    def times(self) -> np.ndarray:
        """Instants (samples,) s."""
        return self.length / self.samples * np.arange(self.samples)

    @property
    def frequencies(self) -> np.ndarray:
        """Solved frequencies (n_f,) Hz, from 0 to the cutoff in steps of 1 / length."""
        return np.arange(int(np.floor(self.cutoff * self.length * (1 + 1e-12))) + 1) / self.length


@dataclass(frozen=True)
class KrylovSettings(Checked):
    """The Krylov basis in which reduced runs live."""

    tolerance: float = quantity("relative residual that the basis is grown to", default=1e-6, above=0.0, below=1.0)
    band: float = quantity("highest frequency that it is tested at", "Hz", default=25.0, above=0.0)
    shift: float = quantity("sigma in K + sigma M; above zero for a structure that can move without strain", "rad2/s2",
                            default=0.0, at_least=0.0)
    blocks: int = quantity("blocks at most", default=40, at_least=2)
    tests: int = quantity("frequencies that it is tested at", default=12, at_least=1)

    @property
    def test_frequencies(self) -> np.ndarray:
        """Test frequencies (tests,) Hz, up to the end of the band and closer towards it."""
        return self.band * np.sin(0.5 * np.pi * np.arange(1, self.tests + 1) / self.tests)
