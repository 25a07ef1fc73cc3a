"""SDLS119, modelisation B, written out by hand: dense matrices, 20 modes, Newmark on their diagonals, two passes.

It shares nothing with the program but the element matrices of `tests.small`, which are written out by hand too.
"""

import math

import numpy as np
import scipy.linalg

from tests.small import quadrilateral_matrices

COLUMNS, ROWS = 4, 8
ALPHA, BETA, GRAVITY = 5e-3, 0.1, 9.81
SUPPORT, CONTACT, NODE_MASS = np.array([1e15, 1e8]), 1e15, 0.1
P3 = 2 * ((COLUMNS + 1) * ROWS + COLUMNS)


def ground_motion(times):
    """The source's table: every 0.01 s, six significant digits, linear between."""
    at = 0.01 * np.arange(502)
    x = (math.pi * (at - 1.92)) ** 2
    values = np.where(at < 0.9, 0.0, math.exp(1.5) / 2 * (2 * x - 1) * np.exp(-x))
    return np.interp(times, at, [float(f"{value:.5e}") for value in values])


def matrices():
    """Stiffness, mass and damping of the plate's dofs and the elongations of the ten contact springs, and the inertia along X and Y."""
    n = 2 * (COLUMNS + 1) * (ROWS + 1)
    K, M = np.zeros((n + 10, n + 10)), np.zeros((n + 10, n + 10))
    element, inertia = quadrilateral_matrices(np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]), 1.4e8, 0.3, 2500.0, 1.0)
    for row in range(ROWS):
        for column in range(COLUMNS):
            first = row * (COLUMNS + 1) + column
            dofs = np.array([[2 * k, 2 * k + 1] for k in (first, first + 1, first + COLUMNS + 2, first + COLUMNS + 1)]).ravel()
            K[np.ix_(dofs, dofs)] += element
            M[np.ix_(dofs, dofs)] += inertia
    C = ALPHA * K + BETA * M
    for point in range(5):
        for axis in range(2):
            q, r = 2 * point + axis, n + 2 * point + axis
            # The contact is as stiff as or stiffer than the support: r is its elongation, the auxiliary node at q - r.
            node = np.array([1.0, -1.0])
            K[np.ix_([q, r], [q, r])] += SUPPORT[axis] * np.outer(node, node) + CONTACT * np.diag([0.0, 1.0])
            M[np.ix_([q, r], [q, r])] += NODE_MASS * np.outer(node, node)
    for top in (P3, P3 - 2 * COLUMNS):
        K[top + 1, top + 1] += 1.0
    along = np.zeros((2, n + 10))
    along[0, 0:n:2] = along[1, 1:n:2] = 1.0
    return K, M, C, along @ M


def lowest_modes(K, M, number):
    """The largest eigenvalues of L^T K^-1 L, M = L L^T, which keep their digits beside springs of 1e15 N/m."""
    root = np.linalg.cholesky(M)
    scale = 1 / np.sqrt(np.diag(K))
    flexibility = scale[:, None] * np.linalg.inv(scale[:, None] * K * scale) * scale
    values, vectors = scipy.linalg.eigh(root.T @ flexibility @ root)
    return scipy.linalg.solve_triangular(root.T, vectors[:, ::-1][:, :number]), 1 / values[::-1][:number]


def newmark(k, c, forces, step, beta, gamma, q, v):
    """Motions (nt, m) of single oscillators of unit mass; the first row of `forces` (nt, m) acts at the start.

    Many parameters because each is a number of the scheme, of the oscillators or of their start.
    """
    a = forces[0] - c * v - k * q
    motion, rates = [q], [v]
    for force in forces[1:]:
        q, v = q + step * v + step**2 * (0.5 - beta) * a, v + step * (1 - gamma) * a
        a = (force - c * v - k * q) / (1 + gamma * step * c + beta * step**2 * k)
        q, v = q + beta * step**2 * a, v + gamma * step * a
        motion.append(q)
        rates.append(v)
    return np.array(motion), np.array(rates)


def passes():
    """Displacements (nt, n_dofs) of two passes, at the archived instants, every 0.002 s from 0 to 5 s."""
    K, M, C, (along_x, along_y) = matrices()
    vectors, k = lowest_modes(K, M, 20)
    c = np.einsum("im,ij,jm->m", vectors, C, vectors)
    weight = -GRAVITY * along_y @ vectors
    settled, speed = newmark(k, 0 * c, np.tile(weight, (11, 1)), 0.001, 1.0, 1.5, np.zeros(20), np.zeros(20))
    times = 0.001 * np.arange(5001)
    forces = weight - np.outer(ground_motion(times), along_x @ vectors)
    n, found = len(K) - 10, []
    for _ in range(2):
        motion, _ = newmark(k, c, forces, 0.001, 0.25, 0.5, settled[-1], speed[-1])
        found.append(motion[::2] @ vectors.T)
        tension = np.maximum(0.0, CONTACT * found[-1][:, n + 1 :: 2])
        release = np.stack([np.interp(times, times[::2], column) for column in tension.T], axis=1)
        forces = forces + release @ vectors[1:10:2]
    return found
