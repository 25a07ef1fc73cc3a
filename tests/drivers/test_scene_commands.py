"""The commands check and new."""

import json
import re

import numpy as np
import pytest

from tests.process import SCENE, child, drivers
from uplift.drivers.analysis.check import check_scene
from uplift.drivers.analysis.memory import GIB, expected_bytes
from uplift.drivers.scene.cautions import scene_cautions
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import read_scene
from uplift.drivers.scene.shipped import new_scene, shipped
from uplift.meshes.checked import ModelError


def texts(scene, method=""):
    return [finding.text for finding in scene_cautions(scene, method)]


def scene_of(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return read_scene(path)


@pytest.mark.ranks
def test_check_says_what_the_scene_is(comm, sdls119a):
    text = "\n".join(check_scene(sdls119a, comm, mesh=True))
    assert "rectangle of 4 m x 8 m, 4 x 8 quadrilaterals" in text
    assert "dofs        100 (meshed and assembled)" in text  # 45 nodes of 2, and 2 of each of 5 joints
    assert "plane stress, moves along DX, DY; 80,000.5 kg" in text  # 32 m2 of 2500 kg/m3, and 5 of 0.1 kg
    assert "RESS: 5 at points, push along Y and cannot pull" in text
    assert re.search(r"harmonic: +no; harmonic: missing", text)
    need = expected_bytes(sdls119a, Request("transient"), comm.size, None) / GIB
    assert f"transient:      yes, real PETSc, some {need:.2g} GiB; the scene's own" in text
    assert "doubt" not in text


def test_check_without_a_mesh_estimates(comm):
    for path in shipped().values():
        scene = read_scene(path)
        quick = "\n".join(check_scene(scene, comm, mesh=False))
        assert "dofs        some" in quick
        assert scene.title in quick


def test_check_finds_what_only_the_mesh_knows(comm, tmp_path):
    scene = scene_of(tmp_path, SCENE.read_text(encoding="utf-8").replace("count = 5", "count = 4"))
    check_scene(scene, comm, mesh=False)
    with pytest.raises(ModelError, match="stands on no node"):
        check_scene(scene, comm, mesh=True)


def test_check_on_the_command_line(tmp_path):
    done = child("check", SCENE)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[0].startswith("title ")
    bad = tmp_path / "bad scène.toml"
    bad.write_text(SCENE.read_text(encoding="utf-8").replace("thickness = 1.0", "thicknes = 1.0"), encoding="utf-8")
    done = drivers("check", bad)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"uplift: {bad}: plate.thickness: missing; expected a number (found 'thicknes': did you mean 'thickness'?)\n"


def test_new_copies_a_shipped_scene_once(tmp_path):
    done = child("new", tmp_path / "mon essai é", "--from", "raft")
    assert done.returncode == 0, done.stderr
    made = tmp_path / "mon essai é.toml"
    assert made.read_bytes() == shipped()["raft"].read_bytes()
    made.write_text("mine", encoding="utf-8")
    done = drivers("new", made)
    assert done.returncode == 2 and "is there already" in done.stderr and len(done.stderr.splitlines()) == 1
    assert made.read_text(encoding="utf-8") == "mine"
    assert drivers("new").returncode == 2
    listed = drivers("new", "--list").stdout
    assert all(name in listed for name in shipped())


def test_new_names_what_it_cannot_do(tmp_path):
    with pytest.raises(ModelError, match=f"expected one of {', '.join(shipped())}, got 'sdls'"):
        new_scene(tmp_path / "x", "sdls")
    with pytest.raises(ModelError, match="No such file or directory"):
        new_scene(tmp_path / "none" / "x", "raft")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("acceleration = 9.81", "acceleration = 0.0", "carry no force at rest"),
        ("frequency = 1.0 ", "frequency = 20.0 ", "of its energy lies above 20 Hz"),
        ("table_step = 0.01 ", "table_step = 0.004 ", "pass over some"),
        ("table_step = 0.01 ", "table_step = 0.007 ", "no multiple of the step"),
        ("center = 1.92 ", "center = 5.0 ", "misses 48% of the record's energy"),
        ("duration = 5.0 ", "duration = 1.5 ", "misses"),
    ],
)
def test_doubtful_scenes_are_warned_of(tmp_path, old, new, words):
    text = SCENE.read_text(encoding="utf-8")
    assert old in text
    found = texts(scene_of(tmp_path, text.replace(old, new)))
    assert any(words in warning for warning in found), found


def test_shipped_scenes_are_not_doubtful():
    assert {name: texts(read_scene(path)) for name, path in shipped().items()} == {name: [] for name in shipped()}


def test_share_of_energy_above_the_limit_is_that_of_the_wavelet(tmp_path):
    """The spectrum of a Ricker wavelet is proportional to f^2 exp(-(f / fp)^2)."""
    text = SCENE.read_text(encoding="utf-8").replace("frequency = 1.0 ", "frequency = 20.0 ").replace("start = 0.9 ", "start = 0.0 ")
    text = text.replace("table_step = 0.01 ", "# ").replace("table_digits = 6", "")
    f = np.linspace(0, 400, 400_001)
    energy = f**4 * np.exp(-2 * (f / 20.0) ** 2)
    share = energy[f > 20.0].sum() / energy.sum()
    (warning,) = texts(scene_of(tmp_path, text))
    found = re.fullmatch(r"load: (\d+)% of its energy lies above 20 Hz, where a period has fewer than 10 steps of 0.005 s", warning)
    assert float(found[1]) == pytest.approx(100 * share, abs=1.0)  # frequencies 0.2 Hz apart, and whole percents


def test_what_a_static_run_leaves_out_is_said(tmp_path):
    text = SCENE.read_text(encoding="utf-8")
    force = '[[load]]\nkind = "force"\nname = "{}"\npoints = ["P3"]\nforce = {{ X = 1.0 }}\n'
    text = text.replace("[load]", force.format("PUSH") + force.format("SHOCK") + 'signal = "sine"\nfrequency = 1.0\n[[load]]')
    text = text.replace("frequency = 1.0 ", "frequency = 20.0 ")  # which no static run minds
    scene = scene_of(tmp_path, text + '\n[run]\nmethod = "static"\n')
    words = "the method static leaves out what acts in time, as its signal says: load, load 'SHOCK'"
    assert texts(scene) == texts(scene, "static") == [words]
    assert "Hz" in texts(scene, "transient")[0] and words not in texts(scene, "transient")
    assert drivers("check", tmp_path / "scene.toml").stdout.splitlines()[-1] == f"doubt       {words}"
    done = drivers("run", tmp_path / "scene.toml", "--quiet", "--no-plots", "--out", tmp_path / "out")
    assert (done.returncode, done.stderr) == (0, f"doubt: {words}\n")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["findings"] == [{"key": "scene", "severity": "doubt", "text": words}]


def test_a_warning_is_printed_once_though_the_process_begins_again(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.read_text(encoding="utf-8").replace("duration = 5.0 ", "duration = 1.5 "), encoding="utf-8")
    done = child("run", tmp_path / "scene.toml", "--method", "time-frequency", "--quiet", "--no-plots", "--out", tmp_path / "out")
    assert done.returncode == 0 and done.stderr.count("misses") == 1, done.stderr


RIGID = """
[mesh]
width = 4.0
height = 4.0
nx = 2
ny = 2
degree = 1
[kinematics]
kind = "bending"
[plate]
young = 1e15
poisson = 0.2
density = 2500.0
thickness = 1.0
[gravity]
acceleration = 9.81
[[supports]]
name = "S"
grid = { from = [0, 0], to = [4, 4], count = [3, 3] }
stiffness = { Z = 1e7 }
contact = { Z = 1e15 }
unilateral = "Z"
[[load]]
direction = { Z = 5.0 }
signal = "sine"
amplitude = 0.5
frequency = 1.0
[[probes]]
name = "P"
point = [2, 2]
[transient]
step = 0.01
duration = 1.0
"""


def test_check_adds_figures_by_which_a_scene_is_known(comm, tmp_path):
    """A rigid plate of 40,000 kg on nine springs of 1e7 N/m sinks by m g / k and bounces with sqrt(k / m)."""
    (line,) = [line for line in check_scene(scene_of(tmp_path, RIGID), comm, mesh=True) if line.startswith("plausible")]
    found = re.fullmatch(r"plausible   first frequency (.*) Hz, at rest (.*) mm at most, ground up to (.*) m/s2, 40,000.0 kg", line)
    frequency, sag, ground = map(float, found.groups())
    assert sag == pytest.approx(1e3 * 40_000 * 9.81 / 9e7, rel=1e-3)
    assert frequency == pytest.approx(np.sqrt(9e7 / 40_000) / (2 * np.pi), rel=1e-2)  # the plate bends a little
    assert ground == pytest.approx(0.5 * 5.0, rel=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[transient]\nstep = 0.01\nduration = 1.0\n", "", "the method transient needs the section"),
        ("acceleration = 9.81", "acceleration = -9.81", "the static loads lift or tip the plate off its supports"),
        ('grid = { from = [0, 0], to = [4, 4], count = [3, 3] }', "points = [[0, 0], [0, 4]]", "lift or tip|nothing holds"),
        ("duration = 1.0", 'duration = 1.0\n[run]\nmethod = "modal"', r"needs the section \[modal\]"),
        ("nx = 2\nny = 2", "nx = 9000\nny = 9000", "the run will need some"),
    ],
)
def test_check_refuses_what_run_refuses(comm, tmp_path, old, new, words):
    assert old in RIGID
    scene = scene_of(tmp_path, RIGID.replace(old, new))
    with pytest.raises(ModelError, match=words):
        check_scene(scene, comm, mesh=True)


def test_check_of_a_body_that_begins_at_rest_needs_no_state_of_rest(comm, tmp_path):
    text = RIGID.replace("acceleration = 9.81", "acceleration = -9.81").replace("duration = 1.0", 'duration = 1.0\nstart = "rest"')
    assert any("no state of rest" in line for line in check_scene(scene_of(tmp_path, text), comm, mesh=True))
