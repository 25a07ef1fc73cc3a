"""The command line, called in this process or started in one of its own, and programs on several ranks.

`drivers` is for what a command does: it calls `main`. `child` and `start` are for what a process does: exit codes, signals, the
choice of real or complex PETSc, ranks, an environment. No limit is a time on the clock, which other programs on the machine could
use up: a child may take so many seconds of processor time, and only one that waits for ever is given up by the clock.
"""

import logging
import os
import resource
import subprocess
import sys
from contextlib import ExitStack, chdir, contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from unittest.mock import patch

from petsc4py import PETSc

from uplift.drivers import process
from uplift.drivers.cli import main
from uplift.drivers.scene.shipped import shipped

ROOT = Path(__file__).parents[1]
SCENES = ROOT / "drivers" / "scenes"
SCENE = shipped()["sdls119a"]

WARNINGS_ARE_ERRORS = ("-W", "error", "-W", "ignore:Could not import numba:ImportWarning")
"""dolfinx 0.9 says on import that it could use numba."""

PROCESSOR_SECONDS = 120
"""s that each process of a child may compute; the longest command of the tests takes 30."""

FOR_EVER = 3600
"""s on the clock after which a child that has neither ended nor used up its processor time waits for something that never comes."""

LAUNCHED = ("OMPI_COMM", "PMIX", "PRTE", "PYTEST_")
"""Beginnings of the variables that an MPI launcher and pytest leave to their children."""


@dataclass(frozen=True)
class Done:
    """How a command ended, and what it printed."""

    returncode: int
    stdout: str
    stderr: str


class OtherBuild(BaseException):
    """The command needs the other build of PETSc; no error, so that nothing on the way takes it for one."""


def drivers(*arguments, cwd=ROOT):
    """Run a command in this process, with `cwd` as current folder, or in a child where it needs the other build of PETSc."""
    try:
        with _printed() as (out, err), _as_before(), chdir(cwd), patch.object(process, "choose_scalars", _stay):
            try:
                code = main([str(argument) for argument in arguments])
            except SystemExit as end:  # argparse
                code = end.code
    except OtherBuild:
        return child(*arguments, cwd=cwd)
    return Done(code, out[0], err[0])


def child(*arguments, ranks=1, cwd=ROOT, **environment):
    """Run a command in a process of its own, warnings being errors, on several `ranks` where there are to be."""
    return finish(start(*WARNINGS_ARE_ERRORS, "-m", "drivers", *arguments, ranks=ranks, cwd=cwd, **environment))


def start(*arguments, ranks=1, cwd=ROOT, seconds=PROCESSOR_SECONDS, **environment):
    """Start Python with these arguments, on several `ranks` where there are to be, and return its process."""
    return launch([*process.launcher(ranks), sys.executable, *map(str, arguments)], cwd=cwd, seconds=seconds, **environment)


def launch(command, *, cwd=ROOT, seconds=PROCESSOR_SECONDS, **environment):
    """Start any command; it and each of its children may compute for so many `seconds`."""
    started = subprocess.Popen(
        command, cwd=cwd, env=clean_environment(**environment), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    with suppress(ProcessLookupError):
        resource.prlimit(started.pid, resource.RLIMIT_CPU, (seconds, seconds))  # its children inherit it
    return started


def finish(started):
    """Wait for the end of a process that `start` or `launch` has returned."""
    with started:
        try:
            out, err = started.communicate(timeout=FOR_EVER)
        except BaseException:
            started.kill()
            raise
    return Done(started.returncode, out, err)


def on_workers():
    """Return options that give a pytest which is a child as many workers of pytest-xdist as this one has."""
    number = os.environ.get("PYTEST_XDIST_WORKER_COUNT")
    return ["-n", number, "--dist", "loadfile"] if number else []


def clean_environment(**changes):
    """Return the environment of a user's shell in the checkout, in which one thread works for each process."""
    inherited = {key: value for key, value in os.environ.items() if not key.startswith(LAUNCHED)}
    as_root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return inherited | as_root | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)} | changes


def _stay(scalars):
    if issubclass(PETSc.ScalarType, complex) != (scalars == "complex"):
        raise OtherBuild


@contextmanager
def _printed():
    """Give two lists that hold, after the block, what Python and C have written to standard output and standard error."""
    texts = ([], [])
    with ExitStack() as stack:
        for descriptor, redirect, text in zip((1, 2), (redirect_stdout, redirect_stderr), texts, strict=True):
            file = stack.enter_context(TemporaryFile("w+", encoding="utf-8"))
            saved = os.dup(descriptor)
            os.dup2(file.fileno(), descriptor)
            stack.callback(_give_back, descriptor, saved, file, text)
            stack.enter_context(redirect(file))
        yield texts


def _give_back(descriptor, saved, file, text):
    file.flush()
    os.dup2(saved, descriptor)
    os.close(saved)
    file.seek(0)
    text.append(file.read())


@contextmanager
def _as_before():
    """Leave the log and the findings of this process as they were: a command makes them its own."""
    logger, heard = logging.getLogger("uplift"), process._FINDINGS.heard
    before = list(logger.handlers), logger.propagate, logger.level, list(heard)
    try:
        yield
    finally:
        logger.handlers, logger.propagate, level, heard[:] = before
        logger.setLevel(level)
