"""A damped two-dof oscillator with a closed form."""

import numpy as np
import scipy.linalg

MASS = np.diag([2.0, 1.0])
STIFFNESS = np.array([[60.0, -20.0], [-20.0, 20.0]])
DAMPING = 0.004 * STIFFNESS + 0.1 * MASS
U0, V0 = np.array([0.3, -0.1]), np.array([1.0, 2.0])
FORCE = np.array([5.0, -3.0])


def modes():
    squared, vectors = scipy.linalg.eigh(STIFFNESS, MASS)
    omega = np.sqrt(squared)
    return omega, vectors, 0.5 * (0.004 * omega + 0.1 / omega)


def step_response(times):
    """Displacements (nt, 2) under the constant FORCE from U0, V0: free damped vibration about the static answer."""
    omega, vectors, ratio = modes()
    static = np.linalg.solve(STIFFNESS, FORCE)
    q0, p0 = vectors.T @ MASS @ (U0 - static), vectors.T @ MASS @ V0
    damped = omega * np.sqrt(1 - ratio**2)
    t = np.asarray(times)[:, None]
    decay = np.exp(-ratio * omega * t)
    q = decay * (q0 * np.cos(damped * t) + (p0 + ratio * omega * q0) / damped * np.sin(damped * t))
    return static + q @ vectors.T


def frequency_response(omega):
    """Displacements (2,) under FORCE exp(i omega t)."""
    own, vectors, ratio = modes()
    return vectors @ ((vectors.T @ FORCE) / (own**2 - omega**2 + 2j * ratio * own * omega))
