"""The cache of compiled forms: two runs that begin in an empty one, and what a killed run or a full disk leaves in it."""

import fcntl
import math
import os
import time
from threading import Thread
from types import SimpleNamespace

import pytest

from tests.process import finish, start
from uplift.drivers.analysis import form_cache as cache
from uplift.drivers.scene.shipped import shipped

RANK_0, RANK_1 = SimpleNamespace(rank=0), SimpleNamespace(rank=1)


def begin(home, *arguments):
    return start("-m", "drivers", *arguments, XDG_CACHE_HOME=str(home))


def ended(process):
    done = finish(process)
    return done.returncode, done.stderr


def check(home):
    return ended(begin(home, "check", shipped()["sdls119a"]))


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A cache that two runs have filled at once, and how they ended."""
    home = tmp_path_factory.mktemp("cache é")
    runs = [begin(home, "run", shipped()["sdls119a"], "--no-plots", "--quiet", "--out", home / name) for name in "ab"]
    return home, [ended(run) for run in runs]


@pytest.mark.check
def test_two_runs_share_an_empty_cache(filled):
    home, ends = filled
    assert ends == [(0, ""), (0, "")]
    assert (home / "a" / "history.csv").read_bytes() == (home / "b" / "history.csv").read_bytes()
    assert (home / "fenics" / cache.LOCK).read_bytes() == b""
    assert not list((home / "fenics").glob("*.failed"))


def cut(files):
    for path in files(".so"):
        os.truncate(path, path.stat().st_size // 2)


def zero(files):
    for path in files(".so"):
        path.write_bytes(b"")


def lose(files):
    for path in files(".so"):
        path.unlink()


def lose_source(files):
    for path in files(".c"):
        path.unlink()


def kill(files):
    """As a run leaves them that is killed in the middle of a compilation."""
    for path in [*files(".so"), *files(".cached")]:
        path.unlink()
    next(iter(files(".c"))).with_name(cache.LOCK).write_bytes(b"compiling\n")
    for path in files(".c"):
        path.touch()


@pytest.mark.check
@pytest.mark.parametrize("damage", [cut, zero, lose, lose_source, kill])
def test_a_broken_cache_is_mended(filled, damage):
    home, _ = filled
    folder = home / "fenics"
    forms = sorted(path.name for path in folder.glob("libffcx_*"))
    assert sum(name.endswith(".so") for name in forms) >= 2
    damage(lambda suffix: [path for path in folder.iterdir() if path.suffix == suffix])
    assert check(home) == (0, "")
    made_again = sorted(path.name for path in folder.glob("libffcx_*"))
    assert made_again == forms
    cache.mend(folder, 0.0)
    assert sorted(path.name for path in folder.glob("libffcx_*")) == made_again


@pytest.mark.check
def test_a_library_that_is_whole_and_no_library_is_named(filled):
    home, _ = filled
    for path in (home / "fenics").glob("*.so"):
        data = path.read_bytes()
        path.write_bytes(data[:64] + bytes(len(data) - 64))
    code, error = check(home)
    assert code == 1 and len(error.splitlines()) == 1, error
    assert f"remove {home / 'fenics'}" in error


def made(folder, name, *kinds, age=0.0):
    for kind in kinds:
        path = folder / f"libffcx_{name}{kind}"
        path.write_bytes(b"")
        os.utime(path, (time.time() - age,) * 2)


def test_what_another_program_compiles_is_left_to_it(tmp_path):
    made(tmp_path, "forms_begun", ".c", ".o")
    made(tmp_path, "forms_given_up", ".c", age=2 * cache.OLD)
    made(tmp_path, "forms_failed", ".c.failed", age=2 * cache.OLD)
    (tmp_path / "other").write_bytes(b"")
    cache.mend(tmp_path, math.inf)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "libffcx_forms_begun.c", "libffcx_forms_begun.o", "libffcx_forms_failed.c.failed", "other",
    ]
    cache.mend(tmp_path, time.time() - 10)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["libffcx_forms_failed.c.failed", "other"]


def test_one_at_a_time_and_rank_0_for_all(tmp_path, monkeypatch):
    monkeypatch.setattr("uplift.meshes.compat.form_cache_folder", lambda: tmp_path / "fenics")
    order = []

    def second():
        with cache.form_cache(RANK_0):
            order.append("second")

    with cache.form_cache(RANK_0):
        assert (tmp_path / "fenics" / cache.LOCK).read_bytes() == b"compiling\n"
        with cache.form_cache(RANK_1):
            thread = Thread(target=second)
            thread.start()
            time.sleep(0.2)
            order.append("first")
    thread.join(10)
    assert order == ["first", "second"]


def test_a_run_that_fails_is_known_by_its_mark(tmp_path, monkeypatch):
    monkeypatch.setattr("uplift.meshes.compat.form_cache_folder", lambda: tmp_path)
    with pytest.raises(KeyboardInterrupt), cache.form_cache(RANK_0):
        made(tmp_path, "forms_begun", ".c")
        raise KeyboardInterrupt
    with cache.form_cache(RANK_0):
        assert [path.name for path in tmp_path.iterdir()] == [cache.LOCK]
    assert (tmp_path / cache.LOCK).read_bytes() == b""


def test_without_locks_or_a_folder_the_cache_is_used_as_it_is(tmp_path, monkeypatch):
    (tmp_path / "file").write_bytes(b"")
    for folder in (tmp_path / "file", tmp_path):
        monkeypatch.setattr("uplift.meshes.compat.form_cache_folder", lambda folder=folder: folder)
        monkeypatch.setattr(fcntl, "flock", lambda *_: (_ for _ in ()).throw(OSError("no locks")))
        made(tmp_path, "forms_begun", ".c", age=2 * cache.OLD)
        with cache.form_cache(RANK_0):
            assert (tmp_path / "libffcx_forms_begun.c").exists()
