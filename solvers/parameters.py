"""Parameters of the solution methods."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.checked import Checked, ModelError, quantity


@dataclass(frozen=True)
class Scheme(Checked):
    """Parameters of the scheme; the defaults are the average-acceleration (trapezoidal) rule."""

    beta: float = quantity("weight of the new acceleration in the displacement", default=0.25, above=0.0, at_most=1.0)
    gamma: float = quantity("weight of the new acceleration in the velocity", default=0.5, at_least=0.5, at_most=2.0)

    def check(self) -> None:
        """Refuse parameters that are only conditionally stable: the joints' frequencies exceed any limit."""
        if 2 * self.beta < self.gamma:
            raise ModelError("beta", f"expected >= gamma / 2 = {self.gamma / 2:g} for unconditional stability, got {self.beta:g}")


@dataclass(frozen=True)
class Window(Checked):
    """The window of the discrete Fourier transform and the band that is solved."""

    length: float = quantity("length of the window", "s", above=0.0)
    samples: int = quantity("samples in the window, even", at_least=2)
    cutoff: float = quantity("highest frequency solved", "Hz", above=0.0)

    def check(self) -> None:
        """The number of samples is even and the band lies below the Nyquist frequency."""
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
