"""The process around a run: real or complex PETSc, ranks, log and exit codes."""

from __future__ import annotations

import atexit
import logging
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NoReturn

from uplift.drivers.petsc_installation import Scalars, installation
from uplift.meshes.checked import ModelError
from uplift.meshes.findings import Finding
from uplift.meshes.findings import say as tell_finding
from uplift.meshes.working_folder import start_petsc
from uplift.solvers.errors import SolverError, Stopped

BAD_INPUT, FAILED = 2, 1
"""Exit codes."""

COMPLEX_COST = "two to three times as long and up to twice the memory"
"""A transient run of 16,788 dofs: 17 s of processor time instead of 9, and its steps alone 3 times as much; factors of MUMPS double."""

COMPILER = "gcc libc6-dev python3-dev"
"""Debian's packages by which forms are compiled; an interpreter that is not Debian's brings its own headers in place of the last one."""

PATIENCE = 20.0
"""s that a rank with an error waits for the others to have it too, before it ends them."""


def program() -> str:
    """Return what the user has typed before the command: the name of the installed program, or how a checkout is called."""
    return "uplift" if Path(sys.argv[0]).name == "uplift" else "python3 -m drivers"


def choose_scalars(scalars: Scalars) -> None:
    """Continue in a process whose PETSc has `scalars`; to be called before PETSc is imported.

    The build is chosen by the environment of the process at its start, so where it is the other one the process replaces itself: by
    the interpreter that UPLIFT_REAL_PYTHON or UPLIFT_COMPLEX_PYTHON names, else by the same one with the other environment. Where only
    the complex build is there, real methods run in it, and a finding says so. Raises `ModelError` where only the real one is, or if
    the named interpreter has not got what its name says. In an installation that is not known nothing is done, and `require_scalars`
    speaks up.
    """
    found, variable = installation(), f"UPLIFT_{scalars.upper()}_PYTHON"
    if found is not None and found.scalars == scalars:
        return
    if python := os.environ.get(variable):
        _see_named(variable, python, scalars)
        # Without the variable: where it names a script that starts this very interpreter, it must not be followed again.
        _replace_process(python, {name: value for name, value in os.environ.items() if name != variable})
    if found is None:
        return
    if scalars in found.builds:
        _replace_process(sys.executable, {**os.environ, **found.builds[scalars]})
    advice = f"{found.advice.format(scalars=scalars)}; name its python in {variable} if it is an environment of its own"
    if scalars == "complex" or found.scalars is None:
        raise ModelError("PETSc", f"expected the {scalars} build, and this environment has not got it: {advice}")
    tell_finding("scalars", f"real numbers are computed as complex ones, which takes {COMPLEX_COST}; for the real build {advice}")


def _see_named(variable: str, python: str, scalars: Scalars) -> None:
    """Raise `ModelError` if an interpreter named by the user cannot take over."""
    question = "from uplift.drivers.petsc_installation import installation as i; f = i(); print(f.scalars if f else 'unknown')"
    try:
        answer = subprocess.run([python, "-c", question], capture_output=True, text=True, timeout=60)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ModelError(variable, f"{python} does not start: {error}") from None
    if answer.returncode:
        raise ModelError(variable, f"{python} cannot import uplift; install uplift-fem there too")
    if answer.stdout.strip() not in (scalars, "unknown"):
        raise ModelError(variable, f"expected an interpreter with the {scalars} build of PETSc; {python} has the other one")


def _replace_process(python: str, environment: Mapping[str, str]) -> None:
    sys.stdout.flush()
    sys.stderr.flush()
    os.execvpe(python, [python, *sys.orig_argv[1:]], environment)


def require_scalars(scalars: Scalars) -> None:
    """Raise `RuntimeError` if this process has the other PETSc."""
    from petsc4py import PETSc

    here = "complex" if issubclass(PETSc.ScalarType, complex) else "real"
    if here != scalars:
        raise RuntimeError(f"this method needs the {scalars} build of PETSc, and this process has the {here} one; set PETSC_DIR")


def launcher(ranks: int) -> list[str]:
    """Return the words before a command that start it on several ranks, with the MPI of this interpreter; none for one rank."""
    if ranks == 1:
        return []
    if find_spec("dolfinx_solver"):  # the wheels bring mpich into the same environment: another launcher's ranks would not find each other
        return [str(Path(sys.executable).with_name("mpiexec")), "-n", str(ranks)]
    return [shutil.which("mpirun") or "mpirun", "--oversubscribe", "-n", str(ranks)]


def launch_rank() -> int:
    """Return this process's rank as the MPI launcher gave it, before MPI is initialised (0 without a launcher)."""
    return _rank_of_launcher() or 0


def launched() -> bool:
    """Return whether an MPI launcher has started this process."""
    return _rank_of_launcher() is not None


def _rank_of_launcher() -> int | None:
    for name in ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "SLURM_PROCID"):
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name])
    return None


class _Findings(logging.Handler):
    """Keeps the findings of a process, each once."""

    def __init__(self) -> None:
        super().__init__()
        self.heard: list[Finding] = []

    def emit(self, record: logging.LogRecord) -> None:
        finding = getattr(record, "finding", None)
        if finding is not None and finding not in self.heard:
            self.heard.append(finding)


_FINDINGS = _Findings()


def heard_findings() -> list[Finding]:
    """Return what has been found since `configure_log`, each finding once."""
    return list(_FINDINGS.heard)


def configure_log(*, quiet: bool) -> None:
    """Send the log of the package to standard error, on rank 0 only, and begin to keep its findings."""
    _FINDINGS.heard.clear()
    handler: logging.Handler = logging.StreamHandler(sys.stderr) if launch_rank() == 0 else logging.NullHandler()
    handler.setFormatter(logging.Formatter("%(message)s"))
    logger = logging.getLogger("uplift")
    logger.handlers = [handler, _FINDINGS]
    logger.propagate = False
    handler.setLevel(logging.WARNING if quiet else logging.INFO)
    logger.setLevel(logging.INFO)


@contextmanager
def _temporary_folder() -> Iterator[None]:
    """Keep temporary files in a folder of this process alone, which is gone after the block.

    Open MPI without a launcher leaves its session folder behind, so this comes before MPI is initialised. A launcher
    cleans up after its processes, and may end them at any moment.
    """
    if _rank_of_launcher() is not None:
        yield
        return
    variable, default = os.environ.get("TMPDIR"), tempfile.tempdir
    with tempfile.TemporaryDirectory(prefix="uplift-", ignore_cleanup_errors=True) as folder:
        os.environ["TMPDIR"] = tempfile.tempdir = folder
        try:
            yield
        finally:
            tempfile.tempdir = default
            if variable is None:
                del os.environ["TMPDIR"]
            else:
                os.environ["TMPDIR"] = variable


@contextmanager
def parallel() -> Iterator[Any]:
    """Give the world communicator; an error that only some ranks meet ends all of them, with one message."""
    with _temporary_folder():
        os.environ.setdefault("PATH", os.defpath)  # Open MPI looks for its own programs there
        from mpi4py import MPI

        start_petsc()
        comm = MPI.COMM_WORLD
        try:
            yield comm
        except BaseException as error:
            together = isinstance(error, (ModelError, SolverError)) or (isinstance(error, Stopped) and error.together)
            if comm.size == 1 or (together and _all_come(comm)):
                raise
            # The other ranks may wait in a collective call for ever: this ends them too.
            if isinstance(error, (KeyboardInterrupt, Stopped)):
                if comm.rank == 0:
                    print(f"uplift: {str(error) or 'interrupted; nothing was written'}", file=sys.stderr, flush=True)
                _abort(comm, 128 + getattr(error, "number", signal.SIGINT))
            print(f"uplift: rank {comm.rank}: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
            _abort(comm, 1)


def _abort(comm: Any, code: int) -> NoReturn:
    """End all ranks; not every MPI ends the one that asks for it."""
    comm.Abort(code)
    os._exit(code)


def _all_come(comm: Any) -> bool:
    """Return whether all ranks come here within `PATIENCE`, as they do with an error that all of them find (collective)."""
    request, end = comm.Ibarrier(), time.monotonic() + PATIENCE
    while not request.Test():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


@contextmanager
def silent_compiler() -> Iterator[None]:
    """Keep the command lines of the C compiler, which it sends to the root logger, out of the log."""
    level = logging.root.manager.disable
    logging.disable(logging.INFO)
    try:
        yield
    finally:
        logging.disable(level)


def form_compiler(comm: Any) -> Callable[[Any], Any]:
    """Return the function that compiles forms on the ranks of `comm`, in the user's form cache.

    Where the cache can be read but not written, a form that is not in it is compiled in a temporary folder. Raises `ModelError` where a
    form is not in the cache and no C compiler is there.
    """
    from uplift.meshes.compat import compile_form

    command = (os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc").split()[0]

    def compile_anywhere(form: Any) -> Any:
        try:
            return compile_form(form)
        except Exception as error:  # of which class depends on the release and on the number of ranks
            if shutil.which(command) is None:
                raise ModelError("C compiler", f"{command} is not there, and forms are compiled by it: apt install {COMPILER}") from None
            if not isinstance(error, (OSError, RuntimeError)):
                raise
            folder = tempfile.mkdtemp(prefix="uplift-forms-") if comm.rank == 0 else None
            folder = comm.bcast(folder, root=0)
            if comm.rank == 0:
                atexit.register(shutil.rmtree, folder, ignore_errors=True)
            return compile_form(form, folder)

    return compile_anywhere


def say(text: str) -> None:
    """Print to standard output on rank 0; where that cannot be, as behind `| head` or on a full disk, go on in silence."""
    if launch_rank() != 0:
        return
    try:
        print(text, flush=True)
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            complain(f"the standard output cannot be written: {error.strerror}")


def open_streams() -> None:
    """Open the standard streams that whoever started the process has closed; a file of results would else take their numbers."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            handle = os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, open(handle, mode, encoding="utf-8"))


def complain(text: str) -> None:
    """Print a line to standard error, on rank 0 only."""
    if launch_rank() == 0:
        print(f"uplift: {text}", file=sys.stderr, flush=True)
