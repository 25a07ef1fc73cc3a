import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene, read_scene
from uplift.meshes.checked import ModelError

SCENE = Path(__file__).parents[2] / "drivers" / "scenes" / "sdls119a.toml"


def edited(tmp_path, old, new):
    text = SCENE.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "scène avec espace.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


def test_reference_scene_is_read():
    scene = read_scene(SCENE)
    assert scene.model.supports[0].points == tuple((float(x), 0.0, 0.0) for x in range(5))
    assert scene.model.springs[0].points == ((4.0, 8.0, 0.0), (0.0, 8.0, 0.0))
    assert scene.transient.steps == 1000
    assert scene.fourier.frequencies[[0, -1]].tolist() == [0.0, 25.0]
    assert len(scene.fourier.frequencies) == 513
    signal = scene.model.motions[0].signal
    assert np.min(signal(np.linspace(0, 5, 1001))) == pytest.approx(-2.24084, abs=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ("thickness = 1.0", "thickness = -1.0", "plate.thickness", "expected > 0 m, got -1.0"),
        ("poisson = 0.3", "poisson = 0.5", "plate.poisson", "< 0.5"),
        ("young = 1.4e8", "young = inf", "plate.young", "expected > 0 Pa"),
        ("young = 1.4e8", "young = nan", "plate.young", "expected > 0 Pa"),
        ("young = 1.4e8", 'young = "stiff"', "plate.young", "expected a number, got 'stiff'"),
        ("young = 1.4e8", "yuong = 1.4e8", "plate.young", "missing; expected a number .*did you mean 'young'"),
        ("thickness = 1.0", "thickness = 1.0\ncolour = 3", "plate.colour", "unknown key"),
        ("step = 0.005", "step = 0.0", "transient.step", "expected > 0 s"),
        ("duration = 5.0", "duration = 5.001", "transient.duration", "multiple of the step"),
        ("every = 2", "every = 3", "transient.every", "divisor of the 1000 steps"),
        ('start = "settled"', 'start = "moving"', "transient.start", "static, settled, rest"),
        ("beta = 1.0\ngamma", "beta = 0.1\ngamma", "transient.settling.beta", "unconditional stability"),
        ('point = "P3"', 'point = "P5"', "probes[P3].point", "P1, P2, P3, P4"),
        ('point = "P3"', "point = [4.1, 8.0]", "probes[P3].point", "outside the plate"),
        ('point = "P3"', "point = [1.0]", "probes[P3].point", r"a point \[x, y\]"),
        ('edge = "DBAS"', 'edge = "BOTTOM"', "supports[RESS].edge", "DBAS, DDRO, DHAU, DGAU"),
        ("count = 5", "count = 1", "supports[RESS].count", "at least 2"),
        ("contact = { X = 1e15, Y = 1e15 }", "contact = { X = 1e15 }", "supports[RESS].contact.Y", "unilateral"),
        ("stiffness = { Y = 1.0 }", "stiffness = { W = 1.0 }", "springs[RESH].stiffness.W", "unknown key"),
        ("nx = 4", "nx = 4.5", "mesh.nx", "a whole number"),
        ("nx = 4", "nx = true", "mesh.nx", "a whole number"),
        ("nx = 4", "nx = 0", "mesh.nx", "expected >= 1"),
        ("amplitude = 2.24", 'sound = 1\namplitude = 2.24', "load.sound", "unknown key"),
        ('signal = "ricker"', 'signal = "rikcer"', "load.signal", "ricker, sine, step, sweep, noise, table, csv"),
        ("samples = 2048", "samples = 2047", "fourier.samples", "even"),
        ("cutoff = 25.0", "cutoff = 60.0", "fourier.cutoff", "expected <= 50 Hz"),
        ("[gravity]", "[gravitation]", "gravitation", "did you mean 'gravity'"),
        ("acceleration = 9.81", "acceleration = inf", "gravity.acceleration", "finite"),
        ("[plate]", "[plate", "", "not valid TOML"),
        ("table_step = 0.01", "table_step = 1e-12", "load.table_step", "at most 1e7 steps"),
        ("digits = 6", "digits = 0", "load.table_digits", ">= 1 and <= 17"),
    ],
)
def test_mistake_is_named_by_key(tmp_path, old, new, key, words):
    with pytest.raises(ModelError, match=words) as error:
        read_scene(edited(tmp_path, old, new))
    assert error.value.key == key


def test_accelerogram_beside_the_scene(tmp_path):
    text = SCENE.read_text(encoding="utf-8")
    start, end = text.split("[load]")[0], "[[supports]]" + text.split("[[supports]]")[1]
    path = tmp_path / "scene.toml"
    path.write_text(start + '[load]\ndirection = "Y"\nsignal = "csv"\nfile = "record.csv"\nscale = 2.0\n' + end, encoding="utf-8")
    with pytest.raises(ModelError, match="cannot read .*record.csv") as error:
        read_scene(path)
    assert error.value.key == "load.file"
    (tmp_path / "record.csv").write_text("0,0\n1,3\n2,0\n", encoding="utf-8")
    motion = read_scene(path).model.motions[0]
    assert motion.direction == (0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    assert motion.signal(np.array([1.0, 1.5])) == pytest.approx([6.0, 3.0])


def test_missing_file_and_missing_section(tmp_path):
    with pytest.raises(ModelError, match="cannot be read: No such file"):
        read_scene(tmp_path / "none.toml")
    with pytest.raises(ModelError, match="UTF-8"):
        (tmp_path / "latin.toml").write_bytes(b'title = "\xe9"')
        read_scene(tmp_path / "latin.toml")
    with pytest.raises(ModelError) as error:
        Request("time-frequency", 2).check(replace(read_scene(SCENE), fourier=None))
    assert error.value.key == "fourier"


def test_same_name_twice_is_refused(tmp_path):
    path = edited(tmp_path, "[transient]", '[[probes]]\nname = "P3"\npoint = "P4"\n\n[transient]')
    with pytest.raises(ModelError, match="'P3' is there twice"):
        read_scene(path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"supports": (), "springs": ()}, "against sliding along X and moving along Y and rotation"),
        ({"supports": ()}, "against sliding along X"),
    ],
)
def test_a_plate_that_nothing_holds_is_refused_in_words(change, words, comm):
    scene = read_scene(SCENE)
    unrestrained = replace(scene, model=replace(scene.model, **change))
    with prepare(unrestrained, comm) as assembly, pytest.raises(ModelError, match=words):
        analyse(assembly, Request("transient"))
    with prepare(unrestrained, comm) as assembly:
        from_rest = replace(unrestrained, transient=replace(unrestrained.transient, start="rest"))
        Request("transient").check_held(from_rest, assembly.plate.unrestrained)


def test_one_support_lets_the_plate_turn(comm):
    scene = read_scene(SCENE)
    support = replace(scene.model.supports[0], points=((2.0, 0.0),))
    with prepare(replace(scene, model=replace(scene.model, supports=(support,), springs=())), comm) as assembly:
        assert assembly.plate.unrestrained == ("rotation",)
        with pytest.raises(ModelError, match="against rotation"):
            Request("modal").check_held(scene, assembly.plate.unrestrained)
    with prepare(replace(scene, model=replace(scene.model, supports=(support,))), comm) as assembly:
        assert assembly.plate.unrestrained == ()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = " + "[" * 5000 + "]" * 5000, "nested too deeply"),
        ("x = " + "[" * 100 + "]" * 100, "at most 20 tables and arrays"),
        (".".join(["a"] * 3000) + " = 1", "at most 20 tables and arrays"),
        ('title = "a\\u0000b"', "title: expected a text without control characters"),
        ('title = "\\u001b[31mred"', "title: expected a text without control characters"),
        ('[[probes]]\nname = "P\\u0007"\npoint = "P3"', r"probes.name: expected a text without control characters"),
        ('[[probes]]\nname = "P\\n"\npoint = "P3"', r"probes.name: expected a text without control characters"),
        (f'[[probes]]\nname = "{"n" * 300}"\npoint = "P3"', "probes.name: expected a text of at most 100 characters, got 300"),
        (f'"{"k" * 300}" = 1', "expected a key of at most 100 characters"),
        ('"\\u0007" = 1', "expected a key without control characters"),
        (f'title = "{"t" * 1001}"', "at most 1000 characters"),
        (f'[mesh]\nnx = {"9" * 4000}', "a number|nx|digits"),
    ],
)
def test_what_no_scene_holds_is_refused_in_one_short_line(tmp_path, text, words):
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ModelError, match=words) as error:
        read_scene(path)
    assert str(error.value).isprintable() and len(str(error.value)) < 1100


def test_messages_are_cut():
    message = str(ModelError("key", "x" * 10_000 + "\n\x1b[31m"))
    assert len(message) < 1100 and message.isprintable()


COUNTS = (
    "mesh.nx", "mesh.ny", "transient.every", "transient.settling.steps", "run.iterations", "supports.count", "modal.number",
    "harmonic.count", "fourier.samples",
)


@pytest.mark.parametrize("key", COUNTS)
def test_every_count_is_bounded(tmp_path, key):
    *tables, last = key.split(".")
    scene = tomllib.loads(SCENE.read_text(encoding="utf-8"))
    scene["modal"] = {"number": 5}
    scene["harmonic"] = {"low": 1.0, "high": 2.0, "count": 3}
    here = scene
    for name in tables:
        here = here.setdefault(name, {})
        here = here[0] if isinstance(here, list) else here
    if key == "supports.count":
        here.pop("points", None)
        here.pop("grid", None)
        here["edge"] = "DBAS"
    here[last] = 10**12
    with pytest.raises(ModelError, match=f"{last}: expected"):
        build_scene(scene, tmp_path)


@pytest.mark.parametrize("name", ["/dev/zero", "/dev/null", "/"])
def test_what_is_no_file_is_not_read(name):
    with pytest.raises(ModelError, match="it is no file"):
        read_scene(Path(name))
