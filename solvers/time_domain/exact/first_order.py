"""A model as a system of first order with release forces that are complementary to the contact forces.

x' = A x + B f(t) + P r,   t = Q x + D f + E r  (tensions of the bonded contacts),   r >= 0,  t - r <= 0,  r (t - r) = 0,

and every displacement is u = T x + U f + W r. The march and the collocation know nothing else, so that states of first order, as a
massless dof on a dashpot has, stand beside oscillators.

Dofs without mass or damping are eliminated: they follow from equilibrium. A massless dof on a damper is a state of first order of its own,
counted from its static answer to the others; where the damping is proportional to the stiffness it stays at that answer and is left out.

Modes so stiff that their own oscillation adds nothing, such as those of a spring of 5e14 N/m that holds a node, follow their forces
statically, with their compliance, as a static (Guyan) condensation of the node would have it. What damping adds to their motion is left
out with their inertia: measured on SDLS119, 1e-9 of the answer to a harmonic load to 50 Hz, 3e-8 with a plate a thousand times as stiff.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from uplift.solvers.errors import SolverError
from uplift.solvers.time_domain.exact.model import DenseModel

STATIC_SHARE = 1e-10
"""A mode is taken statically if that changes the answer to loads and contact forces by less than this part (see `_stepped_modes`)."""
STATIC_RATIO = 10.0
"""And if its frequency is so many times that of the fastest one that is stepped."""


@dataclass(frozen=True)
class FirstOrder:
    """The system of the module's docstring in scaled modal coordinates; n states, n_c contacts."""

    A: np.ndarray
    """(n, n) 1/s, with all contacts bonded."""
    B: np.ndarray
    """(n, n_loads)."""
    P: np.ndarray
    """(n, n_c)."""
    Q: np.ndarray
    """(n_c, n) N."""
    D: np.ndarray
    """(n_c, n_loads) N."""
    E: np.ndarray
    """(n_c, n_c): what a unit release force adds to the tensions at once."""
    T: np.ndarray
    """(n_dofs, n): displacements per state."""
    U: np.ndarray
    """(n_dofs, n_loads)."""
    W: np.ndarray
    """(n_dofs, n_c)."""
    fastest: float
    """rad/s, a bound for the fastest oscillation of any set of open contacts (see `_fastest`)."""
    to_state: np.ndarray
    """(n, 2 n_dofs): state per displacement and velocity."""
    stiff: np.ndarray
    """(n_dofs, n_s): shapes with unit stiffness that follow the loads at once."""

    def state(self, displacement: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the state (n,) of displacements (n_dofs,) m and velocities (n_dofs,) m/s."""
        known: np.ndarray = self.to_state @ np.concatenate([displacement, velocity])
        return known


@dataclass(frozen=True)
class _Condensed:
    """The model without its massless dofs: u = T v + R y + F g, with g the loads and release forces side by side."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    force: np.ndarray
    """(n_v, n_g)."""
    T: np.ndarray
    F: np.ndarray
    picked: np.ndarray
    """(n_v, n_dofs): v of a displacement u."""
    rates: np.ndarray
    """(n_y,) 1/s of the states of first order."""
    R: np.ndarray
    """(n_dofs, n_y)."""
    coupling: np.ndarray
    """(n_y, n_v): damping between them and v."""
    relaxed_force: np.ndarray
    """(n_y, n_g)."""
    relaxed_part: np.ndarray
    """(n_y, n_dofs): y of a displacement u."""


def first_order(model: DenseModel) -> FirstOrder:
    """Return the system of a model. Raises `SolverError` for a stiffness that is not positive semidefinite."""
    condensed = _condense(model)
    modes, omega, stiff = _modes(condensed)
    return _assembled(model, condensed, modes, omega, stiff)


def _condense(model: DenseModel) -> _Condensed:
    """Eliminate the dofs without mass: at once where they are not damped, and from their static answer where they are."""
    n, forces = len(model.mass), np.hstack([model.loads, model.push])
    massless = ~model.mass.any(axis=1)
    damped = massless & model.damping.any(axis=1)
    still, rest = massless & ~damped, np.flatnonzero(~massless | damped)
    T, F = np.eye(n)[:, rest], np.zeros((n, forces.shape[1]))
    if still.any():
        answers = _solved(model.stiffness[np.ix_(still, still)], np.hstack([-model.stiffness[np.ix_(still, rest)], forces[still]]))
        T[still], F[still] = answers[:, : len(rest)], answers[:, len(rest) :]
    K, C, M = T.T @ model.stiffness @ T, T.T @ model.damping @ T, T.T @ model.mass @ T
    f = T.T @ forces
    picked, y = np.eye(n)[rest], damped[rest]
    if not y.any():
        none = np.zeros((0, len(rest)))
        return _Condensed(M, C, K, f, T, F, picked, np.zeros(0), np.zeros((n, 0)), none, f[:0], picked[:0])
    v = ~y
    follow = np.eye(len(rest))[:, v]
    follow[y] = _solved(K[np.ix_(y, y)], -K[np.ix_(y, v)])
    rates, shapes = _relaxations(K[np.ix_(y, y)], C[np.ix_(y, y)])
    coupling, relaxed_force = shapes.T @ (C[y] @ follow), shapes.T @ f[y]
    # What neither the other dofs nor a force drives stays at rest: with proportional damping that is all of it.
    reached = np.any(np.abs(coupling) > 1e-9 * np.abs(shapes.T @ C[np.ix_(y, v)]).max(initial=0.0), axis=1)
    driven = np.any(np.abs(relaxed_force) > 1e-12 * np.abs(f).max(initial=0.0) * np.abs(shapes).max(), axis=1)
    part = np.flatnonzero(reached | driven)
    whole = np.zeros((len(rest), part.size))
    whole[y] = shapes[:, part]
    relaxed_part = shapes[:, part].T @ C[np.ix_(y, y)] @ (picked[y] - follow[y] @ picked[v])
    return _Condensed(
        follow.T @ M @ follow, follow.T @ C @ follow, follow.T @ K @ follow, follow.T @ f, T @ follow, F, picked[v],
        rates[part], T @ whole, coupling[part], relaxed_force[part], relaxed_part,
    )


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    try:
        answer: np.ndarray = linalg.cho_solve(linalg.cho_factor(matrix, lower=True), right)
    except linalg.LinAlgError:
        raise SolverError("nothing holds a massless dof of the model") from None
    return answer


def _relaxations(stiffness: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rates (n_y,) 1/s and shapes, normalised by the damping, of massless dofs on dampers."""
    try:
        rates, shapes = linalg.eigh(stiffness, damping)
    except linalg.LinAlgError:
        raise SolverError("the damping of massless dofs is singular: the exact method cannot take it") from None
    return rates, shapes


def _modes(condensed: _Condensed) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the modes to be stepped, normalised by the mass, their frequencies rad/s, and the stiff ones, normalised by the stiffness.

    They come from the compliance, whose largest eigenvalues are the lowest modes: so these keep their digits beside springs of 1e15 N/m.
    A small multiple of the mass stands in for supports that are missing.
    """
    M, K = condensed.mass, condensed.stiffness
    shift = 1e-6 * float(np.median(np.diag(K) / np.diag(M)))
    try:
        lower = linalg.cholesky(K + shift * M, lower=True)
    except linalg.LinAlgError:
        raise SolverError("the stiffness of the model is not positive semidefinite") from None
    half = linalg.solve_triangular(lower, M, lower=True)
    squared, vectors = linalg.eigh(linalg.solve_triangular(lower, half.T, lower=True))
    if squared[0] < -1e-12 * squared[-1]:
        raise SolverError("the mass of the model is not positive semidefinite")
    shapes = linalg.solve_triangular(lower, vectors[:, ::-1], lower=True, trans="T")
    omega = np.sqrt(np.maximum(np.einsum("im,ij,jm->m", shapes, K, shapes, optimize=True), 0.0) / np.maximum(squared[::-1], 1e-300))
    rigid = int((squared * shift > 1 - 1e-6).sum())
    stepped = len(omega) if condensed.rates.size else _stepped_modes(omega, shapes.T @ condensed.force, rigid)
    modes, stiff = shapes[:, :stepped], shapes[:, stepped:]
    # The shapes were found in rounded arithmetic: each part is normalised, and their coupling through the stiffness removed, once more.
    stiff = _normalised(stiff, K)
    modes = _normalised(modes - stiff @ (stiff.T @ K @ modes), M)
    return modes, omega[:stepped], stiff


def _normalised(shapes: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return combinations of `shapes` (n, m) that are orthonormal in the norm of a matrix (n, n)."""
    if not shapes.size:
        return shapes
    lower = linalg.cholesky(shapes.T @ matrix @ shapes, lower=True)
    combined: np.ndarray = linalg.solve_triangular(lower, shapes.T, lower=True).T
    return combined


def _stepped_modes(omega: np.ndarray, force: np.ndarray, rigid: int) -> int:
    """Return how many modes must be stepped, from frequencies (n,) and generalised forces (n, n_g) of modes with unit stiffness.

    The static answer of a mode is off by (w / w_h)^2 of itself, w the highest frequency that is stepped; its part of the whole static
    answer to a force is its generalised force squared. A mode is stiff if the product of the two is small for every force.
    The first `rigid` modes have no frequency that others could be measured by: they and the first elastic one are always stepped.
    """
    share = np.cumsum(force[::-1] ** 2, axis=0)[::-1] / np.maximum((force**2).sum(axis=0), 1e-300)
    for k in range(rigid + 1, len(omega)):
        ratio = omega[k - 1] / omega[k]
        if ratio < 1 / STATIC_RATIO and share[k].max(initial=0.0) * ratio**2 < STATIC_SHARE:
            return k
    return len(omega)


def _assembled(model: DenseModel, condensed: _Condensed, modes: np.ndarray, omega: np.ndarray, stiff: np.ndarray) -> FirstOrder:
    """Return the system in the state (scale z, z', sqrt(rate) y) from modes z, static answers of stiff modes and relaxations y."""
    n, n_y, n_l = len(omega), len(condensed.rates), model.loads.shape[1]
    f, coupling = condensed.force, condensed.coupling @ modes
    scale = np.maximum(omega, 1e-6 * omega.max(initial=1.0))
    root = np.sqrt(np.where(condensed.rates > 1e-12 * condensed.rates.max(initial=0.0), condensed.rates, 1.0))
    z, dz, y = slice(n), slice(n, 2 * n), slice(2 * n, 2 * n + n_y)
    A, G = np.zeros((2 * n + n_y, 2 * n + n_y)), np.zeros((2 * n + n_y, f.shape[1]))
    A[z, dz] = np.diag(scale)
    A[y, y], A[y, dz] = -np.diag(condensed.rates), -root[:, None] * coupling
    G[y] = root[:, None] * condensed.relaxed_force
    A[dz, z] = -(modes.T @ condensed.stiffness @ modes) / scale
    A[dz, dz] = -modes.T @ condensed.damping @ modes + coupling.T @ coupling
    A[dz, y] = coupling.T * (condensed.rates / root)
    G[dz] = modes.T @ f - coupling.T @ condensed.relaxed_force
    shapes = np.zeros((len(modes), 2 * n + n_y))
    shapes[:, z] = modes / scale
    T, W = condensed.T @ shapes, condensed.F + condensed.T @ (stiff @ (stiff.T @ f))
    T[:, y] += condensed.R / root
    pull = model.law.stiffness[:, None] * model.elongation
    tension, direct = pull @ T, pull @ W
    to_state = np.zeros((2 * n + n_y, 2 * len(model.mass)))
    pick = modes.T @ condensed.mass @ condensed.picked
    to_state[z, : len(model.mass)] = scale[:, None] * pick
    to_state[dz, len(model.mass) :] = pick
    to_state[y, : len(model.mass)] = root[:, None] * condensed.relaxed_part
    return FirstOrder(
        A=A, B=G[:, :n_l], P=G[:, n_l:], Q=tension, D=direct[:, :n_l], E=direct[:, n_l:], T=T, U=W[:, :n_l], W=W[:, n_l:],
        fastest=_fastest(A, omega), to_state=to_state, stiff=condensed.T @ stiff,
    )


def _fastest(A: np.ndarray, omega: np.ndarray) -> float:
    """Return a bound for the frequency in rad/s at which margins oscillate, from the bonded generator and its natural frequencies (n,).

    No set of open contacts has a higher natural frequency than the bonded model. Where damping keeps the highest modes from oscillating,
    twice the largest imaginary part of the bonded spectrum takes their place: an open contact takes an undamped spring away.
    """
    highest = float(omega.max(initial=0.0))
    n = len(omega)
    rate = -0.5 * np.diag(A)[n : 2 * n]
    if np.sqrt(np.maximum(omega**2 - rate**2, 0.0)).max(initial=0.0) > 0.5 * highest:
        return highest
    return min(highest, 2 * float(np.abs(np.linalg.eigvals(A).imag).max(initial=0.0)))
