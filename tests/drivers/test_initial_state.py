"""States that a run begins from: a block across a gap, and what is given by hand."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene

BLOCK = {
    "mesh": {"width": 1.0, "height": 10.0, "nx": 1, "ny": 4},
    "plate": {"young": 1e9, "poisson": 0.0, "density": 1000.0, "thickness": 1.0},
    "kinematics": {"kind": "plane stress"},
    "supports": [{"name": "S", "points": [[0.0, 0.0], [1.0, 0.0]], "stiffness": {"Y": 1e15}, "contact": {"Y": 1e15}, "unilateral": "Y",
                  "gap": 0.05}],
    "load": [{"direction": "Y", "signal": "step", "amplitude": 9.81}],
    "probes": [{"name": "A", "point": [1.0, 10.0]}],
    "transient": {"step": 1e-3, "duration": 0.02},
}


def held_by(stiffness):
    return [{"name": "W", "points": [[0.0, 10.0], [1.0, 10.0]], "stiffness": {"X": stiffness, "Y": stiffness}}]


def run(method, **changes):
    table = BLOCK | changes
    scene = build_scene(table, Path())
    request = Request(method)
    request.check(scene)
    with prepare(scene, MPI.COMM_WORLD) as assembly:
        analysis = analyse(assembly, request)
        return analysis.final, assembly.operators.contacts.law


@pytest.mark.parametrize("method", ["transient", "exact"])
@pytest.mark.parametrize("stiffness", [1e-3, 1e3, 1e6])
@pytest.mark.parametrize("preload", [0.0, 1e4])
def test_at_rest_nothing_acts_across_a_gap(method, stiffness, preload):
    """Whatever holds the block, contacts across a gap stay open by the gap; a preload presses, and pushes up what it presses on."""
    support = BLOCK["supports"][0] | ({"gap": 0.0, "preload": preload, "stiffness": {"Y": 1e7}} if preload else {})
    history, law = run(method, springs=held_by(stiffness), supports=[support])
    if preload:
        # Under the block 2e7 N/m, above it 2 k in series with the block's own E A / L = 1e8 N/m.
        above = 1 / (1 / (2 * stiffness) + 1 / 1e8)
        top = 2 * preload / (2e7 + above) * 1e8 / (1e8 + 2 * stiffness)
        assert history.probes[0, 1] == pytest.approx(top, rel=1e-5)  # the contact of 1e15 N/m is taken for rigid
        return
    assert history.probes[0] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert history.openings(law)[0] == pytest.approx([0.05, 0.05], rel=1e-12)


@pytest.mark.ranks
@pytest.mark.both
def test_the_static_state_across_a_gap():
    history, law = run("static", springs=held_by(1e3))
    assert history.openings(law)[0] == pytest.approx([0.05, 0.05], rel=1e-12)
    assert history.probes[0] == pytest.approx([0.0, 0.0], abs=1e-12)


def fall(times):
    return -0.5 * 9.81 * times**2


@pytest.mark.parametrize("method", ["transient", "modal", "exact"])
@pytest.mark.parametrize("gap", [0.05, 0.001])
def test_a_block_that_is_let_go_above_its_supports_falls(method, gap):
    """Free fall until the gap is closed, at sqrt(2 gap / g): 101 ms or 14.3 ms; soft springs hold it sideways."""
    supports = [BLOCK["supports"][0] | {"gap": gap, "stiffness": {"Y": 1e7}, "contact": {"Y": 1e10}}]
    start = {"step": 1e-3, "duration": 0.02, "start": "rest"}
    history, law = run(method, transient=start, springs=held_by(10.0), supports=supports, modal={"number": 10})
    falling = fall(history.times) > -gap
    assert falling.sum() == (21 if gap == 0.05 else 15)
    assert history.probes[falling, 1] == pytest.approx(fall(history.times[falling]), rel=1e-5, abs=1e-9)
    expected = gap + fall(history.times[falling])
    assert history.openings(law)[falling] == pytest.approx(np.stack([expected, expected], axis=1), rel=1e-4, abs=1e-9)
    compression = law.compression(law.tension(history.elongation), history.release)
    assert np.all(np.abs(compression[falling]) < 1.0)
    assert bool(compression[~falling].max(initial=0.0) > 1e3) == (gap < 0.05)
