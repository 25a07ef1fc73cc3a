"""Runs that are killed, stopped and resumed, as a user starts them."""

import os
import random
import signal
import time

import numpy as np
import pytest

from tests.process import SCENE, drivers, finish, start
from uplift.drivers.analysis.long_runs import identity
from uplift.drivers.analysis.progress import Progress, line
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import read_scene
from uplift.solvers.checkpoint import write_file

KILLS = int(os.environ.get("UPLIFT_KILLS", "2"))
"""How often each run is killed."""

MANY = KILLS > 3

LONG = {
    "transient": (("step = 0.005", f"step = {0.00005 if MANY else 0.0002}"), ("every = 2", "every = 50")),
    "time-frequency": (("nx = 4", f"nx = {16 if MANY else 8}"), ("ny = 8", f"ny = {32 if MANY else 16}")),
}
"""What makes a run of the reference case last a second or two, or ten for many kills."""

INTERRUPTED = {"transient": (("step = 0.005", "step = 0.00005"), ("every = 2", "every = 50"))}
"""What makes a run last ten seconds, so that it is sure to be under way when a signal comes; it is not run to its end."""

ON_RANKS = {
    "transient": (("step = 0.005", "step = 0.0005"), ("every = 2", "every = 20")),
    "time-frequency": (("nx = 4", "nx = 16"), ("ny = 8", "ny = 32")),
}
"""For several ranks on few cores, which take turns at every step of a march and hear late of a signal."""


def scene_for(method, folder, changes=LONG):
    text = SCENE.read_text(encoding="utf-8")
    for old, new in changes[method]:
        assert old in text
        text = text.replace(old, new)
    path = folder / f"{method}.toml"
    path.write_text(text, encoding="utf-8")
    return path


def begin(scene, out, *options, ranks=1):
    return start("-m", "drivers", "run", scene, "--out", out, "--no-plots", "--quiet", *options, ranks=ranks)


def end_of(child):
    done = finish(child)
    return done.returncode, done.stderr


def wait_for_checkpoint(child, folder, newer_than=0.0):
    """Wait until there is one, or the run is over, as it is at the latest when it has used up its processor time."""
    while child.poll() is None and not any(path.stat().st_mtime_ns > newer_than for path in folder.glob("*.h5")):
        time.sleep(0.01)


def killed(scene, out, method, kills, ranks=1):
    """Start a run, kill it `kills` times at random moments after a checkpoint, resuming it; return how often it was."""
    options, random_numbers, done, newest = ["--method", method, "--checkpoint", "0.05"], random.Random(kills), 0, 0
    for _ in range(kills + 5):  # a run may come to its end between its checkpoint and the first kill
        child = begin(scene, out, *options, "--resume" if newest else "--overwrite", ranks=ranks)
        wait_for_checkpoint(child, out / "checkpoint", newest)
        time.sleep(random_numbers.uniform(0, 0.3))
        if child.poll() is not None:
            end_of(child)
            if done:
                break
            continue
        child.kill()
        end_of(child)
        done += 1
        if done == kills:
            break
        newest = max((path.stat().st_mtime_ns for path in (out / "checkpoint").glob("*.h5")), default=newest)
    return done


@pytest.mark.check
@pytest.mark.parametrize("method", LONG)
def test_killed_at_any_moment_it_ends_in_the_same_bits(method, tmp_path):
    scene = scene_for(method, tmp_path)
    assert end_of(begin(scene, tmp_path / "whole", "--method", method)) == (0, "")
    kills = killed(scene, tmp_path / "broken", method, KILLS)
    assert kills == KILLS if MANY else kills > 0
    print(f"killed {kills} times")
    if (tmp_path / "broken" / "checkpoint").exists():
        assert end_of(begin(scene, tmp_path / "broken", "--method", method, "--resume")) == (0, "")
    tables = sorted(p.name for p in (tmp_path / "whole").glob("*.csv"))
    assert {"contacts.csv", "history.csv", "reactions.csv"} <= set(tables)
    for name in tables:
        assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "broken" / name).read_bytes(), name
    assert (tmp_path / "whole" / "deformed.vtu").read_bytes() == (tmp_path / "broken" / "deformed.vtu").read_bytes()
    assert not (tmp_path / "broken" / "checkpoint").exists()


@pytest.mark.check
@pytest.mark.parametrize(("method", "before", "after"), [("transient", 1, 2), ("time-frequency", 2, 1)])
def test_resumed_on_other_ranks_it_ends_in_the_same_history(method, before, after, tmp_path):
    scene = scene_for(method, tmp_path, ON_RANKS)
    for _ in range(5):  # a run may come to its end between its checkpoint and the signal
        child = begin(scene, tmp_path / "out", "--method", method, "--checkpoint", "0.05", "--overwrite", ranks=before)
        wait_for_checkpoint(child, tmp_path / "out" / "checkpoint")
        child.terminate()
        end_of(child)
        if list((tmp_path / "out" / "checkpoint").glob("*.h5")):
            break
    assert list((tmp_path / "out" / "checkpoint").glob("*.h5"))
    code, error = end_of(begin(scene, tmp_path / "out", "--method", method, "--resume", ranks=after))
    assert code == 0, error
    assert end_of(begin(scene, tmp_path / "whole", "--method", method)) == (0, "")
    here, whole = (np.genfromtxt(tmp_path / name / "history.csv", delimiter=",", skip_header=1) for name in ("out", "whole"))
    assert np.max(np.abs(here - whole)[:, 1:3]) < 1e-9 * np.max(np.abs(whole[:, 1:3]))
    assert np.allclose(here[:, 3], whole[:, 3], rtol=1e-12, atol=0.0, equal_nan=True)


@pytest.mark.parametrize(("number", "code", "word"), [(signal.SIGTERM, 143, "terminated"), (signal.SIGINT, 130, "interrupted")])
def test_a_signal_ends_the_run_with_a_checkpoint_and_one_line(number, code, word, tmp_path):
    scene, out = scene_for("transient", tmp_path, INTERRUPTED), tmp_path / "out"
    child = begin(scene, out, "--checkpoint", "0.05")
    wait_for_checkpoint(child, out / "checkpoint")
    child.send_signal(number)
    returned, error = end_of(child)
    assert returned == code
    assert error.startswith(f"uplift: {scene}: {word} at ") and len(error.splitlines()) == 1
    assert error.endswith(f"of 100000 steps; checkpoint in {out / 'checkpoint'}; go on with --resume\n")


def refused(out, *options):
    done = drivers("run", SCENE, "--out", out, "--no-plots", "--quiet", *options)
    return done.returncode, done.stderr


def test_a_checkpoint_of_another_run_or_half_of_one_is_refused_by_name(tmp_path):
    file = tmp_path / "checkpoint" / "march-1.h5"
    file.parent.mkdir()
    write_file(file, {"step": np.array(3)}, "another", "rows")
    code, error = refused(tmp_path, "--resume")
    assert (code, error) == (2, f"uplift: --resume: {file} is a checkpoint of another scene or another method\n")
    file.write_bytes(file.read_bytes()[:-100])
    code, error = refused(tmp_path, "--resume")
    assert code == 2 and error.startswith(f"uplift: --resume: {file} is truncated") and len(error.splitlines()) == 1
    assert file.exists()


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "checkpoint").write_text("", encoding="utf-8")
    code, error = refused(tmp_path)
    assert code == 2
    assert error == f"uplift: --checkpoint: cannot write into {tmp_path / 'checkpoint'}: File exists\n"


def test_identity_follows_scene_files_and_request(tmp_path):
    shaken = SCENE.read_text(encoding="utf-8")
    begin, end = shaken.index("signal = \"ricker\""), shaken.index("[[supports]]")
    (tmp_path / "scene.toml").write_text(shaken[:begin] + 'signal = "csv"\nfile = "a.csv"\n' + shaken[end:], encoding="utf-8")
    (tmp_path / "a.csv").write_text("0, 0\n1, 1\n30, 0\n", encoding="utf-8")
    scene = read_scene(tmp_path / "scene.toml")
    seen = {identity(scene, tmp_path, request) for request in (Request("transient"), Request("transient", 2), Request("modal"))}
    assert len(seen) == 3 and identity(scene, tmp_path, Request("transient")) in seen
    (tmp_path / "a.csv").write_text("0, 0\n1, 2\n30, 0\n", encoding="utf-8")
    assert identity(scene, tmp_path, Request("transient")) not in seen


class Terminal:
    """A stream that is a terminal, or not, and keeps what is written."""

    def __init__(self, tty):
        self.tty, self.text = tty, ""

    def isatty(self):
        return self.tty

    def write(self, text):
        self.text += text

    def flush(self):
        pass


def test_progress_is_for_terminals_and_not_for_the_quiet():
    for quiet, tty, shown in ((False, True, True), (True, True, False), (False, False, False)):
        stream = Terminal(tty)
        with Progress(quiet=quiet, stream=stream) as progress:
            progress("steps", 5, 10)
        assert ("steps 5 / 10 [###############...............]  50 %" in stream.text) == shown
        assert stream.text.endswith("\r\x1b[K") == shown


def test_remaining_time_follows_the_present_pace(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("uplift.drivers.analysis.progress.time.perf_counter", lambda: now[0])
    progress = Progress(quiet=False, stream=Terminal(True))
    for done in range(101):  # 100 points at one a second, then slower ones
        progress("points", done, 1000)
        now[0] += 1.0
    assert progress.remaining(1000) == pytest.approx(900)
    for done in range(101, 131):
        now[0] += 9.0
        progress("points", done, 1000)
    assert 6500 < progress.remaining(1000) < 9000
    assert line("points", 130, 1000, 8700).endswith("13 %  2:25:00 left")
    progress("steps", 1, 1000)  # another loop begins afresh
    assert progress.remaining(1000) is None
