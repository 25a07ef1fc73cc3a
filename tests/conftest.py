"""One plain pytest run tests the real build on one rank; `test_builds.py` starts the others as children of it."""

import gc
import sys

import pytest
from mpi4py import MPI
from petsc4py import PETSc

from tests.browser import WANTING
from tests.process import SCENES, drivers
from uplift.drivers.scene.scene import read_scene

COMPLEX = issubclass(PETSc.ScalarType, complex)


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config):
    """Give each rank a temporary folder of its own: they would delete each other's."""
    if MPI.COMM_WORLD.size > 1 and config.option.basetemp:
        config.option.basetemp = f"{config.option.basetemp}-{MPI.COMM_WORLD.rank}"


_status = {"exit": 0}


def pytest_sessionfinish(session, exitstatus):
    _status["exit"] = int(exitstatus)


def pytest_unconfigure(config):
    """A rank that fails ends the others, which would wait for it at the next collective call."""
    if MPI.COMM_WORLD.size > 1 and _status["exit"] not in (0, 5):
        sys.stdout.flush()
        MPI.COMM_WORLD.Abort(1)


def pytest_collection_modifyitems(config, items):
    """Keep what fits this build and this number of ranks; children that are whole test runs come last, when both cores are free."""
    def fits(item):
        if COMPLEX != (item.get_closest_marker("complex") is not None) and not item.get_closest_marker("both"):
            return False
        if MPI.COMM_WORLD.size == 1:
            return True
        ranks = item.get_closest_marker("ranks")
        return ranks is not None and MPI.COMM_WORLD.size in (ranks.args or (2,))

    kept = [item for item in items if fits(item)]
    config.hook.pytest_deselected(items=[item for item in items if not fits(item)])
    items[:] = sorted(kept, key=lambda item: item.path.name in ("test_builds.py", "test_processors.py"))


def pytest_terminal_summary(terminalreporter):
    """Name in one line what needs a browser where there is none."""
    left_out = sorted(report.nodeid for report in terminalreporter.stats.get("skipped", []) if WANTING in str(report.longrepr))
    if left_out:
        terminalreporter.line(f"NOT RUN, {WANTING}: {', '.join(left_out)}")


@pytest.fixture(autouse=True)
def _collect_together():
    """PETSc objects are destroyed collectively: all ranks collect garbage at the same place."""
    yield
    if MPI.COMM_WORLD.size > 1:
        gc.collect()
        MPI.COMM_WORLD.barrier()


@pytest.fixture
def comm():
    return MPI.COMM_WORLD


@pytest.fixture
def sdls119a():
    return read_scene(SCENES / "sdls119a.toml")


@pytest.fixture
def assembly(sdls119a, comm):
    from uplift.drivers.analysis.assembled_scene import prepare

    with prepare(sdls119a, comm) as prepared:
        yield prepared


@pytest.fixture(scope="session")
def reference_run(tmp_path_factory):
    """The folder that a run of SDLS119 without options has written, but for its pictures; only to be read."""
    out = tmp_path_factory.mktemp("sdls119a")
    done = drivers("run", SCENES / "sdls119a.toml", "--no-plots", "--out", out)
    assert (done.returncode, done.stderr.count("uplift:")) == (0, 0), done.stderr
    return out
