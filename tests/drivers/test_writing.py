"""Results are all there or not at all: pictures that fail, folders that stand in the way, disks that are full, nobody who reads."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from uplift.drivers.report.history_plots import draw_uplift
from uplift.drivers.report.pictures import draw
from uplift.drivers.results.folder import all_or_nothing
from uplift.meshes.checked import ModelError
from uplift.solvers.errors import Stopped
from uplift.solvers.whole_file import whole_file

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "drivers" / "scenes" / "sdls119a.toml"
CLEAN = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX", "PRTE"))}


def run(out, *more, environment=CLEAN, code=None, **streams):
    start = ["-m", "drivers"] if code is None else ["-c", code]
    command = [sys.executable, *start, "run", str(SCENE), "--method", "static", "--checkpoint", "0", "--out", str(out), *more]
    streams = streams or {"stdout": subprocess.PIPE}
    return subprocess.run(command, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True, timeout=240, **streams)


def test_a_picture_that_fails_is_said_and_costs_nothing(tmp_path):
    code = (
        "import sys; from uplift.drivers.report import plate_plots; plate_plots.draw_deformed = lambda *what: 1 / 0; "
        "from uplift.drivers.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    done = run(tmp_path, code=code)
    assert done.returncode == 0 and "note: deformed.png could not be drawn: division by zero" in done.stderr
    assert {"results.h5", "summary.json", "report.html"} <= {path.name for path in tmp_path.iterdir()}
    assert "could not be drawn" in (tmp_path / "summary.json").read_text(encoding="utf-8")


def test_names_with_dollar_signs_are_drawn(tmp_path):
    draw(draw_uplift, tmp_path / "a.png", np.arange(3.0), np.arange(3.0), "price $ \\frac{ $x$ & <b> \u00e9")
    assert (tmp_path / "a.png").stat().st_size > 1000


@pytest.mark.parametrize("name", ["history.csv", "results.h5", "report.html"])
def test_a_folder_in_the_way_is_refused_before_the_run(tmp_path, name):
    (tmp_path / name).mkdir()
    (tmp_path / name / "kept").write_text("mine", encoding="utf-8")
    done = run(tmp_path)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and f"{name} is a folder" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == [name] and (tmp_path / name / "kept").read_text(encoding="utf-8") == "mine"


def test_files_that_cannot_all_be_moved_are_moved_back(tmp_path):
    (tmp_path / "a.csv").write_text("old", encoding="utf-8")
    with pytest.raises(ModelError, match="b.csv is a folder"), all_or_nothing(tmp_path) as staging:
        for name in ("a.csv", "b.csv"):
            (staging / name).write_text("new", encoding="utf-8")
        (tmp_path / "b.csv").mkdir()
    assert (tmp_path / "a.csv").read_text(encoding="utf-8") == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "b.csv"]
    (tmp_path / "b.csv").rmdir()
    with all_or_nothing(tmp_path) as staging:
        for name in ("a.csv", "b.csv"):
            (staging / name).write_text("new", encoding="utf-8")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "b.csv"]


def test_a_move_that_fails_midway_is_undone(tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text("old", encoding="utf-8")
    whole = Path.replace

    def failing(self, target):
        if self.name == "b.csv":
            raise OSError(28, "No space left on device")
        return whole(self, target)

    with pytest.raises(ModelError, match="No space left"), all_or_nothing(tmp_path) as staging:
        for name in ("a.csv", "b.csv"):
            (staging / name).write_text("new", encoding="utf-8")
        monkeypatch.setattr(Path, "replace", failing)
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"] and (tmp_path / "a.csv").read_text(encoding="utf-8") == "old"


LIMITED = """
import resource, sys
from uplift.drivers.report import files
before = files.say_findings
def lower(*what):
    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, LIMIT))
    before(*what)
files.say_findings = lower
from uplift.drivers.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize("limit", [0, 100, 5_000, 25_000, 45_000])
def test_without_room_a_run_ends_in_one_line_and_leaves_nothing(tmp_path, limit):
    """A limit of the size of files stands for a full disk: in the tables, in the results file, in the page."""
    done = run(tmp_path, "--no-plots", "--quiet", code=LIMITED.replace("(LIMIT, LIMIT)", f"({limit}, {limit})"))
    lines = [line for line in done.stderr.splitlines() if not line.startswith("doubt")]
    assert done.returncode == 1 and len(lines) == 1 and "File too large" in lines[0], done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_block_that_fails_leaves_the_older_file(tmp_path):
    path = tmp_path / "a.h5"
    path.write_text("old", encoding="utf-8")
    with pytest.raises(OSError, match="a.h5"), whole_file(path, 10) as staging:
        staging.write_text("new", encoding="utf-8")
        raise RuntimeError("HDF5 has many words\nfor a full disk")
    assert path.read_text(encoding="utf-8") == "old" and len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("closed", ["stdout", "full", "both"])
def test_a_run_that_cannot_print_writes_its_files(tmp_path, closed):
    if closed == "full":
        with Path("/dev/full").open("w", encoding="utf-8") as full:
            done = run(tmp_path, stdout=full)
    else:
        more = ">&-" if closed == "stdout" else ">&- 2>&-"
        command = f"{sys.executable} -m drivers run {SCENE} --method static --no-plots --out {tmp_path} {more}"
        done = subprocess.run(["bash", "-c", command], cwd=ROOT, env=CLEAN, stderr=subprocess.PIPE, text=True, timeout=240)
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr
    assert (tmp_path / "results.h5").is_file()
    assert ("standard output cannot be written" in done.stderr) == (closed == "full")


def test_results_can_be_read_by_those_who_may_read_files(tmp_path):
    umask = os.umask(0)
    os.umask(umask)
    with whole_file(tmp_path / "a.h5", 10) as staging:
        staging.write_text("new", encoding="utf-8")
    assert (tmp_path / "a.h5").stat().st_mode & 0o777 == 0o666 & ~umask


def test_a_run_without_a_path_of_programs(tmp_path):
    done = run(tmp_path, "--no-plots", environment={k: v for k, v in CLEAN.items() if k != "PATH"})
    assert done.returncode == 0, done.stderr


def test_a_signal_while_a_picture_is_drawn_ends_the_run(tmp_path):
    def interrupted(path):
        raise Stopped(signal.SIGINT, "; nothing was written")

    with pytest.raises(Stopped, match="interrupted; nothing was written"):
        draw(interrupted, tmp_path / "history.png")
