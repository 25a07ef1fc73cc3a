"""One analysis: what is asked, of which model, and who looks on."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.analysis.snapshots import Snapshots
from uplift.drivers.scene.analysis import Transient
from uplift.drivers.scene.request import Request
from uplift.forms.operators import Operators
from uplift.solvers.watch import Watch


@dataclass(frozen=True)
class Task:
    """What a method of analysis is given."""

    assembly: AssembledScene
    operators: Operators
    """The model that is solved: that of the scene, or its projection on a basis."""
    request: Request
    snapshots: Snapshots | None = None
    """Takes the deformed plate at some instants, if given."""
    groups: int | None = None
    """Groups of ranks that share a sweep; None: chosen from the sizes."""
    watch: Watch | None = None
    """Shows the progress of long loops and keeps their checkpoints."""
    rigid_modes: np.ndarray | None = None
    """(k, n_local): where given, the systems of a transient run are solved iteratively."""
    notes: dict[str, Any] = field(default_factory=dict)
    """Facts for the summary that are known before."""

    @property
    def exact(self) -> bool:
        """Whether uplift is solved exactly, not by the published passes."""
        return self.request.passes is None

    @property
    def reduced(self) -> bool:
        """Whether the model lives in a basis."""
        return self.operators.reduction is not None

    @property
    def settings(self) -> Transient:
        """The settings of the integration in time, which the request has checked to be there."""
        settings = self.assembly.scene.transient
        assert settings is not None
        return settings
