"""How far a growing Krylov basis has come: residuals at test frequencies, from small matrices alone."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uplift.solvers.bases.between import Between
from uplift.solvers.dense import solve_definite

STANDSTILL = 0.3
"""A block that leaves more than this part of the residual has come to the end of what blocks can do; usually it leaves a tenth."""


@dataclass
class Growth:
    """How a basis came about."""

    order: int = 1
    """Of the Krylov space: 1, or 2 where damping takes part."""
    columns: int = 0
    """Columns of the starting block."""
    sizes: list[int] = field(default_factory=list)
    """Vectors after each block."""
    residual: list[float] = field(default_factory=list)
    """Largest relative dual norm of the residual over test frequencies and columns, of the basis without its last block."""
    change: list[float] = field(default_factory=list)
    """Largest relative change of a transfer function by the last block."""
    checked: list[tuple[float, float]] = field(default_factory=list)
    """(Hz, relative dual norm of the true residual of the finished basis, root sum of squares of all columns)."""
    solves: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    """Wall seconds: factorisation, solves, orthonormalisation, projection, estimate."""

    @property
    def estimate(self) -> float:
        """The stated error: relative dual norm of the true residual where it was measured."""
        return max((value for _, value in self.checked), default=0.0)


class Estimator:
    """Measures a basis without its last block in the coordinates of the whole."""

    def __init__(self, between: Between, omega: np.ndarray, tolerance: float, growth: Growth) -> None:
        """Take the test frequencies `omega` (n,) in rad/s and the tolerance; what is measured goes into `growth`."""
        self._between, self.omega, self._tolerance, self._growth = between, omega, tolerance, growth
        self.worst = float(omega[-1])
        """rad/s, where the residual was largest."""
        self._answers: list[np.ndarray] = []
        """Coordinates of the answers at the test frequencies in the basis that was measured last."""

    def measure(self, before: int) -> None:
        """Measure the basis of the first `before` vectors in the coordinates of the whole."""
        between = self._between
        shifted, size = between.shifted_sizes()
        outputs = np.sqrt(np.einsum("oj,jo->o", between.observed, solve_definite(shifted, between.observed.T, "Krylov basis")))
        scale = np.outer(np.where(outputs > 0, outputs, 1.0), size)
        rests, answers, change = [], [], 0.0
        for i, omega in enumerate(self.omega):
            dynamic = between.dynamic(omega)
            # The larger basis of one block is the smaller one of the next.
            known = self._answers[i] if self._answers else np.zeros((0, 0))
            smaller = known if len(known) == before else np.linalg.solve(dynamic[:before, :before], between.generalised[:before])
            answers.append(np.linalg.solve(dynamic, between.generalised))
            rests.append(split_complex(between.generalised - dynamic[:, :before] @ smaller))
            difference = between.observed @ answers[-1] - between.observed[:, :before] @ smaller
            change = max(change, float(np.max(np.abs(difference) / scale, initial=0.0)))
        self._answers = answers
        rest = np.hstack(rests)
        square = np.einsum("ij,ij->j", rest, solve_definite(shifted, rest, "Krylov basis"))
        residuals = np.max(np.sqrt(np.maximum(square.reshape(len(rests), 2, -1).sum(axis=1), 0.0)) / size, axis=1)
        self._growth.residual.append(float(np.max(residuals)))
        self.worst = float(self.omega[int(np.argmax(residuals))])
        self._growth.change.append(change)

    def promising(self) -> bool:
        """Whether the true residual is worth measuring: the estimates, carried on, meet the tolerance, or they have come to a stand.

        They stand still where what is left is the share of the stiff springs, which the last vectors bring in.
        """
        residual = self._growth.residual
        if len(residual) < 3 - (self._growth.order == 1):
            return bool(residual) and residual[-1] <= self._tolerance
        if self._growth.order == 2:  # every second block gains more
            return residual[-1] * min(residual[-1] / residual[-3], 1.0) ** 0.5 <= self._tolerance
        gain = residual[-1] / residual[-2]
        stands = gain > STANDSTILL and residual[-1] < 1e-2
        return stands or residual[-1] * min(gain, 1.0) <= self._tolerance


def split_complex(values: np.ndarray) -> np.ndarray:
    """Return the real parts of all columns, and then the imaginary ones."""
    return np.hstack([values.real, values.imag])
