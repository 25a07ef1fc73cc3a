"""What can go wrong in a solution, apart from its input."""


class SolverError(RuntimeError):
    """A system could not be solved: its matrix is singular, its residual is not small, or a time step has no answer."""
