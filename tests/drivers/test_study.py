"""Parameter studies and runs in a basis, as a user starts them."""

import csv
import json

import h5py
import numpy as np
import pytest

from tests.drivers.test_cli import read_history
from tests.process import SCENE, child, drivers
from uplift.drivers.scene.scene import read_scene
from uplift.drivers.scene.vary import cases_of, changed, variation
from uplift.meshes.checked import ModelError


def run(tmp_path, name, *options):
    done = drivers("run", SCENE, *options, "--no-plots", "--quiet", "--out", tmp_path / name)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    return read_history(tmp_path / name / "history.csv")[1]


@pytest.mark.parametrize("method", [["transient"], ["time-frequency"], ["time-frequency", "--iterations", "2"]])
def test_a_run_in_the_basis_equals_the_run_in_all_dofs(tmp_path, method):
    basis = ["--basis", "1e-6", "--basis-file", tmp_path / "basis.h5"]
    whole, here = run(tmp_path, "all", "--method", *method), run(tmp_path, "basis", "--method", *method, *basis)
    assert np.max(np.abs(here[:, 1:3] - whole[:, 1:3])) < 1e-6 * np.max(np.abs(whole[:, 1:3]))
    if method == ["transient"]:
        assert np.array_equal(here, run(tmp_path, "again", "--method", *method, *basis), equal_nan=True)
    summary = json.loads((tmp_path / "basis" / "summary.json").read_text(encoding="utf-8"))
    assert summary["versions"]["petsc scalars"] == "real"
    assert summary["basis"]["estimated_error"] < summary["basis"]["tolerance"] == 1e-6
    assert {"factorisation", "basis", "projection", "sweep" if "--iterations" in method else "march"} <= set(summary["seconds"])
    assert {"factorisation", "solves", "orthonormalisation", "projection", "estimate"} <= set(summary["basis"]["seconds"])


def test_what_a_basis_is_not_for_is_refused(tmp_path):
    done = drivers("run", SCENE, "--method", "modal", "--basis", "1e-6", "--out", tmp_path / "out")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1) and "--basis" in done.stderr
    done = drivers("run", SCENE, "--basis-file", "x.h5", "--out", tmp_path / "out")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1) and "--basis TOL" in done.stderr
    file = tmp_path / "basis.h5"
    run(tmp_path, "out", "--basis", "1e-3", "--basis-file", file)
    done = drivers("run", SCENE, "--basis", "1e-6", "--basis-file", file, "--quiet", "--overwrite", "--out", tmp_path / "out")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1) and "made for a tolerance of 0.001" in done.stderr
    with h5py.File(file, "a") as changed_file:
        changed_file.attrs["fingerprint"] = "0" * 32
    done = drivers("run", SCENE, "--basis", "1e-3", "--basis-file", file, "--quiet", "--overwrite", "--out", tmp_path / "out")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1) and "another model" in done.stderr


def rows_of(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_study_gives_the_extremes_of_its_runs(tmp_path):
    out = tmp_path / "study"
    vary = ["--vary", "load.amplitude=1:4:2", "--vary", "supports.RESS.gap=0,0.004"]
    # Ten settling steps do not bring a plate to rest that has to fall onto its supports first.
    text = SCENE.read_text(encoding="utf-8").replace('start = "settled"', 'start = "static"')
    (tmp_path / "static.toml").write_text(text, encoding="utf-8")
    done = child("study", tmp_path / "static.toml", *vary, "--out", out)
    assert done.returncode == 0, done.stderr
    assert "4 cases on 1 bases" in done.stdout
    assert sorted(p.name for p in out.iterdir()) == ["study.csv", "study.png", "summary.json"]
    rows = rows_of(out / "study.csv")
    assert [(float(r["load.amplitude"]), float(r["supports.RESS.gap"])) for r in rows] == [(1, 0), (1, 0.004), (4, 0), (4, 0.004)]
    text = text.replace("amplitude = 2.2408445351690323", "amplitude = 4.0").replace('name = "RESS"', 'name = "RESS"\ngap = 0.004')
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    assert drivers("run", tmp_path / "case.toml", "--no-plots", "--quiet", "--out", tmp_path / "run").returncode == 0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))["extremes"]
    for name, ends in summary["history"].items():
        if name.startswith("P3"):
            for end in ("min", "max"):
                assert float(rows[3][f"{end} {name} [m]"]) == pytest.approx(ends[end], rel=1e-5)
    gaps = [ends["max"] for name, ends in summary["contacts"].items() if "gap" in name]
    assert float(rows[3]["largest gap [m]"]) == pytest.approx(max(gaps), rel=1e-5)
    assert float(rows[3]["most open contacts [%]"]) == summary["reactions"]["open contacts [%]"]["max"]


def test_a_stiffness_gets_a_basis_of_its_own_and_no_foreign_file(tmp_path):
    vary = ["--vary", "plate.young=1e8,1.4e8", "--no-plots"]
    done = drivers("study", SCENE, *vary, "--out", tmp_path / "study")
    assert done.returncode == 0 and "2 cases on 2 bases" in done.stdout
    done = drivers("study", SCENE, *vary, "--overwrite", "--out", tmp_path / "study", "--basis-file", tmp_path / "b.h5")
    assert (done.returncode, done.stderr.strip().splitlines()[-1].count("serves one model")) == (2, 1)


@pytest.mark.parametrize("text", ["load.amplitude", "load.amplitude=", "=1,2", "load.amplitude=1:2", "load.amplitude=1:2:x", "a=1,nan"])
def test_variations_that_cannot_be_read(text):
    with pytest.raises(ModelError, match="--vary: expected KEY"):
        variation(text)


@pytest.mark.parametrize(("key", "words"), [
    ("loud.amplitude", "the scene has no loud"),
    ("supports.REST.gap", "the scene has no supports.REST"),
    ("title", "expected the path of a number"),
    ("load.signal", "expected the path of a number"),
])
def test_paths_that_lead_nowhere(key, words):
    with pytest.raises(ModelError, match=words):
        changed(read_scene(SCENE).source, key, 1.0)


def test_an_array_of_several_tables_wants_one_of_them_named():
    source = {"supports": [{"name": "A", "gap": 0.0}, {"name": "B", "gap": 0.0}]}
    with pytest.raises(ModelError, match="supports has several entries; name one of them: A, B"):
        changed(source, "supports.gap", 1.0)
    changed(source, "supports.B.gap", 1.0)
    assert [support["gap"] for support in source["supports"]] == [0.0, 1.0]


def test_every_case_is_checked_before_the_first_runs():
    with pytest.raises(ModelError, match="gap: expected >= 0 m, got -0.001"):
        cases_of(read_scene(SCENE), [variation("supports.RESS.gap=0,-0.001")])
    (_, scene), = cases_of(read_scene(SCENE), [variation("mesh.nx=8")])
    assert scene.plate.nx == 8
