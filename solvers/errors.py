"""What can end a solution, apart from its input."""

import signal


class SolverError(RuntimeError):
    """A system could not be solved: its matrix is singular, its residual is not small, or a time step has no answer."""


class Stopped(Exception):  # noqa: N818 - no error: somebody asked for it
    """The run ends because a signal asked for it."""

    def __init__(self, number: int, words: str, *, together: bool = True) -> None:
        """Take the number of the signal, what becomes of the run, and whether all ranks raise this at the same place."""
        super().__init__(f"{'interrupted' if number == signal.SIGINT else 'terminated'}{words}")
        self.number = number
        self.together = together
