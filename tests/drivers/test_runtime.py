"""Errors on several ranks: one message, one end, no hang."""

import re

import pytest

from tests.process import finish, start

PROGRAM = """
import sys
from uplift.drivers import process
from uplift.drivers.process import complain
from uplift.meshes.checked import ModelError
from uplift.solvers.errors import SolverError
process.PATIENCE = {patience}
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
    # A rank that is alone with its error waits in vain; where all come, none waits, and a busy machine may take its time.
    program = PROGRAM.format(ranks=ranks, error=error, patience=1.0 if len(ranks) == 1 else 600.0)
    done = finish(start("-c", program, ranks=2, seconds=30))
    assert done.returncode == 1
    # What mpirun says begins and ends with a line of dashes, which may come before the end of ours.
    assert re.findall(r"uplift:[^-\n]*", done.stderr) == [message]
