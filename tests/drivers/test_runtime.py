"""Errors on several ranks: one message, one end, no hang."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.serial

ROOT = Path(__file__).parents[2]

PROGRAM = """
import sys
from uplift.drivers import process
from uplift.drivers.process import complain
from uplift.meshes.checked import ModelError
from uplift.solvers.errors import SolverError
process.PATIENCE = 1.0
try:
    with process.parallel() as comm:
        if comm.rank in {ranks}:
            raise {error}
        comm.barrier()
except SolverError as error:
    complain(error)
    sys.exit(1)
"""


@pytest.mark.parametrize(
    ("ranks", "error", "message"),
    [
        ((1,), "RuntimeError('a defect')", "uplift: rank 1: RuntimeError: a defect"),
        ((0,), "OSError(28, 'No space left')", "uplift: rank 0: OSError: [Errno 28] No space left"),
        ((1,), "SolverError('met by one')", "uplift: rank 1: SolverError: met by one"),
        ((0, 1), "SolverError('met by all')", "uplift: met by all"),
    ],
)
def test_an_error_ends_all_ranks_with_one_message(ranks, error, message):
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX", "PRTE"))}
    environment |= {"PYTHONPATH": str(ROOT), "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    command = [shutil.which("mpirun"), "--oversubscribe", "-n", "2", sys.executable, "-c", PROGRAM.format(ranks=ranks, error=error)]
    begin = time.monotonic()
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert [line for line in done.stderr.splitlines() if line.startswith("uplift:")] == [message]
    assert time.monotonic() - begin < 30
