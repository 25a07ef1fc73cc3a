"""The scenes of plates and boxes that ship, by every method."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import SCENES
from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene, read_scene
from uplift.meshes.checked import ModelError


def shortened(name):
    """The scene with an end just after the largest uplift; the box with twice its step, to make the sweep shorter."""
    scene = read_scene(SCENES / f"{name}.toml")
    step, duration = {"raft": (0.005, 0.6), "box": (0.01, 0.75)}[name]
    return replace(scene, transient=replace(scene.transient, step=step, duration=duration))


def difference(one, other):
    return np.max(np.abs(one - other)) / np.max(np.abs(other))


def agreement(scene, comm, requests):
    """Largest difference of displacements and of contact forces of each request from the first one, relative."""
    with prepare(scene, comm) as assembly:
        histories = [analyse(assembly, request).final for request in requests]
        law = assembly.operators.contacts.law
        forces = [law.compression(law.tension(h.elongation), h.release) for h in histories]
        lifted = np.max(histories[0].release)
    pairs = zip(histories[1:], forces[1:], strict=True)
    return lifted, [(difference(h.probes, histories[0].probes), difference(f, forces[0])) for h, f in pairs]


@pytest.mark.complex
@pytest.mark.parametrize("name", [pytest.param("raft", marks=pytest.mark.ranks), "box"])
def test_transient_and_sweep_agree(name, comm):
    lifted, ((motion, force),) = agreement(shortened(name), comm, [Request("transient"), Request("time-frequency")])
    assert lifted > 1e3
    # As for the reference case: the sweep's own accuracy is some 1e-10.
    assert motion < 1e-8 and force < 1e-7


@pytest.mark.parametrize("name", ["raft", pytest.param("box", marks=pytest.mark.ranks)])
def test_transient_and_modes_agree(name, comm):
    """Modes with static answers agree to what lies above the frequency that they end at."""
    lifted, ((motion, force),) = agreement(shortened(name), comm, [Request("transient"), Request("modal")])
    assert lifted > 1e3
    assert motion < 1e-3 and force < 1e-2


@pytest.mark.ranks
def test_transient_and_basis_agree(comm):
    requests = [Request("transient"), Request("transient", basis=1e-7), Request("time-frequency", basis=1e-7)]
    lifted, (basis, sweep) = agreement(shortened("raft"), comm, requests)
    assert lifted > 1e3
    assert max(basis) < 1e-5 and max(sweep) < 1e-5


def large(dofs):
    table = tomllib.loads((SCENES / "large.toml").read_text(encoding="utf-8"))
    table["mesh"]["dofs"] = dofs
    return build_scene(table, SCENES)


def test_the_large_scene_by_its_basis(comm):
    requests = [Request("transient"), Request("transient", basis=1e-6), Request("time-frequency", basis=1e-6)]
    lifted, (basis, sweep) = agreement(large(1000), comm, requests)
    assert lifted > 1e3
    assert basis[0] < 1e-6 and sweep[0] < 1e-6
    assert max(basis[1], sweep[1]) < 1e-5


@pytest.mark.parametrize(("dofs", "factor"), [(0, 1), (306, 1), (307, 2), (1122, 2), (100_000, 20)])
def test_dofs_refine_by_the_least_factor(dofs, factor):
    mesh = large(dofs).plate
    assert (mesh.nx, mesh.ny) == (8 * factor, 16 * factor)
    assert 2 * (8 * factor + 1) * (16 * factor + 1) >= dofs
    assert factor == 1 or 2 * (8 * factor - 7) * (16 * factor - 15) < dofs


def test_dofs_of_a_bent_plate_and_of_joined_plates():
    tables = {name: tomllib.loads((SCENES / f"{name}.toml").read_text(encoding="utf-8")) for name in ("raft", "box")}
    coarse = {name: build_scene(table, SCENES).plate for name, table in tables.items()}
    for table in tables.values():
        table["mesh"]["dofs"] = 100_000
    raft, box = (build_scene(tables[name], SCENES).plate for name in ("raft", "box"))
    # Three dofs a node, nodes at corners, middles of sides and inside.
    assert 3 * (2 * raft.nx + 1) ** 2 >= 100_000 > 3 * (2 * (raft.nx - coarse["raft"].nx) + 1) ** 2
    assert coarse["box"].size / box.size == round(coarse["box"].size / box.size) > 1


@pytest.mark.parametrize("wrong", [-1, 10**10, 1.5, "many"])
def test_dofs_out_of_range_are_refused(wrong):
    with pytest.raises(ModelError, match="mesh.dofs"):
        large(wrong)
