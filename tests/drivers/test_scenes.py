"""The scenes of plates and boxes that ship, by every method."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.analysis import prepare
from drivers.methods import analyse
from drivers.request import Request
from drivers.scene import Modal, read_scene
from tests.conftest import SCENES


def shortened(name, duration):
    """The scene with twice its step and an end just after the largest uplift."""
    scene = read_scene(SCENES / f"{name}.toml")
    return replace(scene, transient=replace(scene.transient, step=2 * scene.transient.step, duration=duration))


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
@pytest.mark.parametrize(("name", "duration"), [("raft", 0.6), ("box", 0.75)])
def test_transient_and_sweep_agree(name, duration, comm):
    lifted, ((motion, force),) = agreement(shortened(name, duration), comm, [Request("transient"), Request("time-frequency")])
    assert lifted > 1e3
    # As for the reference case: the sweep's own accuracy is some 1e-10.
    assert motion < 1e-8 and force < 1e-7


@pytest.mark.parametrize(("name", "duration"), [("raft", 0.6), ("box", 0.75)])
def test_transient_modes_and_basis_agree(name, duration, comm):
    """A Krylov basis to its tolerance; modes with static answers to what lies above the band that they end at."""
    scene = replace(shortened(name, duration), modal=Modal(number=30))
    requests = [Request("transient"), Request("transient", basis=1e-7), Request("time-frequency", basis=1e-7), Request("modal")]
    lifted, (basis, sweep, modal) = agreement(scene, comm, requests)
    assert lifted > 1e3
    assert max(basis) < 1e-5 and max(sweep) < 1e-5
    assert modal[0] < 1e-3 and modal[1] < 1e-2
