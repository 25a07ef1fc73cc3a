"""The scenes of plates and boxes that ship, by every method."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.analysis import prepare
from drivers.methods import analyse
from drivers.request import Request
from drivers.scene import read_scene
from tests.conftest import SCENES


def shortened(name):
    """The scene with an end just after the largest uplift; the box with twice its step, to make the sweep shorter."""
    scene = read_scene(SCENES / f"{name}.toml")
    step, duration = {"raft": (0.005, 0.6), "box": (0.01, 0.75)}[name]
    return replace(scene, transient=replace(scene.transient, step=step, duration=duration))


def difference(one, other):
    return np.max(np.abs(one - other)) / np.max(np.abs(other))


def agreement(scene, comm, requests):
    """Largest difference of displacements and of contact forces of each request from the first one, relative."""
    with prepare(scene, comm) as plant:
        histories = [analyse(plant, request).final for request in requests]
        law = plant.operators.contacts.law
        forces = [law.compression(law.tension(h.elongation), h.release) for h in histories]
        lifted = np.max(histories[0].release)
    pairs = zip(histories[1:], forces[1:], strict=True)
    return lifted, [(difference(h.probes, histories[0].probes), difference(f, forces[0])) for h, f in pairs]


@pytest.mark.complex
@pytest.mark.parametrize("name", ["raft", "box"])
def test_transient_and_sweep_agree(name, comm):
    lifted, ((motion, force),) = agreement(shortened(name), comm, [Request("transient"), Request("time-frequency")])
    assert lifted > 1e3
    # As for the reference case: the sweep's own accuracy is some 1e-10.
    assert motion < 1e-8 and force < 1e-7


@pytest.mark.parametrize("name", ["raft", "box"])
def test_transient_and_modes_agree(name, comm):
    """Modes with static answers agree to what lies above the frequency that they end at."""
    lifted, ((motion, force),) = agreement(shortened(name), comm, [Request("transient"), Request("modal")])
    assert lifted > 1e3
    assert motion < 1e-3 and force < 1e-2


def test_transient_and_basis_agree(comm):
    requests = [Request("transient"), Request("transient", basis=1e-7), Request("time-frequency", basis=1e-7)]
    lifted, (basis, sweep) = agreement(shortened("raft"), comm, requests)
    assert lifted > 1e3
    assert max(basis) < 1e-5 and max(sweep) < 1e-5
