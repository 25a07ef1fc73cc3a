"""Settings of the Krylov basis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.meshes.checked import Checked, quantity


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
