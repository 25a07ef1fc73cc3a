"""The same tests with the complex build of PETSc and on several ranks, as children of this run, and whole runs on several ranks."""

import numpy as np
import pytest

from tests.process import ROOT, SCENE, child, finish, on_workers, start
from uplift.drivers.petsc_installation import installation

COMPLEX = dict(installation().builds.get("complex", {}))
TIER_SECONDS = 1500
"""s of processor time for a process that runs a whole tier; the longest takes 200."""

check = pytest.mark.check


@pytest.mark.parametrize("options", [
    ["transient"],
    *(pytest.param(options, marks=check) for options in (["time-frequency"], ["time-frequency", "--iterations", "2"], ["modal"])),
])
def test_ranks_agree(options, tmp_path):
    histories = []
    for ranks in (1, 2, 3):
        out = tmp_path / str(ranks)
        done = child("run", SCENE, "--method", *options, "--no-plots", "--quiet", "--out", out, ranks=ranks)
        assert done.returncode == 0, done.stderr
        histories.append(np.genfromtxt(out / "history.csv", delimiter=",", skip_header=1)[:, 1:3])
    for other in histories[1:]:
        assert np.max(np.abs(other - histories[0])) < 1e-9 * np.max(np.abs(histories[0]))


@pytest.mark.parametrize(("tier", "scalars", "ranks"), [
    *(("not check", *build) for build in (("complex", 1), ("real", 2), ("complex", 2), ("real", 3))),
    pytest.param("check", "complex", 1, marks=check),
])
def test_other_builds(tier, scalars, ranks, tmp_path):
    options = ["-q", "--color=no", f"--basetemp={tmp_path / 'child'}", "-p", "no:cacheprovider", "-m", tier]
    options += on_workers() if ranks == 1 else ["-x"]
    environment = COMPLEX if scalars == "complex" else {}
    done = finish(start("-m", "mpi4py", "-m", "pytest", *options, ROOT / "tests", ranks=ranks, seconds=TIER_SECONDS, **environment))
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-3000:]
    assert " passed" in done.stdout
