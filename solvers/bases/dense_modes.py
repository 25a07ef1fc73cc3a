"""Most or all modes of a small model, each eigenvalue to its own last digits, by a one-sided Jacobi iteration (LAPACK's gejsv).

Sources: Demmel and Veselic, SIAM J. Matrix Anal. Appl. 13 (1992) 1204; Drmac and Veselic, ibid. 29 (2008) 1322 and 1343.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg
from scipy.linalg import lapack

from uplift.forms.operators import Operators
from uplift.solvers.bases.pencil import gathered, shifted, unheld
from uplift.solvers.errors import SolverError


def nearest_by_jacobi(operators: Operators, shift: float, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the eigenvalues (number,), ascending, that are nearest to `shift` and their vectors (n_local, number) (collective).

    With K - sigma M = G G^T and M = L L^T, eigenvalues less sigma are the squared singular values of L^-1 G, whose columns have sizes
    from 1e2 to 1e9 and are otherwise well conditioned: one-sided Jacobi then gives each singular value to its own last digits.
    Dofs without mass come first in G, which condenses them. sigma is `shift` if <= 0, else 0: all modes are computed.
    """
    sigma = min(shift, 0.0)
    matrix = shifted(operators, sigma)
    K, M = (gathered(m).toarray().real for m in (matrix, operators.mass))
    matrix.destroy()
    order = np.argsort(np.diag(M) > 0, kind="stable")
    massless = int(np.sum(np.diag(M) <= 0))
    K, M = (m[np.ix_(order, order)] for m in (K, M))
    try:
        G = linalg.cholesky(K, lower=True)
    except linalg.LinAlgError:
        raise unheld(1) from None
    L = linalg.cholesky(M[massless:, massless:], lower=True)
    B = linalg.solve_triangular(L, G[massless:, massless:], lower=True)
    # joba = 2: accuracy for D1 C D2 with any diagonal D1, D2; no left vectors; jobp = 0: no perturbation.
    singular, _, right, work, _, info = lapack.dgejsv(B, joba=2, jobu=3, jobv=0, jobp=0)
    if info != 0:
        raise SolverError(f"the Jacobi iteration for all modes did not converge (gejsv: {info})")
    singular = singular * (work[0] / work[1])
    # x = s G^-T v: the back substitution gives small components, such as a contact's elongation, all their digits.
    tall = np.vstack([np.zeros((massless, len(singular))), right * singular])
    vectors = np.empty_like(tall)
    vectors[order] = linalg.solve_triangular(G, tall, lower=True, trans="T")
    values = singular**2 + sigma
    nearest = np.argsort(np.abs(values - shift), kind="stable")[:number]
    nearest = nearest[np.argsort(values[nearest])]
    start, end = operators.stiffness.getOwnershipRange()
    return values[nearest], vectors[start:end, nearest]
