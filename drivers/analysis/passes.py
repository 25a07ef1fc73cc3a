"""The published passes that a request asks for."""

from __future__ import annotations

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.scene.request import Request
from uplift.solvers.contact.published_passes import Passes, published_passes

FEW = 10
"""So many passes are all kept; of more, the first and the last two."""


def run_passes(solve, assembly: AssembledScene, request: Request) -> Passes:  # type: ignore[no-untyped-def]  # the callable of published_passes
    """Run the published passes that a request asks for."""
    assert request.passes is not None
    law = assembly.operators.contacts.law
    return published_passes(solve, law, request.passes, tolerance=request.tolerance, keep_all=request.passes <= FEW)
