"""Comparison of two runs: norms against numbers that are known, instants that differ, and what users type."""

import csv

import numpy as np
import pytest

from tests.browser import browser, needs_browser
from tests.process import child, drivers
from uplift.drivers.results.hdf5 import write_results
from uplift.drivers.results.results import Results, Series
from uplift.drivers.studies.comparison import compare, comparison_page
from uplift.meshes.checked import ModelError

NAMES = ("a.h5", "b.h5")


def made(times, values, names=("P.DX",), unit="m", scene=None, path="probes/displacement"):
    facts = {"title": "made", "method": "transient", "uplift": "exact", "scene": scene or {}}
    series = {path: Series(tuple(names), unit, np.asarray(values).reshape(len(times), -1), "")}
    return Results(facts, "", times, series, {"probes": np.zeros((1, 3))}, ("P",))


def test_norms_are_those_of_known_functions():
    times = np.linspace(0, 1, 1001)
    first, second = np.sin(2 * np.pi * times), 1.1 * np.sin(2 * np.pi * times)
    (pair,) = compare(made(times, first), made(times, second), NAMES).pairs
    assert pair.largest == pytest.approx(0.1, rel=1e-5) and pair.when == pytest.approx(0.25)
    assert pair.rms == pytest.approx(0.1 / np.sqrt(2), rel=1e-12)  # the trapezoidal rule is exact over a period
    assert pair.relative_largest == pytest.approx(0.1, rel=1e-12) and pair.relative_rms == pytest.approx(0.1, rel=1e-12)


def test_a_run_does_not_differ_from_itself():
    times = np.linspace(0, 5, 501)
    run = made(times, np.cos(times))
    comparison = compare(run, run, NAMES)
    assert comparison.worst() == 0 and comparison.warnings == [] and comparison.changes == []


def test_nothing_against_something():
    times = np.linspace(0, 1, 11)
    comparison = compare(made(times, np.zeros(11)), made(times, np.ones(11)), NAMES)
    assert comparison.worst() == float("inf")
    assert "inf" in comparison.lines()[-1]
    assert "unknown" in comparison_page(comparison)


def test_multiples_of_a_step_are_compared_without_interpolation():
    fine, coarse = np.linspace(0, 1, 401), np.linspace(0, 1, 101)
    jagged = np.where(np.arange(401) % 4 == 0, fine, 7.0)  # what stands between the common instants must not matter
    comparison = compare(made(fine, jagged), made(coarse, coarse), NAMES)
    assert comparison.worst() == pytest.approx(0.0, abs=1e-14)
    assert comparison.warnings == ["instants are 0.0025 s and 0.01 s apart: compared at those that both have"]


def test_other_steps_are_interpolated_with_a_warning():
    a, b = np.linspace(0, 1, 101), np.linspace(0, 1, 71)
    comparison = compare(made(a, 3 * a), made(b, 3 * b), NAMES)
    assert len(comparison.pairs[0].times) == 71 and comparison.worst() < 1e-14
    assert len(comparison.warnings) == 1 and "interpolated linearly" in comparison.warnings[0]


def test_other_lengths_are_cut_with_a_warning():
    a, b = np.linspace(0, 2, 201), np.linspace(0, 1, 101)
    comparison = compare(made(a, a), made(b, b + 0.5), NAMES)
    assert comparison.pairs[0].times[-1] == 1.0 and comparison.pairs[0].largest == pytest.approx(0.5)
    assert comparison.warnings == ["the runs last differently; compared from 0 to 1 s"]


def test_unknown_values_are_left_out():
    times = np.linspace(0, 1, 11)
    values = np.ones(11)
    values[3] = np.nan
    (pair,) = compare(made(times, values), made(times, np.full(11, 1.5)), NAMES).pairs
    assert len(pair.times) == 10 and pair.largest == 0.5


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (made(np.linspace(0, 1, 11), np.ones(11), names=("Q.DX",)), "no histories of the same name in common: P.DX; Q.DX"),
        (made(np.linspace(3, 4, 11), np.ones(11)), "no instants in common: 0 to 1 s, 3 to 4 s"),
    ],
)
def test_nothing_in_common_is_said(other, words):
    with pytest.raises(ModelError, match=words):
        compare(made(np.linspace(0, 1, 11), np.ones(11)), other, NAMES)


def test_changes_of_the_scene_are_named():
    times = np.linspace(0, 1, 11)
    a = {"load": {"amplitude": 1.0, "f": 2}, "supports": [{"name": "R", "gap": 0.0}], "same": [1, 2]}
    b = {"load": {"amplitude": 2.0, "f": 2}, "supports": [{"name": "R", "gap": 0.1}], "same": [1, 2], "modal": {"number": 3}}
    comparison = compare(made(times, times, scene=a), made(times, times, scene=b), NAMES)
    assert comparison.changes == [("load.amplitude", "1.0", "2.0"), ("supports[1].gap", "0.0", "0.1"), ("modal", "-", "{'number': 3}")]


def test_the_command(tmp_path):
    times = np.linspace(0, 5, 501)
    for name, factor in (("a b.h5", 1.0), ("é.h5", 1.25)):
        write_results(tmp_path / name, made(times, factor * np.sin(times), scene={"load": {"amplitude": factor}}))
    done = child("compare", tmp_path / "a b.h5", tmp_path / "é.h5", "--out", tmp_path / "out")
    assert (done.returncode, done.stderr) == (0, "")
    assert "load.amplitude: 1.0 -> 1.25" in done.stdout
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("P.DX")]
    assert line.split() == ["P.DX", "1.000", "m", "250.0", "mm", "1.57", "2.50e-01", *line.split()[7:]]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["compare.csv", "compare.html", "compare.png"]
    with (tmp_path / "out" / "compare.csv").open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert float(row["relative rms"]) == pytest.approx(0.25, rel=1e-12) and row["unit"] == "m"
    again = ("compare", tmp_path / "a b.h5", tmp_path / "é.h5", "--out", tmp_path / "out", "--no-plots")
    unrestrained, tight = (drivers(*again, "--overwrite", "--tolerance", t) for t in ("0.3", "0.2"))
    assert (unrestrained.returncode, tight.returncode) == (0, 1)


def test_a_comparison_is_kept_unless_it_may_be_overwritten(tmp_path):
    times = np.linspace(0, 1, 11)
    for name in NAMES:
        write_results(tmp_path / name, made(times, times))
    kept = tmp_path / "out" / "compare.html"
    kept.parent.mkdir()
    kept.write_text("kept", encoding="utf-8")
    command = ("compare", *(tmp_path / name for name in NAMES), "--no-plots", "--out", kept.parent)
    done = drivers(*command)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"uplift: --out: {kept.parent} holds another comparison; name another folder, or add --overwrite\n"
    assert [path.name for path in kept.parent.iterdir()] == ["compare.html"] and kept.read_text(encoding="utf-8") == "kept"
    assert drivers(*command, "--overwrite").returncode == 0
    assert "Comparison of two runs" in kept.read_text(encoding="utf-8")


def test_a_report_replaces_the_page_of_its_run_and_no_other_file(tmp_path):
    times = np.linspace(0, 1, 11)
    write_results(tmp_path / "results.h5", made(times, times))
    page, other = tmp_path / "report.html", tmp_path / "other.html"
    for path in (page, other):
        path.write_text("old", encoding="utf-8")
    assert drivers("report", tmp_path).returncode == 0 and "<html" in page.read_text(encoding="utf-8")
    assert drivers("report", tmp_path, "--out", page).returncode == 0
    for out, words in ((other, "is there already"), (tmp_path / "results.h5", "is there already"), (tmp_path, "is a folder")):
        data = (tmp_path / "results.h5").read_bytes()
        done = drivers("report", tmp_path, "--out", out)
        assert done.returncode == 2 and done.stderr.startswith(f"uplift: --out: {out} {words}") and done.stderr.count("\n") == 1
        assert (tmp_path / "results.h5").read_bytes() == data
    assert other.read_text(encoding="utf-8") == "old"
    assert drivers("report", tmp_path, "--out", other, "--overwrite").returncode == 0 and "<html" in other.read_text(encoding="utf-8")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other.html", "report.html", "results.h5"]


def test_what_is_no_run_is_one_line_and_code_2(tmp_path):
    write_results(tmp_path / "a.h5", made(np.linspace(0, 1, 11), np.ones(11)))
    write_results(tmp_path / "q.h5", made(np.linspace(0, 1, 11), np.ones(11), names=("Q.DX",)))
    for arguments in (
        ("compare", tmp_path / "a.h5", tmp_path / "none.h5"), ("compare", tmp_path, tmp_path / "a.h5"),
        ("compare", tmp_path / "a.h5", tmp_path / "q.h5"), ("report", tmp_path / "none"), ("report", tmp_path / "a.h5", "--damping", "100"),
    ):
        done = drivers(*arguments)
        assert done.returncode == 2 and done.stdout == "", arguments
        assert len([line for line in done.stderr.splitlines() if not line.startswith(("usage:", " "))]) == 1, done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.h5", "q.h5"]


def test_report_is_made_again_with_other_damping(tmp_path):
    times = np.linspace(0, 5, 501)
    run = made(times, np.sin(times))
    zero = Series(("X", "Y", "Z"), "m/s2", np.zeros((501, 3)), "")
    felt = Series(("P.DX",), "m/s2", -np.sin(times)[:, None], "")
    still = Series(("P.DX",), "m/s2", np.zeros((501, 1)), "")
    moving = {"probes/acceleration": felt, "probes/base": still, "ground/acceleration": zero}
    write_results(tmp_path / "results.h5", Results(run.facts, "", times, run.series | moving, run.points, run.probe_names))
    done = child("report", tmp_path, "--damping", "1", "7.5")
    assert (done.returncode, done.stdout) == (0, f"{tmp_path / 'report.html'}\n")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "1 % damping" in text and "7.5 % damping" in text and "5 % damping" not in text.replace("7.5 % damping", "")


@needs_browser
def test_the_page_in_a_browser(tmp_path):
    times = np.linspace(0, 5, 501)
    comparison = compare(made(times, np.sin(times)), made(times, np.cos(times)), NAMES)
    (tmp_path / "compare.html").write_text(comparison_page(comparison), encoding="utf-8")
    with browser(tmp_path / "profile") as window:
        window.open(tmp_path / "compare.html")
        window.wait("return document.documentElement.dataset.ready === 'yes'")
        assert window.run("return document.querySelectorAll('#chart-both-0 path.curve').length") == 2
        assert window.run("return document.querySelectorAll('#chart-difference-0 path.curve').length") == 1
        assert "P.DX" in window.run("return document.querySelector('#norms').innerText")
        assert window.complaints() == []
