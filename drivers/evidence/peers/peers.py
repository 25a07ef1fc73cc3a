"""Peers on the same problem: OpenSeesPy in a virtual environment of its own, and a bare loop in scipy; each in a process of its own."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.evidence.pareto.cases import INSTANTS, MESH_STEP, SPREAD, Mesh, Run, edge_shares, foot, rectangle, spread
from uplift.drivers.evidence.pareto.errors import Trace, errors, open_time
from uplift.drivers.scene.scene import Scene
from uplift.meshes.plate import Plate

HERE = Path(__file__).parent
OWN, SCIPY, OPENSEES = "this project", "scipy loop", "OpenSeesPy"
SCRIPTS = {OPENSEES: HERE / "peer_opensees.py", SCIPY: HERE / "peer_scipy.py"}

FULL, PART = 20_000, 40
"""Dofs up to which OpenSeesPy makes all steps; beyond, so many, and the time of all is scaled from them."""


@dataclass(frozen=True)
class Measured:
    """One program on one mesh."""

    program: str
    mesh: Mesh
    dofs: int
    preparation: float
    """s: assembly, static state, factors."""
    march: float
    """s, of all steps."""
    libraries: float
    """Bytes of memory with the program's libraries loaded."""
    peak: float
    """Bytes at most."""
    trace: Trace | None
    """None where not all steps were made."""
    measured_steps: int
    steps: int


def problem(scene: Scene, mesh: Mesh, steps: int) -> dict[str, Any]:
    """Return what a peer needs: nodes, cells, material, loads and springs of the spread case on a mesh of rectangles.

    The joint of a support and its contact is condensed to one spring, without its point mass; sideways the foot is held.
    """
    own, plate, material = foot(scene), rectangle(scene), scene.model.material
    nx, ny = plate.nx * mesh.factor, plate.ny * mesh.factor
    x, y = np.meshgrid(np.linspace(0, plate.width, nx + 1), np.linspace(0, plate.height, ny + 1))
    first = (np.arange(nx) + (nx + 1) * np.arange(ny)[:, None]).ravel()
    weight = np.ones((ny + 1, nx + 1))
    weight[[0, -1]] /= 2
    weight[:, [0, -1]] /= 2
    cell_mass = material.density * material.thickness * plate.width * plate.height / (nx * ny)
    points, share = edge_shares(plate.width, nx, 1)
    total = own.stiffness[1] * len(own.points) * share / plate.width
    nodes = np.column_stack([x.ravel(), y.ravel()])

    def nearest(points: Any) -> np.ndarray:
        return np.linalg.norm(nodes[None] - np.array([p[:2] for p in points])[:, None], axis=2).argmin(axis=1)

    springs = [(point, spring.stiffness[1]) for spring in scene.model.springs for point in spring.points]
    times = MESH_STEP * np.arange(steps + 1)
    return {
        "nodes": nodes, "cells": first[:, None] + np.array([0, 1, nx + 2, nx + 1]), "nodal_mass": cell_mass * weight.ravel(),
        "young": material.young, "poisson": material.poisson, "density": material.density, "thickness": material.thickness,
        "alpha": material.alpha, "beta": material.beta, "gravity": scene.model.gravity,
        "acceleration": sum(motion.signal(times) for motion in scene.model.motions), "step": MESH_STEP, "steps": steps,
        "held_sideways": np.arange(nx + 1), "contact_nodes": np.arange(nx + 1), "contact_stiffness": 1 / (1 / total + 1 / own.contact[1]),
        "spring_nodes": nearest([point for point, _ in springs]), "spring_stiffness": np.array([k for _, k in springs]),
        "probe": nearest([scene.model.probes[0].point])[0], "observed_nodes": nearest(own.points),
    }


def on_points(given: dict[str, Any], scene: Scene) -> dict[str, Any]:
    """Return the problem with the supports where the scene has them, not spread over the edge."""
    own, feet = foot(scene), given["observed_nodes"]
    stiffness = 1 / (1 / own.stiffness[1] + 1 / own.contact[1])
    return given | {"held_sideways": feet, "contact_nodes": feet, "contact_stiffness": np.full(len(feet), stiffness)}


def misfit(scene: Scene) -> str:
    """Return what of the scene the peers' model does not have; empty if nothing."""
    own, model, plate = foot(scene), scene.model, rectangle(scene)
    checks = {
        "cells that are no bilinear rectangles": plate.cell != "quadrilateral" or plate.degree != 1,
        "another kind of plate than one in plane stress": scene.kinematics.kind not in ("", "plane stress"),
        "a gap or a preload": own.settlement != 0,
        "springs along or about other axes than Y": any(np.any(np.delete(spring.stiffness, 1)) for spring in model.springs),
        "springs or probes off the nodes": any(not _on_node(plate, p) for s in model.springs for p in s.points)
        or not _on_node(plate, model.probes[0].point),
        "a ground motion that is not along X": any(value != 0 for motion in model.motions for value in motion.direction[1:]),
        "a foot that can slide": own.stiffness[0] < 1e3 * own.stiffness[1],
    }
    return ", ".join(words for words, present in checks.items() if present)


def _on_node(plate: Plate, point: Any) -> bool:
    places = point[0] * plate.nx / plate.width, point[1] * plate.ny / plate.height
    return all(abs(place - round(place)) < 1e-9 for place in places)


def environment() -> Path:
    """Return the folder of OpenSeesPy's virtual environment, in the user's cache."""
    cache = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(cache) / "uplift" / "peers"


def opensees() -> tuple[str | None, str]:
    """Return the Python that has OpenSeesPy, made if it is not there yet, and its version; or None and what went wrong, in one line."""
    folder = environment()
    python = folder / "bin" / "python"
    asking = "from importlib.metadata import version; import numpy, openseespy.opensees; print(version('openseespy'))"
    try:
        if not python.exists():
            subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True, capture_output=True, text=True, timeout=120)
        found = subprocess.run([str(python), "-c", asking], capture_output=True, text=True, timeout=120)
        if found.returncode:
            install = [str(python), "-m", "pip", "install", "--quiet", "openseespy", "numpy"]
            subprocess.run(install, check=True, capture_output=True, text=True, timeout=600)
            found = subprocess.run([str(python), "-c", asking], check=True, capture_output=True, text=True, timeout=120)
        return str(python), found.stdout.split()[-1]
    except (subprocess.SubprocessError, OSError) as error:
        last = (getattr(error, "stderr", None) or str(error)).strip().splitlines()
        return None, last[-1] if last else "no message"


def answer_of(program: str, python: str, given: dict[str, Any]) -> dict[str, np.ndarray]:
    """Run a peer on a problem in a process of its own and return what it wrote. Raises `subprocess.CalledProcessError` if it fails."""
    with tempfile.TemporaryDirectory(prefix="uplift-peer-") as folder:
        files = [str(Path(folder) / name) for name in ("problem.npz", "answer.npz")]
        np.savez(files[0], **given)
        subprocess.run([python, str(SCRIPTS[program]), *files], check=True, capture_output=True, text=True)
        with np.load(files[1]) as loaded:
            return dict(loaded)


def run_peer(program: str, python: str, scene: Scene, mesh: Mesh, steps: int, measured: int) -> Measured:
    """Run a peer in a process of its own. Raises `subprocess.CalledProcessError` if it fails."""
    given = problem(scene, mesh, measured)
    answer = answer_of(program, python, given)
    tension = given["contact_stiffness"][given["observed_nodes"]] * answer["rise"]
    _, share = edge_shares(given["nodes"][:, 0].max(), len(given["held_sideways"]) - 1, 1)
    every = round(INSTANTS / MESH_STEP)
    trace = Trace(
        answer["probe"][::every], (np.maximum(-tension, 0.0) / share[given["observed_nodes"]])[::every], open_time(tension, MESH_STEP)
    )
    build, static, march = answer["seconds"]
    return Measured(
        program, mesh, int(answer["dofs"]), float(build + static), float(march * steps / measured),
        float(answer["memory"][0]), float(answer["memory"][1]), trace if measured == steps else None, measured, steps,
    )


def run_own(scene_path: Path, mesh: Mesh) -> Measured:
    """Run this project's Newmark method in a process of its own, as `measure_own` does."""
    with tempfile.TemporaryDirectory(prefix="uplift-peer-") as folder:
        into = Path(folder) / "answer"
        command = [sys.executable, "-m", "drivers", "pareto", str(scene_path), "--peer-mesh", str(mesh.factor), "--into", str(into)]
        subprocess.run(command, check=True, capture_output=True, text=True)
        measured: Measured = pickle.loads(into.read_bytes())
        return measured


def measure_own(scene: Scene, mesh: Mesh, comm: Any) -> Measured:
    """Measure this project's Newmark method here, everything after its libraries are loaded and its forms compiled."""
    from uplift.drivers.analysis.assembled_scene import prepare
    from uplift.drivers.evidence.pareto.runs import assemble, execute_once

    with prepare(spread(scene, Mesh()), comm):
        pass  # forms are compiled, or fetched from the cache, before the clock runs
    before = _memory("VmRSS")
    run = Run(SPREAD, "Newmark", mesh, MESH_STEP)
    with assemble(scene, SPREAD, mesh, comm) as model:
        prepared = sum(model.assembly.clock.seconds.values())
        outcome = execute_once(model, run)
    march = outcome.seconds["march"]
    assert scene.transient is not None
    steps = round(scene.transient.duration / MESH_STEP)
    return Measured(OWN, mesh, outcome.dofs, prepared + outcome.total - march, march, before, _memory("VmHWM"), outcome.trace, steps, steps)


def _memory(kind: str) -> float:
    """Return the present (VmRSS) or the largest (VmHWM) memory of this process in bytes."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(1024.0 * int(line.split()[1]) for line in lines if line.startswith(kind))


def without_joint_mass(scene: Scene) -> Scene:
    """Return the scene without the point masses between supports and contacts, which the peers' springs do not have."""
    supports = tuple(replace(support, mass=0.0) for support in scene.model.supports)
    return replace(scene, model=replace(scene.model, supports=supports))


def differences(measured: Sequence[Measured]) -> dict[tuple[str, Mesh], np.ndarray]:
    """Return how far each peer is from this project on the same mesh and step, (3,) relative."""
    own = {m.mesh: m.trace for m in measured if m.program == OWN and m.trace is not None}
    return {(m.program, m.mesh): errors(m.trace, own[m.mesh]) for m in measured if m.trace is not None and m.mesh in own}
