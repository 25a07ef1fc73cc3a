"""What libraries would read in the current folder, and here do not: whoever filled that folder would else choose what is run.

FFCx and dolfinx look there for compiler options in JSON, PETSc for `.petscrc`, which can name libraries to be loaded. Files of the user's
own (below XDG_CONFIG_HOME) and the environment stay in force.
"""

from __future__ import annotations

import importlib
from contextlib import suppress
from pathlib import Path
from typing import Any
from unittest.mock import patch

MODULES = ("dolfinx.jit", "ffcx.parameters", "ffcx.options")

LOADERS = ("_load_parameters", "_load_options")
"""Functions of these modules, by release; each reads once and keeps what it has read."""

NOWHERE = Path(__file__).with_name("no such folder")


def ignore_option_files() -> None:
    """Let the form compilers read their options now, with a current folder that is not there."""
    for name in MODULES:
        with suppress(ImportError):
            module: Any = importlib.import_module(name)
            for loader in LOADERS:
                read = getattr(module, loader, None)
                if read is not None:
                    read.cache_clear()
                    with patch.object(Path, "cwd", lambda: NOWHERE):
                        read()


def start_petsc() -> None:
    """Initialise PETSc without the option file of the current folder; to be called before anything imports it."""
    import petsc4py

    # Without handlers of its own PETSc leaves signals to the program, such as a pipe whose reader has gone.
    petsc4py.init(["uplift", "-skip_petscrc", "-no_signal_handler"])
