"""Mindlin's plate by Ritz's method in polynomials: an independent dense model of free and clamped plates."""

import numpy as np
from numpy.polynomial import legendre
from scipy import linalg


class LegendrePlate:
    """Mindlin's plate of side x side, its edges free or clamped, in products of Legendre polynomials up to `degree` for w, X and Y.

    `symmetric` keeps what is even about both axes through the middle, for loads and springs that are. Strains: curvatures X,x, Y,y,
    X,y + Y,x and shears w,x + X, w,y + Y; integrals by Gauss points, in full.
    """

    def __init__(self, side, young, poisson, thickness, degree, clamped=False, symmetric=False):
        """Assemble.

        Many parameters because they are the plate's own: side and thickness in m, Young's modulus in Pa, Poisson's ratio.
        """
        self.side, self.degree = side, degree
        # A clamped edge: the polynomials times (1 - x2).
        self.bubble = np.array([2 / 3, 0, -2 / 3]) if clamped else np.array([1.0])
        points, weights = legendre.leggauss(degree + 3)
        value = self._values(points)
        slope = self._values(points, legendre.legder) * 2 / side
        weights = weights * side / 2

        def integral(left, right):
            return left.T @ (weights[:, None] * right)

        mass, mixed, stiff = integral(value, value), integral(slope, value), integral(slope, slope)
        one, dx, dy = np.kron(mass, mass), np.kron(stiff, mass), np.kron(mass, stiff)
        w_x, w_y = np.kron(mixed, mass), np.kron(mass, mixed)  # derivative of the first, value of the second
        x_y = np.kron(mixed, mixed.T)  # d/dx of the first, d/dy of the second
        d = young * thickness**3 / (12 * (1 - poisson**2))
        s = 5 / 6 * young * thickness / (2 * (1 + poisson))
        twist = d * (1 - poisson) / 2
        even = np.arange(degree + 1) % 2 == 0
        kept = [np.kron(i, j).astype(bool) for i, j in ((even, even), (~even, even), (even, ~even))]
        self.kept = np.flatnonzero(np.concatenate(kept)) if symmetric else np.arange(3 * (degree + 1) ** 2)
        self.mass = one
        self.stiffness = np.block([
            [s * (dx + dy), s * w_x, s * w_y],
            [s * w_x.T, d * dx + twist * dy + s * one, d * poisson * x_y + twist * x_y.T],
            [s * w_y.T, d * poisson * x_y.T + twist * x_y, d * dy + twist * dx + s * one],
        ])[np.ix_(self.kept, self.kept)]

    def _values(self, points, change=lambda coefficients: coefficients):
        """The polynomials, or what `change` makes of them, at points (n,) of [-1, 1]: (n, degree + 1)."""
        rows = np.eye(self.degree + 1)
        return np.stack([legendre.legval(points, change(legendre.legmul(row, self.bubble))) for row in rows], axis=1)

    def frequencies(self, density, thickness, count):
        """The lowest frequencies in Hz, with rotary inertia; those of rigid motions are round-off."""
        inertia = np.kron(np.diag([density * thickness] + 2 * [density * thickness**3 / 12]), self.mass)
        squares = linalg.eigh(self.stiffness, inertia, eigvals_only=True, subset_by_index=[0, count - 1])
        return np.sqrt(np.abs(squares)) / (2 * np.pi)

    def at(self, points):
        """Rows (n, n_unknowns) that give the deflection at points (n, 2) m."""
        x, y = (self._values(2 * np.asarray(points)[:, k] / self.side - 1) for k in range(2))
        rows = np.einsum("pi,pj->pij", x, y).reshape(len(x), -1)
        return np.hstack([rows, np.zeros((len(rows), 2 * rows.shape[1]))])[:, self.kept]

    def spread(self, low, high):
        """Load of 1 N spread evenly over the square from low to high in both directions."""
        points, weights = legendre.leggauss(self.degree // 2 + 1)
        inside = low + (high - low) * (points + 1) / 2
        grid = np.stack(np.meshgrid(inside, inside, indexing="ij"), axis=-1).reshape(-1, 2)
        return np.outer(weights, weights).ravel() / 4 @ self.at(grid)
