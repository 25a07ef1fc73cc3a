"""What a checkpoint keeps of a part of a march."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Kept:
    """Arrays by their names, apart by how they lie on the ranks."""

    same: dict[str, np.ndarray] = field(default_factory=dict)
    """The same on all ranks."""
    shares: dict[str, np.ndarray] = field(default_factory=dict)
    """This rank's shares of sums over the ranks."""
    fields: dict[str, np.ndarray] = field(default_factory=dict)
    """This rank's rows (n_local, ...) of fields of the model, in all its dofs."""
