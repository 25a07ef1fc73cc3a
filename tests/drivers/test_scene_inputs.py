"""Signals, points and bases that scene files ask for."""

import json
import re

import numpy as np
import pytest

from tests.process import SCENES, drivers
from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.scene.cautions import scene_cautions
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import read_scene
from uplift.meshes.checked import ModelError

SDLS = (SCENES / "sdls119a.toml").read_text(encoding="utf-8")
RAFT = (SCENES / "raft.toml").read_text(encoding="utf-8")
BEFORE_LOAD, AFTER_LOAD = SDLS.split("[load]")[0], "[[supports]]" + SDLS.split("[[supports]]")[1]


def texts(scene, method=""):
    return [finding.text for finding in scene_cautions(scene, method)]


def scene_of(tmp_path, text):
    path = tmp_path / "scène.toml"
    path.write_text(text, encoding="utf-8")
    return read_scene(path)


def with_load(tmp_path, lines):
    return scene_of(tmp_path, f'{BEFORE_LOAD}[load]\ndirection = "X"\n{lines}\n\n{AFTER_LOAD}')


def signal_of(tmp_path, lines):
    return with_load(tmp_path, lines).model.motions[0].signal


def test_sweep_and_noise_are_read(tmp_path):
    sweep = signal_of(tmp_path, 'signal = "sweep"\nfirst = 1\nlast = 4.0\nend = 5.0\nspacing = "logarithmic"\ntaper = 0.5')
    assert (sweep.first, sweep.last, sweep.end, sweep.spacing, sweep.taper) == (1.0, 4.0, 5.0, "logarithmic", 0.5)
    noise = signal_of(tmp_path, 'signal = "noise"\nseed = 3\nrms = 2.0\nlow = 0.5\nhigh = 10\nend = 5\nrise = 1\ndecay = 2.0')
    assert (noise.seed, noise.rms, noise.low, noise.high, noise.rise, noise.decay) == (3, 2.0, 0.5, 10.0, 1.0, 2.0)


def test_inline_table_is_linear_between_its_values(tmp_path):
    table = signal_of(tmp_path, 'signal = "table"\ntimes = [0, 1.0, 2]\nvalues = [0.0, 3, -1.0]')
    assert table(np.array([-0.1, 0.5, 1.5, 2.1])).tolist() == [0.0, 1.5, 1.0, 0.0]


@pytest.mark.parametrize(
    ("lines", "key", "words"),
    [
        ('signal = "table"\ntimes = [0, 1]\nvalues = [0.0]', "load.times", "two pairs of time and value"),
        ('signal = "table"\ntimes = [0, 1, 1]\nvalues = [0.0, 1, 2]', "load.times", "does not increase in row 3"),
        ('signal = "table"\ntimes = [0, "x"]\nvalues = [0.0, 1]', "load.times", "expected a number"),
        ('signal = "table"\ntimes = 3\nvalues = [0.0, 1]', "load.times", "expected an array"),
        ('signal = "noise"\nseed = 1.5\nhigh = 3.0\nend = 1.0', "load.seed", "a whole number"),
        ('signal = "noise"\nsede = 1\nhigh = 3.0\nend = 1.0', "load.seed", "did you mean 'seed'"),
        ('signal = "csv"\nfile = "record.csv"\nunit = "ft/s2"', "load.unit", "m/s2, g, cm/s2"),
        ('signal = "csv"\nfile = "none.csv"', "load.file", "no such file"),
        ('signal = "csv"\nfile = "three.csv"', "load.column", r"missing; .* 3 columns: expected one of 2 \(ax\), 3 \(ay\)"),
        ('signal = "csv"\nfile = "three.csv"\ncolumn = 1', "load.column", "expected one of 2 .*got 1"),
        ('signal = "csv"\nfile = "three.csv"\ncolumn = 4', "load.column", "expected one of 2 .*got 4"),
        ('signal = "csv"\nfile = "three.csv"\ncolumn = 0', "load.column", "expected >= 1"),
        ('signal = "csv"\nfile = "three.csv"\ncolumn = 1.5', "load.column", "expected a whole number or a text"),
        ('signal = "csv"\nfile = "three.csv"\ncolumn = true', "load.column", "expected a whole number or a text"),
        ('signal = "csv"\nfile = "three.csv"\ncolumn = "az"', "load.column", "has no columns 'az': expected one of"),
    ],
)
def test_wrong_signals_are_named(tmp_path, lines, key, words):
    (tmp_path / "three.csv").write_text("t,ax,ay\n0,1,2\n1,3,4\n", encoding="utf-8")
    with pytest.raises(ModelError, match=words) as error:
        signal_of(tmp_path, lines)
    assert error.value.key == key


@pytest.mark.parametrize(("unit", "factor"), [("m/s2", 1.0), ("g", 9.80665), ("cm/s2", 0.01)])
def test_record_has_a_unit(tmp_path, unit, factor):
    (tmp_path / "séisme 1.csv").write_text("t;a\n0;0\n0.01;2\n0.02;-1\n", encoding="utf-8")
    record = signal_of(tmp_path, f'signal = "csv"\nfile = "séisme 1.csv"\nunit = "{unit}"\nscale = 0.5')
    assert record(np.array([0.01, 0.015])) == pytest.approx([factor, 0.25 * factor])


@pytest.mark.parametrize("column", ["3", '"ay"', '" AY "'])
def test_record_of_more_columns_is_read_by_number_or_name(tmp_path, column):
    (tmp_path / "record.csv").write_text("t;ax;ay\n0;0;1\n0.01;2;3\n", encoding="utf-8")
    record = signal_of(tmp_path, f'signal = "csv"\nfile = "record.csv"\ncolumn = {column}')
    assert record(np.array([0.0, 0.01])).tolist() == [1.0, 3.0]


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({-1.0: 0, -0.5: 3, 0.0: 0, 1.0: 4, 2.0: 0}, ["begins at -1 s; .* misses 0.36 of its energy"]),
        ({0.0: 0, 1.0: 4, 2.0: 1}, ["ends at 2 s with 25% of its largest value and is zero after"]),
        ({1.0: 1, 1.5: 4, 2.0: 0}, ["begins at 1 s with 25% of its largest value and is zero before"]),
        ({0.0: 0, 1.0: 4, 2.0: 0.05}, []),
        ({0.0: 0, 1.0: 4, 6.0: 4}, []),  # the run ends before
        ({0.0: 0, 1.0: 0, 2.0: 0}, ["zero from 0 to the end of the analysis at 5 s and moves nothing; it lies between 0 s and 2 s"]),
        ({7.0: 0, 8.0: 1, 9.0: 0}, ["zero from 0 to the end of the analysis at 5 s and moves nothing; it lies between 7 s and 9 s"]),
        ({-3.0: 0, -2.0: 1, -1.0: 0}, ["moves nothing; it lies between -3 s and -1 s"]),
    ],
)
def test_record_that_is_cut_or_never_acts_is_said(tmp_path, values, words):
    lines = [f"{t:g},{v:g}" for t, v in values.items()]
    (tmp_path / "record.csv").write_text("\n".join(lines), encoding="utf-8")
    scene = with_load(tmp_path, 'signal = "csv"\nfile = "record.csv"')
    found = [one.text for one in scene_cautions(scene) if one.key == "record"]
    assert len(found) == len(words) and all(re.search(w, text) for w, text in zip(words, found, strict=True)), found


def test_a_signal_that_begins_after_the_run_is_said(tmp_path):
    scene = with_load(tmp_path, 'signal = "step"\nstart = 9.0')
    assert [one.key for one in scene_cautions(scene)] == ["record"]


@pytest.mark.parametrize(("row", "words"), [(0.001, "pass over some"), (0.007, "no multiple"), (0.02, "")])
def test_record_that_does_not_fit_the_steps_is_warned_of(tmp_path, row, words):
    t = row * np.arange(int(5 / row) + 1)
    lines = [f"{time:.12g},{value:.12g}" for time, value in zip(t, np.sin(np.pi * t) ** 2, strict=True)]
    (tmp_path / "record.csv").write_text("\n".join(lines), encoding="utf-8")
    warnings = texts(with_load(tmp_path, 'signal = "csv"\nfile = "record.csv"'))
    assert (len(warnings) == 1 and words in warnings[0]) if words else not warnings


def test_points_from_a_file_are_those_of_the_edge(tmp_path, comm):
    (tmp_path / "appuis du sol.csv").write_text("# under the plate\nx, y\n0,0\n1,0\n2,0\n3,0\n4,0\n", encoding="utf-8")
    given = 'edge = "DBAS"               # the bottom edge (DDRO right, DHAU top, DGAU left), or points = [[0.0, 0.0], "P2"]\ncount = 5'
    assert given in SDLS
    scene = scene_of(tmp_path, SDLS.replace(given, 'file = "appuis du sol.csv"\n#'))
    assert scene.model.supports[0].points == read_scene(SCENES / "sdls119a.toml").model.supports[0].points


def test_shares_of_a_file_multiply_stiffness_and_mass(tmp_path, comm):
    """A spring and a mass of twice the share answer as two of them at the point."""
    (tmp_path / "points.csv").write_text("4;8;0;2\n0;8;0;0.5\n", encoding="utf-8")
    listed = 'points = ["P3", "P4"]'
    mass = '[[masses]]\nname = "M"\nmass = 500.0\n'
    scene = scene_of(tmp_path, SDLS.replace(listed, 'file = "points.csv"').replace("Y = 1.0", "Y = 1e6") + mass + 'file = "points.csv"\n')
    apart = SDLS.replace(listed, 'points = ["P3"]').replace("Y = 1.0", "Y = 2e6")
    apart += '[[springs]]\nname = "R4"\npoints = ["P4"]\nstiffness = { Y = 5e5 }\n'
    apart += mass.replace("500", "1000") + 'points = ["P3"]\n' + mass.replace("500", "250").replace('"M"', '"N"') + 'points = ["P4"]\n'
    values = []
    for made in (scene, scene_of(tmp_path, apart)):
        with prepare(made, comm) as assembly:
            values.append(analyse(assembly, Request("static")).final.probes)
            assert assembly.plate.total_mass == pytest.approx(80_000.5 + 1250.0)
    assert values[0] == pytest.approx(values[1], rel=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "at least one line"),
        ("x,y\n", "at least one line"),
        ("x,z\n0,0\n", "got the columns x, z"),
        ("x,y,x\n0,0,0\n", "got the columns"),
        ("0\n", "line 1: expected x, y"),
        ("0,0\n1,0,0\n", "line 2: expected .* in 2 columns as before"),
        ("0,0\n5,0\n", "lies outside the plate"),
        ("0,0,0,-1\n", "expected a share > 0"),
        ("0,0\n1,nan\n", "line 2: expected finite"),
    ],
)
def test_wrong_files_of_points_are_named(tmp_path, text, words):
    (tmp_path / "points.csv").write_text(text, encoding="utf-8")
    with pytest.raises(ModelError, match=words) as error:
        scene_of(tmp_path, SDLS.replace('points = ["P3", "P4"]', 'file = "points.csv"'))
    assert error.value.key.startswith("springs[RESH].file")


def test_three_directions_at_once_are_the_sum_of_each(tmp_path, comm):
    """On bonded supports the answer is linear: three [[load]] together give the sum of the three apart."""
    start, end = RAFT.split("[[load]]")[0], "[[supports]]" + RAFT.split("[[supports]]")[1]
    end = end.replace('unilateral = "Z"', 'unilateral = ""').replace("{ Z = 2.0e7 }", "{ X = 1e7, Y = 2e7, Z = 2e7 }")
    end = end.replace("{ Z = 1e12 }", "{ X = 1e12, Y = 1e12, Z = 1e12 }").replace("duration = 1.6", "duration = 0.4")
    start = start.replace("9.81", "0.0") + '[kinematics]\nkind = "shell"\n\n'
    loads = [
        f'[[load]]\ndirection = "{axis}"\nsignal = "sine"\namplitude = {amplitude}\nfrequency = {frequency}\n\n'
        for axis, amplitude, frequency in (("X", 1.0, 3.0), ("Y", 2.0, 4.0), ("Z", 3.0, 5.0))
    ]
    answers = []
    for chosen in (loads, *([load] for load in loads)):
        with prepare(scene_of(tmp_path, start + "".join(chosen) + end), comm) as assembly:
            answers.append(analyse(assembly, Request("transient")).final.probes)
    together, *apart = answers
    assert all(np.max(np.abs(one)) > 1e-4 for one in apart)
    assert np.max(np.abs(together - sum(apart))) < 1e-9 * np.max(np.abs(together))


def test_basis_is_read_and_checked(tmp_path):
    scene = scene_of(tmp_path, SDLS + "[basis]\ntolerance = 1e-5\nband = 30.0\n")
    assert (scene.basis.tolerance, scene.basis.band, scene.basis.file) == (1e-5, 30.0, "")
    with pytest.raises(ModelError, match="basis.tolerance: expected > 0 and < 1"):
        scene_of(tmp_path, SDLS + "[basis]\ntolerance = 1.0\n")
    with pytest.raises(ModelError, match="did you mean 'tolerance'"):
        scene_of(tmp_path, SDLS + "[basis]\ntolerence = 1.0\n")


def test_section_basis_is_used_and_overruled(tmp_path):
    scene = tmp_path / "scène.toml"
    scene.write_text(SDLS + '[basis]\ntolerance = 1e-5\nband = 30.0\nfile = "la base.h5"\n', encoding="utf-8")
    bases = []
    for number, options in enumerate(([], [], ["--basis", "1e-4"], ["--basis", "none"], ["--method", "modal"])):
        out = tmp_path / f"out {number}"
        done = drivers("run", scene, "--out", out, "--no-plots", "--quiet", *options)
        assert (done.returncode, done.stderr) == (0, "")
        bases.append(json.loads((out / "summary.json").read_text(encoding="utf-8")).get("basis"))
    assert (bases[0]["tolerance"], bases[0]["band_Hz"]) == (1e-5, 30.0)
    assert (tmp_path / "la base.h5").is_file()
    assert bases[1]["vectors"] == bases[0]["vectors"]  # from the file
    assert bases[2] is not None and bases[3] is None and bases[4] is None
