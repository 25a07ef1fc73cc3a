"""Integration in time of an assembled scene on its modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uplift.drivers.analysis.assembled_scene import Analysis
from uplift.drivers.analysis.task import Task
from uplift.drivers.analysis.transient import run_transient
from uplift.meshes.findings import say
from uplift.solvers.contact.auxiliary_nodes import AuxiliaryNodes


def run_modal(task: Task) -> Analysis:
    """Find the modes, project the scene on them and march (collective)."""
    from uplift.solvers.bases.modes import modes
    from uplift.solvers.bases.project import project
    from uplift.solvers.bases.static_answers import with_static_answers

    modal, operators = task.assembly.scene.modal, task.operators
    assert modal is not None
    with task.assembly.clock.phase("modes"):
        found = modes(operators, number=modal.number, band=modal.band, shift=modal.shift)
        basis = found.basis
        if modal.static_correction:
            heavy = AuxiliaryNodes(operators.contacts.law, task.settings.step).any
            basis = with_static_answers(operators, basis, shift=found.shift, joints=heavy)
        elif task.exact and operators.contacts.names:
            say("modes alone", "modes alone give the contact forces badly and exact uplift with them: set modal.static_correction = true")
        small = project(operators, basis, diagonal=modal.diagonal)
    notes = {
        "modes": found.number,
        "basis_vectors": basis.size,
        "frequencies_Hz": found.frequencies.tolist(),
        "largest_mode_residual": float(np.max(found.residuals, initial=0.0)),
        "orthonormality": found.orthonormality,
        "sturm_count": found.sturm.inside,
    }
    with small:
        return run_transient(replace(task, operators=small, notes=notes))
