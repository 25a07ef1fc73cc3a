"""The command line."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from uplift.drivers import process
from uplift.drivers.commands import (
    benchmarks,
    check,
    compare,
    cost,
    mesh,
    modes,
    new,
    pareto,
    platforms,
    report,
    run,
    scale,
    schema,
    stability,
    study,
    survey,
    truncation,
    verify,
)
from uplift.drivers.commands.options import missing_evidence
from uplift.meshes.checked import ModelError
from uplift.solvers.errors import SolverError, Stopped

COMMANDS = (
    run, check, new, schema, mesh, modes, truncation, study, compare, report,
    verify, cost, scale, pareto, survey, stability, benchmarks, platforms,
)
"""In the order of the help."""


def script() -> int:
    """Run the command line of this process: the entry point of the installed command."""
    return main(sys.argv[1:])


def main(arguments: list[str]) -> int:
    """Run one command; return the exit code: 0 done, 1 failed, 2 bad input, 130 interrupted, 143 terminated."""
    begin = time.perf_counter()
    process.open_streams()
    options = parser().parse_args(arguments)
    process.configure_log(quiet=getattr(options, "quiet", False))
    if missing_evidence(options):
        process.complain(f"the evidence is not installed; in a checkout of the source run: python3 -m drivers {' '.join(arguments)}")
        return process.BAD_INPUT
    try:
        return int(options.command(options, begin))
    except ModelError as error:
        where = getattr(options, "scene", None)
        process.complain(f"{where}: {error}" if where and not error.key.startswith("--") else str(error))
        return process.BAD_INPUT
    except SolverError as error:
        process.complain(f"{getattr(options, 'scene', options.command.__name__)}: {error}")
        return process.FAILED
    except Stopped as stopped:
        process.complain(f"{options.scene}: {stopped}")
        return 128 + stopped.number
    except ImportError as error:
        if not error.path or "libffcx" not in error.path:
            raise
        process.complain(f"the form cache is broken: {error}; remove {Path(error.path).parent}, which is made again")
        return process.FAILED
    except TimeoutError as error:
        if "JIT" not in str(error):
            raise
        process.complain("another program compiles the same forms, or was killed while it did; run again in a minute")
        return process.FAILED
    except KeyboardInterrupt:
        process.complain("interrupted; nothing was written")
        return 130
    except OSError as error:
        if error.errno is None:
            raise
        process.complain(f"{error.filename or getattr(options, 'out', '')}: {error.strerror}; nothing was written there")
        return process.FAILED


def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    about = "Seismic response of plates and shells on compression-only supports."
    whole = argparse.ArgumentParser(prog=process.program(), description=about)
    commands = whole.add_subparsers(required=True, metavar="COMMAND")
    for module in COMMANDS:
        module.add(commands)
    return whole
