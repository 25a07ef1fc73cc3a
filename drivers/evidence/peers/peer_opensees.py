"""The plate on compression-only springs in OpenSeesPy. Runs by itself: python peer_opensees.py PROBLEM.npz ANSWER.npz.

It imports nothing of this project. Elements: `quad` for the stiffness, which knows a lumped mass only, and on the same nodes `bbarQuad`
with next to no stiffness for the consistent mass; supports: zero-length springs of the material ENT, which carries compression only, ground
node first. The ground motion acts as nodal loads -M 1_x a(t). Rayleigh damping, with the initial stiffness, on the plate alone.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import openseespy.opensees as ops  # type: ignore[import-not-found]  # in the peers' own environment

NO_STIFFNESS = 1e-9
"""Part of Young's modulus that the elements have which are there for their mass."""
BANDED = 1000
"""Dofs up to which the banded Cholesky solver is quicker than MUMPS."""
TOLERANCE = 1e-6
"""N: norm of the unbalanced forces at which a step ends."""


def build(p: dict[str, Any]) -> None:
    """Build the plate, its springs and its static loads."""
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 2)
    for i, (x, y) in enumerate(p["nodes"], start=1):
        ops.node(i, float(x), float(y))
    for i in p["held_sideways"]:
        ops.fix(int(i) + 1, 1, 0)
    young, poisson, thickness, density = (float(p[k]) for k in ("young", "poisson", "thickness", "density"))
    ops.nDMaterial("ElasticIsotropic", 1, young, poisson)
    ops.nDMaterial("ElasticIsotropic", 2, NO_STIFFNESS * young, poisson, density)
    n = len(p["cells"])
    for e, cell in enumerate(p["cells"] + 1, start=1):
        corners = [int(i) for i in cell]
        ops.element("quad", e, *corners, thickness, "PlaneStress", 1)
        ops.element("bbarQuad", n + e, *corners, thickness, 2)
    ops.region(1, "-eleRange", 1, 2 * n, "-rayleigh", float(p["beta"]), 0.0, float(p["alpha"]), 0.0)
    ground, element, material = len(p["nodes"]) + 1, 2 * n + 1, 3
    for kind, springs in (("ENT", "contact"), ("Elastic", "spring")):
        for i, k in zip(p[f"{springs}_nodes"], p[f"{springs}_stiffness"], strict=True):
            x, y = p["nodes"][i]
            ops.node(ground, float(x), float(y))
            ops.fix(ground, 1, 1)
            ops.uniaxialMaterial(kind, material, float(k))
            ops.element("zeroLength", element, ground, int(i) + 1, "-mat", material, "-dir", 2)
            ground, element, material = ground + 1, element + 1, material + 1
    ops.timeSeries("Constant", 1)
    ops.pattern("Plain", 1, 1)
    for i, mass in enumerate(p["nodal_mass"], start=1):
        ops.load(i, 0.0, -float(mass * p["gravity"]))


def analysis(dofs: int, integrator: tuple, kind: str) -> None:
    """Set up Newton's method with one of the direct solvers."""
    ops.wipeAnalysis()
    ops.constraints("Plain")
    ops.numberer("RCM")
    ops.system("BandSPD" if dofs <= BANDED else "Mumps")
    ops.test("NormUnbalance", TOLERANCE, 50)
    ops.algorithm("Newton")
    ops.integrator(*integrator)
    ops.analysis(kind)


def memory(kind: str) -> int:
    """Return the present (VmRSS) or the largest (VmHWM) memory of this process in bytes."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(kind))


def main(problem: str, answer: str) -> None:
    """Solve the problem and write histories and seconds."""
    before = memory("VmRSS")
    p = dict(np.load(problem))
    step, steps, dofs = float(p["step"]), int(p["steps"]), 2 * len(p["nodes"]) - len(p["held_sideways"])
    marks = [time.perf_counter()]
    build(p)
    marks.append(time.perf_counter())
    analysis(dofs, ("LoadControl", 1.0), "Static")
    if ops.analyze(1) != 0:
        raise SystemExit("the static analysis of OpenSees failed")
    ops.loadConst("-time", 0.0)
    ops.timeSeries("Path", 2, "-dt", step, "-values", *(float(a) for a in p["acceleration"]))
    ops.pattern("Plain", 2, 2)
    for i, mass in enumerate(p["nodal_mass"], start=1):
        ops.load(i, -float(mass), 0.0)
    analysis(dofs, ("Newmark", 0.5, 0.25), "Transient")
    marks.append(time.perf_counter())
    probe, observed = int(p["probe"]) + 1, [int(i) + 1 for i in p["observed_nodes"]]
    seen = np.zeros((steps + 1, 2 + len(observed)))
    for n in range(steps + 1):
        if n > 0 and ops.analyze(1, step) != 0:
            raise SystemExit(f"step {n} of OpenSees failed")
        seen[n, :2] = ops.nodeDisp(probe)
        seen[n, 2:] = [ops.nodeDisp(i, 2) for i in observed]
    marks.append(time.perf_counter())
    np.savez(answer, probe=seen[:, :2], rise=seen[:, 2:], seconds=np.diff(marks), memory=[before, memory("VmHWM")], dofs=dofs)


if __name__ == "__main__":
    main(*sys.argv[1:])
