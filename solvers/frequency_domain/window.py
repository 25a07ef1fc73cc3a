"""The window of the discrete Fourier transform."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.meshes.checked import Checked, ModelError, quantity


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
