"""The drivers as a user starts them."""

import csv
import json

import meshio
import numpy as np
import pytest

from tests import sdls119b
from tests.process import SCENE, SCENES, child, drivers, finish, start

TABLES = ["contacts", "history", "reactions"]
FIELDS = ["deformed.med", "deformed.vtu", "film.xdmf"]
KEPT = ["report.html", "results.h5", "summary.json"]
FILES = sorted(["deformed.png", *FIELDS, *KEPT, *(f"{t}.{end}" for t in TABLES for end in ("csv", "png"))])


def read_history(path):
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], np.array(rows[1:], dtype=float)


@pytest.mark.parametrize(
    ("method", "passes"), [("transient", []), ("transient", ["--iterations", "2"]), ("time-frequency", []),
                           ("time-frequency", ["--iterations", "2"]), ("modal", [])]
)
def test_run_writes_its_files(tmp_path, method, passes):
    out = tmp_path / "résultats d'essai"
    done = child("run", SCENE, "--method", method, *passes, "--out", out, "--quiet")
    said = done.stderr.splitlines()
    assert (done.returncode, done.stdout) == (0, "")
    assert [line.startswith("doubt: uplift is by 2 published pass(es)") for line in said] == [True] * bool(passes)
    window = method == "time-frequency" and bool(passes)
    more = ["energy.csv", "energy.png"] if method in ("transient", "modal") else ["amplitude.vtu"] if window else []
    assert sorted(p.name for p in out.iterdir()) == sorted([*FILES, *more])
    header, values = read_history(out / "history.csv")
    assert header == ["t", "P3.DX", "P3.DY", *([] if window else ["uplift [%]"])]
    assert values.shape == ((2048, 3) if window else (501, 4))
    assert values[:3, 0].tolist() == [0.0, 0.01, 0.02]
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["dofs"] == 100
    assert summary["scene"]["plate"]["young"] == 1.4e8
    own = {"modes", "march"} if method == "modal" else {"factorisation", "solution"}
    phases = {"mesh", "forms and compilation", "assembly", "output"} | own
    assert phases <= set(summary["seconds"])
    assert summary["versions"]["petsc scalars"] == ("complex" if method == "time-frequency" else "real")
    peak = int(np.argmax(np.max(np.abs(values[:, 1:3]), axis=1)))
    assert summary["peak_time_s"] == values[peak, 0]
    mesh = meshio.read(out / "deformed.vtu")
    corner = int(np.argmin(np.linalg.norm(mesh.points - [4, 8, 0], axis=1)))
    assert mesh.point_data["displacement [m]"][corner, :2] == pytest.approx(values[peak, 1:3], rel=1e-9)
    header, forces = read_history(out / "contacts.csv")
    assert header[1:3] + header[-1:] == ["RESS.1 force [N]", "RESS.2 force [N]", "RESS.5 gap [m]"]
    if not passes:
        assert np.min(forces[:, 1:]) > -1e-6
        assert np.max(np.abs(forces[:, 1:6] * forces[:, 6:])) < 1e-6
        assert values[233:235, 3] == pytest.approx([37.5, 37.5])
        largest = summary["extremes"]["contacts"]["RESS.1 force [N]"]
        assert largest["max"] == forces[:, 1].max() and largest["t_max"] == forces[np.argmax(forces[:, 1]), 0]


def test_one_pass_is_the_linear_answer_and_the_default_is_exact(tmp_path, reference_run):
    results = {}
    for passes in ("1", "2", "exact"):
        assert drivers("run", SCENE, "--iterations", passes, "--out", tmp_path / passes, "--no-plots").returncode == 0
        results[passes] = read_history(tmp_path / passes / "history.csv")[1]
    assert results["1"][233, 1] == pytest.approx(-4.58502e-2, rel=1e-5)
    assert results["2"][234, 1] == pytest.approx(-4.82202e-2, rel=1e-5)
    assert results["exact"][234, 1] == pytest.approx(-5.67170e-2, rel=1e-5)
    assert np.array_equal(results["exact"], read_history(reference_run / "history.csv")[1], equal_nan=True)


def test_modelisation_b_prints_its_values(tmp_path):
    done = drivers("run", SCENES / "sdls119b.toml", "--out", tmp_path, "--no-plots")
    assert done.returncode == 0, done.stderr
    rows = {tuple(line.split()[:2]): line.split()[2:] for line in done.stdout.splitlines() if line.strip()[:2] in ("1 ", "2 ")}
    first, second = sdls119b.passes()
    at_corner = slice(sdls119b.P3, sdls119b.P3 + 2)
    assert [float(v) for v in rows["1", "2.33"]] == pytest.approx(first[1165, at_corner], rel=1e-9)
    assert [float(v) for v in rows["2", "2.34"]][:2] == pytest.approx(second[1170, at_corner], rel=1e-8)
    assert float(rows["2", "2.32"][2]) == pytest.approx(26.5625, rel=1e-12)


def test_iteration_that_does_not_end_says_so_and_keeps_what_it_has(tmp_path):
    scene = tmp_path / "hard.toml"
    text = SCENE.read_text(encoding="utf-8").replace("amplitude = 2.24", "amplitude = 4.24")
    scene.write_text(text, encoding="utf-8")
    done = drivers("run", scene, "--tolerance", "1e-6", "--quiet", "--no-plots", "--out", tmp_path / "out")
    assert done.returncode == 1
    assert "diverge after pass" in done.stderr.splitlines()[-1]
    assert "leave out --iterations" in done.stderr.splitlines()[-1]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["iteration_ended"] == "diverged"
    assert np.all(np.isfinite(read_history(tmp_path / "out" / "contacts.csv")[1]))
    done = drivers("run", SCENE, "--tolerance", "1e-9", "--iterations", "3", "--no-plots", "--overwrite", "--out", tmp_path / "out")
    assert done.returncode == 1 and "have not converged in 3 passes" in done.stderr


def test_verify_prints_all_values_and_passes(tmp_path):
    done = drivers("verify", "--out", tmp_path, "--no-plots")
    assert done.returncode == 0, done.stderr
    published = [line.split() for line in done.stdout.splitlines() if line.startswith(("transient", "time-frequency"))]
    assert len(published) == 8
    for row in published:
        printed, here = row[4], float(row[5])
        digits = len(printed.strip("-").split("e")[0].replace(".", ""))
        assert float(f"{here:.{digits - 1}e}") == float(printed), row
    assert "differ by" in done.stdout
    assert "mesh" in done.stdout
    assert (tmp_path / "transient" / "history.csv").exists()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("thickness = 1.0", "thickness = -1.0", "plate.thickness: expected > 0 m, got -1.0"),
        ("count = 5", "count = 4", "supports.RESS: RESS at (1.33333, 0) m stands on no node of the mesh"),
    ],
)
def test_bad_scene_is_one_line_and_code_2_and_leaves_nothing(tmp_path, old, new, words):
    scene = tmp_path / "bad.toml"
    scene.write_text(SCENE.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    done = child("run", scene, "--out", tmp_path / "out", "--quiet")
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith(f"uplift: {scene}: {words}")
    assert not (tmp_path / "out").exists() or list((tmp_path / "out").iterdir()) == []


def test_missing_scene_and_bad_options(tmp_path):
    done = drivers("run", tmp_path / "none.toml")
    assert done.returncode == 2 and done.stderr == f"uplift: {tmp_path / 'none.toml'}: cannot be read: No such file or directory\n"
    assert drivers("run", SCENE, "--iterations", "0").returncode == 2
    assert drivers("run", SCENE, "--iterations", "exact", "--tolerance", "1e-3").returncode == 2
    assert drivers("run", SCENE, "--method", "magic").returncode == 2
    assert drivers("mesh", SCENE, "--out", tmp_path / "plate.stl").returncode == 2
    blocked = tmp_path / "file"
    blocked.write_text("", encoding="utf-8")
    done = drivers("run", SCENE, "--out", blocked / "out")
    assert done.returncode == 2 and done.stderr.startswith("uplift: --out: cannot write into")


@pytest.mark.parametrize("command", [[], ["run"], ["verify"], ["mesh"]])
def test_help_everywhere(command):
    done = (drivers if command else child)(*command, "--help")
    assert done.returncode == 0
    assert "usage: python3 -m drivers" in done.stdout


def test_mesh_is_written(tmp_path):
    done = child("mesh", SCENE, "--out", tmp_path / "plate.msh")
    assert done.returncode == 0
    assert len(meshio.read(tmp_path / "plate.msh").points) == 45


def test_a_transient_run_loads_only_what_it_needs(tmp_path):
    """Neither complex PETSc nor SLEPc, and no plotting library where no plots are asked."""
    script = (
        "import sys; from uplift.drivers.cli import main\n"
        f"code = main(['run', {str(SCENE)!r}, '--out', {str(tmp_path)!r}, '--no-plots', '--quiet'])\n"
        "from petsc4py import PETSc\n"
        "print(code, PETSc.ScalarType.__name__, [m for m in ('slepc4py', 'matplotlib') if m in sys.modules])\n"
    )
    done = finish(start("-c", script))
    assert done.stdout == "0 float64 []\n", done.stderr
    assert {p.suffix for p in tmp_path.iterdir()} == {".vtu", ".med", ".xdmf", ".h5", ".html", ".csv", ".json"}


def test_failed_run_leaves_the_older_results_alone(tmp_path):
    from uplift.drivers.results.folder import all_or_nothing

    (tmp_path / "history.csv").write_text("old", encoding="utf-8")
    with pytest.raises(OSError, match="disk"), all_or_nothing(tmp_path) as staging:
        (staging / "history.csv").write_text("half", encoding="utf-8")
        raise OSError("disk full")
    assert [p.name for p in tmp_path.iterdir()] == ["history.csv"]
    assert (tmp_path / "history.csv").read_text(encoding="utf-8") == "old"


def test_a_static_run_prints_its_only_instant_whatever_instants_the_scene_lists(tmp_path):
    done = drivers("run", SCENES / "raft.toml", "--method", "static", "--no-plots", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    heading, values = (next(line.split() for line in done.stdout.splitlines() if line.lstrip().startswith(w)) for w in ("pass", "exact"))
    assert heading[3:] == ["CORNER.DZ", "[m]", "MIDDLE.DZ", "[m]", "MIDDLE.DRX", "[rad]", "MIDDLE.DRY", "[rad]", "lifted", "area", "[%]"]
    # A raft that is nearly rigid sinks by its weight over the sum of its springs.
    assert float(values[1]) == 0 and float(values[2]) == pytest.approx(-9.81 * 2500 * 100 / (121 * 2e7), rel=0.15)
