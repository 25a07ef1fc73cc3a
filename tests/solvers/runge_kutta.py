"""An independent integration of a model with contacts: an explicit Runge-Kutta method of order 8 on condensed equations."""

import numpy as np
from scipy.integrate import DOP853

STIFF = 1e11
"""1/s2: a node whose stiffness over mass is larger, on a sideways spring of 5e14 N/m, follows its forces statically."""


def _eliminated(model):
    """Displacements per kept dof and per unit load, and which dofs are kept: massless and stiff ones follow statically."""
    inertia = np.diag(model.mass)
    massless = ~model.mass.any(axis=1)
    out = massless | (np.diag(model.stiffness) > STIFF * np.where(massless, 1.0, inertia))
    per_dof = np.eye(len(out))[:, ~out]
    per_dof[out] = -np.linalg.solve(model.stiffness[np.ix_(out, out)], model.stiffness[np.ix_(out, ~out)])
    per_load = np.zeros_like(model.loads)
    per_load[massless] = np.linalg.solve(model.stiffness[np.ix_(massless, massless)], model.loads[massless])
    return per_dof, per_load, ~out


def runge_kutta(model, instants, start, knots=(), tolerance=1e-11):
    """Outputs (nt, n_o) and contact forces (nt, n_c) from `start`, restarted at all instants and knots of the loads."""
    T, U, kept = _eliminated(model)
    inverse = np.linalg.inv(T.T @ model.mass @ T)
    stiffness, damping = inverse @ T.T @ model.stiffness @ T, inverse @ T.T @ model.damping @ T
    loads, push = inverse @ T.T @ model.loads, inverse @ T.T @ model.push
    pull = model.law.stiffness[:, None] * model.elongation
    Q, D, n = pull @ T, pull @ U, kept.sum()
    edges = np.union1d(instants, [t for t in knots if instants[0] < t < instants[-1]])
    y = np.concatenate([start.displacement[kept], start.velocity[kept]])
    outputs, forces = [], []

    def values(t):
        return np.array([history(np.array([t]))[0] for history in model.histories])

    def tensions(t, y):
        return Q @ y[:n] + D @ values(t)

    def rate(t, y):
        release = np.maximum(0.0, tensions(t, y))
        return np.concatenate([y[n:], loads @ values(t) - stiffness @ y[:n] - damping @ y[n:] + push @ release])

    def archive(t, y):
        tension = tensions(t, y)
        release = np.maximum(0.0, tension)
        outputs.append(model.outputs @ (T @ y[:n] + U @ values(t)) + model.output_release @ release + model.output_constant)
        forces.append(release - tension)

    archive(edges[0], y)
    for begin, end in zip(edges[:-1], edges[1:], strict=True):
        method = DOP853(rate, begin, y, end, rtol=tolerance, atol=1e-15)
        while method.status == "running":
            method.step()
        assert method.status == "finished"
        y = method.y
        if end in instants:
            archive(end, y)
    return np.array(outputs), np.array(forces)
