"""Transfer functions: answers of a model at some frequencies or Laplace points, as a sweep gives them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.forms.operators import Outputs


@dataclass(frozen=True)
class FieldResponse:
    """Whole fields at each point, their columns summed once for all instants."""

    spectrum: np.ndarray
    """(n_points, n_local)."""

    def at(self, weights: np.ndarray) -> np.ndarray:
        """Return this rank's part (n_local,) of the real part of the sum over all points times `weights` (n_points,)."""
        values: np.ndarray = np.real(weights @ self.spectrum)
        return values


@dataclass(frozen=True)
class Transfer:
    """Answers to unit loads and unit release forces at each point; columns: loads, then channels of the contacts."""

    outputs: np.ndarray
    """(n_points, n_rows, n_columns): the linear parts of the outputs."""
    layout: Outputs
    """The rows of `outputs`."""
    fields: np.ndarray | None
    """(n_points, n_columns, n_local) m: this rank's part of the solutions, where memory allows."""
    factor_seconds: float
    solve_seconds: float

    def group(self, name: str) -> np.ndarray:
        """Return the answers (n_points, n, n_columns) of one group of outputs."""
        return self.outputs[:, self.layout.layout[name]]

    @property
    def probes(self) -> np.ndarray:
        """Displacements and rotations of the probes (n_points, n_probes, n_columns) in m and rad."""
        return self.group("probes")

    @property
    def elongation(self) -> np.ndarray:
        """Elongations of the bonded contacts (n_points, n_channels, n_columns) m."""
        return self.group("elongation")

    def response(self, drive: np.ndarray) -> FieldResponse | None:
        """Return the fields that answer to amplitudes (n_points, n_columns) of the columns; None where no fields were kept."""
        return None if self.fields is None else FieldResponse(np.einsum("fj,fjn->fn", drive, self.fields))
