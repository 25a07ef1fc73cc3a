"""The drivers as a user starts them."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest

pytestmark = pytest.mark.serial

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "drivers" / "scenes" / "sdls119a.toml"
FILES = ["deformed.png", "deformed.vtu", "history.csv", "history.png", "summary.json"]


def drivers(*arguments, cwd=None, python=(), **environment):
    command = [sys.executable, *python, "-m", "drivers", *map(str, arguments)]
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX", "PRTE"))}
    return subprocess.run(
        command, cwd=cwd or ROOT, env={**clean, "PYTHONPATH": str(ROOT), **environment}, capture_output=True, text=True, timeout=120
    )


def read_history(path):
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], np.array(rows[1:], dtype=float)


@pytest.mark.parametrize("method", ["transient", "time-frequency"])
def test_run_writes_its_files(tmp_path, method):
    out = tmp_path / "résultats d'essai"
    done = drivers("run", SCENE, "--method", method, "--iterations", "2", "--out", out, "--quiet", python=["-W", "error"])
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "")
    assert sorted(p.name for p in out.iterdir()) == FILES
    header, values = read_history(out / "history.csv")
    assert header == ["t", "P3.DX", "P3.DY"]
    assert values.shape == ((501, 3) if method == "transient" else (2048, 3))
    assert values[:3, 0].tolist() == [0.0, 0.01, 0.02]
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["dofs"] == 100
    assert summary["scene"]["plate"]["young"] == 1.4e8
    assert {"mesh", "forms and compilation", "assembly", "factorisation", "solution", "output"} <= set(summary["seconds"])
    assert summary["versions"]["petsc scalars"] == ("real" if method == "transient" else "complex")
    peak = int(np.argmax(np.max(np.abs(values[:, 1:]), axis=1)))
    assert summary["peak_time_s"] == values[peak, 0]
    mesh = meshio.read(out / "deformed.vtu")
    corner = int(np.argmin(np.linalg.norm(mesh.points - [4, 8, 0], axis=1)))
    assert mesh.point_data["displacement [m]"][corner, :2] == pytest.approx(values[peak, 1:], rel=1e-9)


def test_one_iteration_is_the_linear_answer(tmp_path):
    for iterations in (1, 2):
        assert drivers("run", SCENE, "--iterations", iterations, "--out", tmp_path / str(iterations), "--no-plots").returncode == 0
    (_, one), (_, two) = (read_history(tmp_path / n / "history.csv") for n in "12")
    assert one[233, 1] == pytest.approx(-4.58502e-2, rel=1e-5)
    assert np.max(np.abs(one - two)) > 1e-3


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


def test_verify_fails_when_a_value_misses(tmp_path, monkeypatch, capsys):
    """The comparison is not a formality: another published value makes it fail."""
    from drivers import verify as module

    text = module.PUBLISHED.read_text(encoding="utf-8").replace("-4.58502e-2", "-4.58512e-2")
    (tmp_path / "other.csv").write_text(text, encoding="utf-8")
    rows = module.published_values(tmp_path / "other.csv")
    assert rows[0].printed == "-4.58512e-2"
    assert abs(rows[0].value - -4.585019201305927e-02) / abs(rows[0].value) > module.TOLERANCE


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
    done = drivers("run", scene, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith(f"uplift: {scene}: {words}")
    assert not (tmp_path / "out").exists() or list((tmp_path / "out").iterdir()) == []


def test_missing_scene_and_bad_options(tmp_path):
    done = drivers("run", tmp_path / "none.toml")
    assert done.returncode == 2 and done.stderr == f"uplift: {tmp_path / 'none.toml'}: cannot be read: No such file or directory\n"
    assert drivers("run", SCENE, "--iterations", "0").returncode == 2
    assert drivers("run", SCENE, "--method", "magic").returncode == 2
    assert drivers("mesh", SCENE, "--out", tmp_path / "plate.stl").returncode == 2
    blocked = tmp_path / "file"
    blocked.write_text("", encoding="utf-8")
    done = drivers("run", SCENE, "--out", blocked / "out")
    assert done.returncode == 2 and done.stderr.startswith("uplift: --out: cannot write into")


@pytest.mark.parametrize("command", [[], ["run"], ["verify"], ["mesh"]])
def test_help_everywhere(command):
    done = drivers(*command, "--help")
    assert done.returncode == 0
    assert "usage: python3 -m drivers" in done.stdout


def test_mesh_is_written(tmp_path):
    done = drivers("mesh", SCENE, "--out", tmp_path / "plate.msh")
    assert done.returncode == 0
    assert len(meshio.read(tmp_path / "plate.msh").points) == 45


def test_a_transient_run_loads_only_what_it_needs(tmp_path):
    """Neither complex PETSc nor SLEPc, and no plotting library where no plots are asked."""
    script = (
        "import sys; from drivers.cli import main\n"
        f"code = main(['run', {str(SCENE)!r}, '--out', {str(tmp_path)!r}, '--no-plots', '--quiet'])\n"
        "from petsc4py import PETSc\n"
        "print(code, PETSc.ScalarType.__name__, [m for m in ('slepc4py', 'matplotlib') if m in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.stdout == "0 float64 []\n", done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["deformed.vtu", "history.csv", "summary.json"]


def test_failed_run_leaves_the_older_results_alone(tmp_path):
    from drivers.output import all_or_nothing

    (tmp_path / "history.csv").write_text("old", encoding="utf-8")
    with pytest.raises(OSError, match="disk"), all_or_nothing(tmp_path) as staging:
        (staging / "history.csv").write_text("half", encoding="utf-8")
        raise OSError("disk full")
    assert [p.name for p in tmp_path.iterdir()] == ["history.csv"]
    assert (tmp_path / "history.csv").read_text(encoding="utf-8") == "old"
