"""How many eigenvalues lie below a value: Sylvester's law of inertia.

L D L^T of K - value M has as many negative pivots as there are eigenvalues below `value`.
Source: Parlett, The Symmetric Eigenvalue Problem, chapter 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from uplift.forms.operators import Operators
from uplift.solvers.bases.pencil import gathered, shifted, unheld
from uplift.solvers.errors import SolverError


@dataclass(frozen=True)
class SturmCount:
    """Numbers of eigenvalues below the two ends of a range, in rad2/s2, from the inertia of K - end * M."""

    lower: float
    upper: float
    below_lower: int
    below_upper: int

    @property
    def inside(self) -> int:
        """Number of eigenvalues in the range."""
        return self.below_upper - self.below_lower

    def holds(self, values: np.ndarray) -> np.ndarray:
        """Tell which of the computed eigenvalues (n,) belong to the range, (n,) of bool.

        Where none was counted below the range, one that lies there was put there by round-off: eigenvalues of rigid-body modes
        are small numbers of either sign.
        """
        return (values < self.upper) & ((values > self.lower) | (self.below_lower == 0))


def count_below(operators: Operators, value: float) -> int:
    """Return the number of eigenvalues below `value` in rad2/s2: the negative pivots of L D L^T of K - value M (collective).

    Zero pivots count as negative.
    """
    matrix = shifted(operators, value)
    if np.issubdtype(PETSc.ScalarType, np.complexfloating):
        # MUMPS has no inertia in complex arithmetic, PETSc's own factorisation has it on one rank.
        own = gathered(matrix)
        matrix.destroy()
        matrix = PETSc.Mat().createAIJ(own.shape, csr=(own.indptr, own.indices, own.data), comm=PETSc.COMM_SELF)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        package = "petsc"
    else:
        package = "mumps"
    pc = PETSc.PC().create(matrix.comm)
    pc.setOperators(matrix)
    pc.setType("cholesky")
    pc.setFactorSolverType(package)
    pc.setFactorPivot(zeropivot=1e-290)  # PETSc's own limit is absolute, whatever the units
    pc.setFactorSetUpSolverType()
    if package == "mumps":
        factor = pc.getFactorMatrix()
        factor.setMumpsIcntl(13, 1)  # no ScaLAPACK at the root, which would keep its pivots to itself
        factor.setMumpsIcntl(24, 1)  # zero pivots are detected and counted instead of ending the factorisation
    try:
        pc.setUp()
        negative, zero, _ = pc.getFactorMatrix().getInertia()
    except PETSc.Error as error:
        if value <= 0:
            raise unheld(1) from error
        raise SolverError(f"the stiffness shifted by {value:g} rad2/s2 cannot be factorised: it is singular") from error
    finally:
        pc.destroy()
        matrix.destroy()
    return int(negative + zero)
