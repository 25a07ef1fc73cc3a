"""A harmonic answer says what amplitude of which load it is for."""

import json
from pathlib import Path

import pytest
from mpi4py import MPI

from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.scene.scene import build_scene
from uplift.drivers.studies.harmonic_files import respond

SCENE = {
    "mesh": {"width": 1.0, "height": 1.0, "nx": 1, "ny": 1},
    "plate": {"young": 1e12, "poisson": 0.0, "density": 1000.0, "thickness": 1.0},
    "kinematics": {"kind": "plane stress"},
    "springs": [{"name": "S", "points": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], "stiffness": {"X": 1e6, "Y": 1e6}}],
    "load": [
        {"direction": "X", "signal": "step", "amplitude": 5.0},
        {"kind": "force", "name": "PULL", "points": [[0.0, 0.0], [0.0, 1.0]], "force": {"X": 1.5}, "signal": "step"},
    ],
    "probes": [{"name": "A", "point": [0.0, 0.0]}],
    "harmonic": {"frequencies": [1.0]},
}


@pytest.mark.complex
def test_answers_say_what_they_are_per(tmp_path):
    """A rigid tonne on 4e6 N/m at 1 Hz: u = f / (k - m omega^2), f = 1000 kg times 1 m/s2, or 3 N."""
    (tmp_path / "out").mkdir()
    with prepare(build_scene(SCENE, Path()), MPI.COMM_WORLD) as assembly:
        lines = respond(assembly, tmp_path / "out", plots=False)
    assert any("ground motion" in line and "per m/s2" in line for line in lines)
    assert any("PULL" in line and "in N" in line for line in lines)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert set(summary["answers_are"]) == {"ground motion", "PULL"}
    stiffness = 4e6 - 1000 * (2 * 3.141592653589793) ** 2
    moduli = [summary["peaks"][f"{load}: A.DX"]["modulus"] for load in ("ground motion", "PULL")]
    assert moduli == pytest.approx([1000 / stiffness, 3 / stiffness], rel=1e-3)
