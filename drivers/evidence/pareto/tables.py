"""The tables of all runs and of the peers, as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

import numpy as np

from uplift.drivers.evidence.pareto.cases import SPREAD
from uplift.drivers.evidence.pareto.errors import QUANTITIES
from uplift.drivers.evidence.pareto.page import Study, peer_score


def tables(study: Study) -> dict[str, str]:
    """Return the tables of all runs and of the peers as CSV by the names of their files."""
    phases = list(dict.fromkeys(phase for o in study.outcomes for phase in o.seconds))
    runs = [["case", "method", "mesh", "degree", "dofs", "contacts", "step s", "band Hz", "window s", "modes", "residual", "vectors",
             "blocks", "passes", "ended", *(f"error of {name}" for name in QUANTITIES), *(f"{phase} s" for phase in phases), "total s",
             "factorisation unit s", "factorisations"]]
    for o, score in zip(study.outcomes, study.scored, strict=True):
        r, unit = o.run, study.unit(o)
        runs.append([str(v) for v in (
            r.case, r.method, r.mesh.name(study.scene), r.mesh.degree, o.dofs, o.contacts, f"{r.step:g}", *(_or_empty(v) for v in (
                r.band, r.window, r.size, r.tolerance, o.vectors, o.blocks, o.passes)), o.ended,
            *(f"{v:.1e}" if np.isfinite(v) else "" for v in score), *(f"{o.seconds[p]:.6f}" if p in o.seconds else "" for p in phases),
            f"{o.total:.6f}", f"{unit:.6f}", f"{o.total / unit:.3f}")])
    files = {f"{study.stem}.csv": _csv(runs)}
    if study.peers:
        rows = [["program", "mesh", "dofs", "preparation s", "march s", "measured steps", "steps", "libraries MB", "peak MB",
                 "error of displacement"]]
        for m in study.peers:
            sizes = f"{1e-6 * m.libraries:.1f}", f"{1e-6 * m.peak:.1f}", peer_score(m, study.references[SPREAD])
            rows.append([m.program, m.mesh.name(study.scene), str(m.dofs), f"{m.preparation:.6f}", f"{m.march:.6f}",
                         str(m.measured_steps), str(m.steps), *sizes])
        files[f"{study.stem}-peers.csv"] = _csv(rows)
    return files


def _or_empty(value: float | None) -> str:
    return "" if value is None else f"{value:g}"


def _csv(rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
