"""Outputs of a model: displacements of probes, lifted area."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from uplift.forms.assembly.compiled_forms import CompiledForms
from uplift.forms.assembly.full_space import FullSpace
from uplift.forms.assembly.numbering import Numbering
from uplift.forms.assembly.points import interpolation
from uplift.forms.contact.supports import AXES, TRANSLATIONS
from uplift.forms.operators import LiftedArea, OutputGroup, probe_group
from uplift.forms.parameters import PlateModel
from uplift.meshes.checked import ModelError


def lifted_area(forms: CompiledForms, field: FullSpace, numbering: Numbering, up: int) -> LiftedArea:
    """Return the shares of the area that belong to the vertical displacements of the nodes; none where nothing can lift off."""
    model, name = field.model, f"D{AXES[up]}"
    if name not in forms.components or not any(support.unilateral for support in model.supports):
        return LiftedArea(np.zeros(0, dtype=int), np.zeros(0), numbering.comm)
    try:
        weights = field.area(model.uplift_group)
    except ModelError as error:
        raise ModelError("output.uplift_group", error.message) from None
    rows = numbering.local_row[forms.components.index(name) :: len(forms.components)]
    total = numbering.comm.allreduce(float(weights.sum()))
    return LiftedArea(rows[rows >= 0], weights[rows >= 0] / total, numbering.comm)


def probe_outputs(forms: CompiledForms, numbering: Numbering, model: PlateModel) -> OutputGroup:
    """Return the displacements and rotations of the probes (collective)."""
    names: list[str] = []
    rows: list[int] = []
    columns: list[int] = []
    weights: list[float] = []
    block = len(forms.components)
    for probe in model.probes:
        try:
            nodes, shape = interpolation(forms.space, np.asarray(probe.point), f"probe {probe.name}")
        except ModelError as error:
            raise ModelError("probes", error.message) from None
        for column, component in enumerate(forms.components):
            if component[1:] not in AXES[:TRANSLATIONS] and not probe.rotations:
                continue
            local = numbering.local_row[block * nodes + column]
            free = local >= 0
            rows += [len(names)] * int(free.sum())
            columns += list(local[free])
            weights += list(shape[free])
            names.append(f"{probe.name}.{component}")
    local_rows = sparse.csr_matrix((weights, (rows, columns)), shape=(len(names), numbering.n_local))
    return probe_group(tuple(names), local_rows)
