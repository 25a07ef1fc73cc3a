from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from tests.conftest import SCENES
from uplift.drivers.evidence.scaling.linear_solvers import Solved, conclusion, solver_rows
from uplift.drivers.evidence.scaling.reduced import FILE, Direct, Reduced
from uplift.drivers.evidence.scaling.scaling import LAYOUTS, Measured, in_child, page, scaling, slope
from uplift.drivers.scene.scene import read_scene
from uplift.meshes.checked import ModelError


def test_slope_is_the_exponent():
    assert slope([10, 100, 1000], [2.0 * n**1.25 for n in (10, 100, 1000)]) == pytest.approx(1.25)


def test_page_extrapolates_what_was_measured():
    rows = [
        {name: Measured(n, 10, s * n / 1000, s * n / 1000, 1.0, 2.0**30) for name, s in zip(LAYOUTS, (8, 4, 6), strict=True)}
        for n in (1000, 10_000)
    ]
    text = page(rows, ["| dofs | basis |", "|---:|---:|", "| 17 | 61 |"], ["| dofs |", "|---:|", "| 19 |"], "python3 -m drivers scale")
    assert "| 10,000 | 10 | 80.00 (80.00) | 40.00 (40.00) | 60.00 (60.00) | 0.50 (0.50) | 0.75 (0.75) |" in text
    assert "p = 1.00 (1 rank)" in text
    # 200 ranks take 1,000 frequencies in 5 turns, each as long as two frequencies of a busy pair.
    assert "| 10,000 | 8.000 | 5 | 40.0 | 8,000 | 1.00 |" in text
    assert "| 17 | 61 |" in text and "| 19 |" in text and "the best ratio measured above is 0.75" in text


def test_measurements_in_children():
    one, two = (
        Measured(**in_child(SCENES / "sdls119a.toml", ranks, "sweep", 1, 4, groups)) for ranks, groups in ((1, 1), (2, 2))
    )
    assert one.dofs == two.dofs == 100 and one.points == 4
    assert 0 < one.cpu and 0 < one.seconds and one.memory > 5e7


def test_the_reduced_run_agrees_with_the_direct_sweep_and_the_full_march(tmp_path):
    path = SCENES / "sdls119a.toml"
    mine = Reduced(**in_child(path, 1, "reduced", 2, 600, 3, tmp_path))
    direct = Direct(**in_child(path, 1, "direct", 2, tmp_path))
    assert mine.dofs == 316 and mine.steps == 4096
    assert direct.difference < 1e-8 and mine.full_difference < 1e-6
    # A wrong amplitude shows.
    with np.load(tmp_path / FILE) as saved:
        wrong = dict(saved)
    wrong["probes"] = wrong["probes"] * 1.001
    np.savez(tmp_path / FILE, **wrong)
    assert Direct(**in_child(path, 1, "direct", 2, tmp_path)).difference > 9e-4


def test_the_iteration_agrees_with_the_factor(tmp_path):
    rows = solver_rows(partial(in_child, SCENES / "sdls119a.toml", 1), print, quick=True)
    cells = [line.strip("| ").split(" | ") for line in rows[2:-2]]
    assert [row[0] for row in cells] == ["316", "1,132"]
    for row in cells:
        assert 3 < int(row[4]) < 60 and 3 < float(row[7]) < 60
        assert float(row[-1]) < 1e-9


def test_the_solvers_compared():
    pairs = [
        (Solved(n, 1.0, 1.0, 1.0, 0, 2.0, 0.5, 0.0, 4.0 * n**1.25), Solved(n, 1.0, 1.0, 1.0, 30, 1.0, 4.0, 27.0, 2.0 * n))
        for n in (1000, 4000)
    ]
    text = " ".join(conclusion(pairs).split())
    assert "At 4,000 dofs a solve without the factor takes 8 times as long" in text and "set-up 0.50 of a factorisation" in text
    assert "dofs^1.25 with the factor and dofs^1.00 without" in text


def test_a_scene_without_a_window_is_refused(tmp_path):
    scene = replace(read_scene(SCENES / "sdls119a.toml"), fourier=None)
    with pytest.raises(ModelError, match="fourier"):
        scaling(SCENES / "sdls119a.toml", scene, tmp_path / "page.md", quick=True)
    assert not (tmp_path / "page.md").exists()
