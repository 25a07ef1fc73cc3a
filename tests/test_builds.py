"""The same tests with the complex build of PETSc and on several ranks, as children of this run."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from uplift.drivers.petsc_installation import installation
from uplift.drivers.process import launcher

ROOT = Path(__file__).parents[1]
COMPLEX = dict(installation().builds.get("complex", {}))
AS_ROOT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMP_NUM_THREADS": "1"}


def child(command):
    """Run a command without what an MPI launcher has left in this process's environment."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX"))} | AS_ROOT
    return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=900)


@pytest.mark.serial
@pytest.mark.parametrize("options", [["transient"], ["time-frequency"], ["time-frequency", "--iterations", "2"], ["modal"]])
def test_ranks_agree(options, tmp_path):
    histories = []
    for ranks in (1, 2, 3):
        out = tmp_path / str(ranks)
        scene = ROOT / "drivers" / "scenes" / "sdls119a.toml"
        done = child([*launcher(ranks), sys.executable, "-m", "drivers", "run", str(scene), "--method", *options, "--no-plots", "--quiet",
                      "--out", str(out)])
        assert done.returncode == 0, done.stderr
        histories.append(np.genfromtxt(out / "history.csv", delimiter=",", skip_header=1)[:, 1:3])
    for other in histories[1:]:
        assert np.max(np.abs(other - histories[0])) < 1e-9 * np.max(np.abs(histories[0]))


@pytest.mark.serial
@pytest.mark.parametrize(("scalars", "ranks"), [("complex", 1), ("real", 2), ("real", 3), ("complex", 2)])
def test_other_builds(scalars, ranks, tmp_path):
    command = [*launcher(ranks), sys.executable, "-m", "mpi4py", "-m", "pytest", "-q", "-x", "--color=no",
               f"--basetemp={tmp_path / 'child'}", "-p", "no:cacheprovider", str(ROOT / "tests")]
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX"))} | AS_ROOT
    environment |= COMPLEX if scalars == "complex" else {}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-3000:]
    assert " passed" in done.stdout
