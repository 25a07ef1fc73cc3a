"""Pictures that may fail: none costs the results of a run."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from uplift.meshes.findings import say
from uplift.solvers.errors import Stopped


def draw(function: Callable[..., None], path: Path, *what: Any) -> None:
    """Draw the picture `path` by a function of its path and of `what`; where that fails, say so and leave no file."""
    try:
        function(path, *what)
    except Stopped:
        raise  # somebody asked for the end of the run, not of the picture
    except Exception as error:  # matplotlib raises anything, from a font that is missing to a text that it takes for a formula
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        say("picture", f"{path.name} could not be drawn: {reason:.120}")
