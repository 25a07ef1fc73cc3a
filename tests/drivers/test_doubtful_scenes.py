"""What is said of scenes that may not be meant, each with its figure, and that the scenes that ship are not spoken of."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from uplift.drivers.analysis.answer_findings import between_instants
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.analysis.crowded_supports import say_crowded_supports
from uplift.drivers.scene.cautions import scene_cautions
from uplift.drivers.scene.scene import build_scene, read_scene

SCENES = Path(__file__).parents[2] / "drivers" / "scenes"
SUPPORT = {"name": "S", "points": [[0.0, 0.0], [2.0, 0.0]], "stiffness": {"X": 1e8, "Y": 1e8}, "contact": {"X": 1e12, "Y": 1e12}}
SCENE = {
    "mesh": {"width": 2.0, "height": 2.0, "nx": 2, "ny": 2},
    "plate": {"young": 3e10, "poisson": 0.2, "density": 2500.0, "thickness": 0.3},
    "gravity": {"acceleration": 9.81},
    "supports": [SUPPORT],
    "load": [{"direction": "X", "signal": "sine", "frequency": 1.0}],
    "probes": [{"name": "A", "point": "P3"}],
    "transient": {"step": 0.005, "duration": 1.0, "every": 2},
}
NEW = {"units", "soft contact", "rocking", "instants"}


def said(**sections):
    return {one.key: one.text for one in scene_cautions(build_scene(SCENE | sections, Path())) if one.key in NEW}


@pytest.mark.parametrize(
    ("sections", "key", "words"),
    [
        ({"plate": SCENE["plate"] | {"density": 2.5}}, "units", "2.5 kg/m3"),
        ({"plate": SCENE["plate"] | {"young": 30000.0}}, "units", "30000 Pa"),
        ({"gravity": {"acceleration": 9810.0}}, "units", "9810 m/s2"),
        ({"supports": [SUPPORT | {"contact": {"X": 1e12, "Y": 1e7}}]}, "soft contact", "1e+07 N/m, softer than its spring of 1e+08 N/m"),
        ({"load": [{"direction": "RZ", "signal": "sine", "frequency": 1.0}]}, "rocking", "about (0, 0, 0) m"),
        ({"output": {"instants": [0.5, 2.0]}}, "instants", "1 of 2 lie beyond the end at 1 s, such as 2 s"),
        ({"output": {"instants": [0.505, 0.5]}}, "instants", "1 of 2 are not archived, every 0.01 s, such as 0.505 s"),
    ],
)
def test_slips_are_said_with_their_figure(sections, key, words):
    found = said(**sections)
    assert list(found) == [key] and words in found[key]


@pytest.mark.parametrize("name", sorted(path.stem for path in SCENES.glob("*.toml")))
def test_scenes_that_ship_are_not_spoken_of(name):
    assert not NEW & {one.key for one in scene_cautions(read_scene(SCENES / f"{name}.toml"))}


def test_what_is_meant_is_not_spoken_of():
    rocking = {"direction": "RZ", "center_of_rotation": [1.0, 0.0], "signal": "sine", "frequency": 1.0}
    assert not said(load=[rocking], output={"instants": [0.5, 1.0]})


@pytest.mark.parametrize(
    ("springs", "words"),
    [
        ([], ""),
        ([{"name": "T", "points": [[0.0, 0.0]], "stiffness": {"RZ": 1e6}}], ""),
        ([{"name": "T", "points": [[0.0, 0.0]], "stiffness": {"Y": 1e6}}], "S.1 and T.1 stand on one node"),
        ([{"name": "T", "points": [[2.0, 2.0], [2.0, 2.0], [0.0, 2.0]], "stiffness": {"Y": 1e6}}], "T.1 and T.2 stand on one node"),
    ],
)
def test_springs_on_one_node_are_said(springs, words, caplog):
    with prepare(build_scene(SCENE | {"springs": springs}, Path()), MPI.COMM_WORLD) as assembly:
        caplog.clear()
        say_crowded_supports(assembly)
    assert (words in caplog.text) if words else not caplog.records


def test_peaks_between_archived_instants():
    """A cosine archived at 60 degrees before and after its peak, and at 60 degrees to both sides: cos 30 of the peak is seen at best."""
    coarse = np.cos(np.radians(30 + 60 * np.arange(12)))[:, None]
    (found,) = between_instants(coarse, 8)
    # The parabola through cos 90, cos 30 and cos -30 = 0, 0.866, 0.866 has its top half way between the latter, 0.433^2 / 2 / 0.866 higher.
    assert f"{0.433**2 / 2 / 0.866 / 0.866:.1%}" in found.text and "every 8 steps" in found.text
    assert not list(between_instants(np.cos(np.radians(3 + 6 * np.arange(120)))[:, None], 2))
