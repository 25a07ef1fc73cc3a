"""The plate on compression-only springs as a bare loop in numpy and scipy. Runs by itself: python peer_scipy.py PROBLEM.npz ANSWER.npz.

It imports nothing of this project: the least that the problem costs in Python. Newmark's average acceleration with every spring
bonded and one sparse factorisation; the forces that open springs must not carry follow at each step from the small problem of the contacts.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu


def element(size: np.ndarray, young: float, poisson: float, density: float, thickness: float) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and consistent mass (8, 8) of a rectangle of plane stress with sides `size` (2,) m, corners counter-clockwise."""
    law = young / (1 - poisson**2) * np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]])
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    area, stiffness, mass = size[0] * size[1], np.zeros((8, 8)), np.zeros((8, 8))
    for xi in signs / np.sqrt(3):
        factors = (1 + signs * xi) / 2
        slopes = signs / size * factors[:, ::-1]
        strain = np.zeros((3, 8))
        strain[0, 0::2], strain[1, 1::2], strain[2, 0::2], strain[2, 1::2] = slopes[:, 0], slopes[:, 1], slopes[:, 1], slopes[:, 0]
        shape = np.kron(factors.prod(axis=1), np.eye(2))
        stiffness += area / 4 * thickness * strain.T @ law @ strain
        mass += area / 4 * thickness * density * shape.T @ shape
    return stiffness, mass


def assemble(p: dict[str, Any]) -> tuple[Any, Any, Any, np.ndarray]:
    """Return stiffness with every spring, plate's stiffness and mass (free dofs) and the rows (n_nodes, 2) of the dofs, -1 if held."""
    free = np.ones((len(p["nodes"]), 2), dtype=bool)
    free[p["held_sideways"], 0] = False
    rows = np.where(free, np.cumsum(free.ravel()).reshape(free.shape) - 1, -1)
    corners = p["nodes"][p["cells"][0]]
    blocks = element(corners[2] - corners[0], *(float(p[k]) for k in ("young", "poisson", "density", "thickness")))
    dofs = rows[p["cells"]].reshape(len(p["cells"]), 8)
    i, j = np.repeat(dofs, 8, axis=1).ravel(), np.tile(dofs, (1, 8)).ravel()
    kept, n = (i >= 0) & (j >= 0), int(free.sum())
    plate, mass = (sparse.csc_matrix((np.tile(b.ravel(), len(dofs))[kept], (i[kept], j[kept])), shape=(n, n)) for b in blocks)
    diagonal = np.zeros(n)
    for kind in ("contact", "spring"):
        np.add.at(diagonal, rows[p[f"{kind}_nodes"], 1], p[f"{kind}_stiffness"])
    return (plate + sparse.diags(diagonal)).tocsc(), plate, mass, rows


def factorise(matrix: Any) -> Any:
    """Return the factors of a symmetric positive definite matrix."""
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def release(tension: np.ndarray, compliance: np.ndarray, opened: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the forces (n_c,) N that open contacts must be spared, and which are open, from the tensions (n_c,) N of the bonded ones.

    `compliance` (n_c, n_c): tension per unit force.
    """
    for _ in range(50):
        forces = np.zeros(len(tension))
        if opened.any():
            forces[opened] = np.linalg.solve((np.eye(len(tension)) - compliance)[np.ix_(opened, opened)], tension[opened])
        left = tension + compliance @ forces
        wrong = np.where(opened, forces < 0, left > 1e-12 * np.abs(tension).max())
        if not wrong.any():
            return forces, opened
        opened = opened ^ wrong
    raise SystemExit("the open contacts of a step cannot be found")


def memory(kind: str) -> int:
    """Return the present (VmRSS) or the largest (VmHWM) memory of this process in bytes."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(kind))


def main(problem: str, answer: str) -> None:
    """Solve the problem and write histories and seconds."""
    before = memory("VmRSS")
    p = dict(np.load(problem))
    step, steps = float(p["step"]), int(p["steps"])
    marks = [time.perf_counter()]
    stiffness, plate, mass, rows = assemble(p)
    damping = float(p["alpha"]) * plate + float(p["beta"]) * mass
    marks.append(time.perf_counter())
    n, at, k = mass.shape[0], rows[p["contact_nodes"], 1], p["contact_stiffness"]
    unit = np.zeros((n, len(at)))
    unit[at, np.arange(len(at))] = 1.0
    weight, inertia = np.zeros(n), np.zeros(n)
    weight[rows[:, 1]] = -float(p["gravity"]) * p["nodal_mass"]
    sideways = rows[:, 0] >= 0
    inertia[rows[sideways, 0]] = p["nodal_mass"][sideways]
    factors = factorise(stiffness)
    answers = factors.solve(unit)
    u = factors.solve(weight)
    forces, opened = release(k * u[at], k[:, None] * answers[at], np.zeros(len(at), dtype=bool))
    u, v, a = u + answers @ forces, np.zeros(n), np.zeros(n)
    factors = factorise(mass + step / 2 * damping + step**2 / 4 * stiffness)
    answers = factors.solve(unit)
    compliance = step**2 / 4 * k[:, None] * answers[at]
    stiffness, damping = stiffness.tocsr(), damping.tocsr()
    marks.append(time.perf_counter())
    looks = np.append(rows[int(p["probe"])], rows[p["observed_nodes"], 1])
    seen = np.zeros((steps + 1, len(looks)))
    seen[0] = u[looks]
    for m in range(1, steps + 1):
        u += step * v + step**2 / 4 * a
        v += step / 2 * a
        a = factors.solve(weight - p["acceleration"][m] * inertia - damping @ v - stiffness @ u)
        forces, opened = release(k * (u[at] + step**2 / 4 * a[at]), compliance, opened)
        if opened.any():
            a += answers[:, opened] @ forces[opened]
        u += step**2 / 4 * a
        v += step / 2 * a
        seen[m] = u[looks]
    marks.append(time.perf_counter())
    np.savez(answer, probe=seen[:, :2], rise=seen[:, 2:], seconds=np.diff(marks), memory=[before, memory("VmHWM")], dofs=n)


if __name__ == "__main__":
    main(*sys.argv[1:])
