"""Closed forms that the benchmarks are compared with: Mindlin's plate on hard simple supports, a beam on a bed that cannot pull."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from uplift.forms.shells.material import Material
from uplift.forms.shells.shell import SHEAR_CORRECTION


@dataclass(frozen=True)
class SupportedPlate:
    """A square Mindlin plate of side `side` m on hard simple supports, by its double series of sines.

    With w = W sin(a x) sin(b y), slopes X cos(a x) sin(b y) and Y sin(a x) cos(b y), a = m pi / L, b = n pi / L, each pair (m, n) meets
    the equations of motion and the edges on its own: a system of 3 x 3 for W, X and Y. Source: R. D. Mindlin, J. Appl. Mech. 18
    (1951) 31-38. Damping is Rayleigh's, alpha K + beta M, with the rotary inertia in M.
    """

    side: float
    material: Material
    terms: int = 199
    """Highest wave number of the response series, odd."""

    @property
    def rigidity(self) -> float:
        """D in N m."""
        m = self.material
        return m.young * m.thickness**3 / (12 * (1 - m.poisson**2))

    def _matrices(self, m: int | np.ndarray, n: int | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return stiffness (..., 3, 3) and the diagonal (3,) of the mass, per area."""
        material, d, nu = self.material, self.rigidity, self.material.poisson
        a, b = np.pi * np.asarray(m) / self.side, np.pi * np.asarray(n) / self.side
        shear = SHEAR_CORRECTION * material.young * material.thickness / (2 * (1 + nu))
        rows = [
            [shear * (a * a + b * b), shear * a, shear * b],
            [shear * a, d * (a * a + (1 - nu) / 2 * b * b) + shear, d * (1 + nu) / 2 * a * b],
            [shear * b, d * (1 + nu) / 2 * a * b, d * (b * b + (1 - nu) / 2 * a * a) + shear],
        ]
        rho, t = material.density, material.thickness
        return np.moveaxis(np.array(rows), (0, 1), (-2, -1)), np.array([rho * t, rho * t**3 / 12, rho * t**3 / 12])

    def frequencies(self, count: int) -> np.ndarray:
        """Return the lowest frequencies (count,) in Hz, of bending waves."""
        numbers = range(1, count + 1)
        mass = np.diag(self._matrices(1, 1)[1])
        lowest = [linalg.eigh(self._matrices(m, n)[0], mass, eigvals_only=True)[0] for m in numbers for n in numbers]
        return np.sqrt(np.sort(lowest)[:count]) / (2 * np.pi)

    def _shares(self, pressure: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the static deflection in m of the middle that each mode has under the pressure, and the squares rad2/s2 of the modes."""
        m, n = (grid.ravel() for grid in np.meshgrid(*2 * [np.arange(1, self.terms + 1, 2)], indexing="ij"))
        stiffness, mass = self._matrices(m, n)
        root = 1 / np.sqrt(mass)
        squares, shapes = np.linalg.eigh(root[:, None] * stiffness * root)
        load = 16 * pressure / (np.pi**2 * m * n) * np.sin(m * np.pi / 2) * np.sin(n * np.pi / 2)
        shares = (load * root[0] ** 2)[:, None] * shapes[:, 0, :] ** 2 / squares
        return shares.ravel(), squares.ravel()

    def harmonic(self, pressure: float, frequencies: np.ndarray) -> np.ndarray:
        """Return the complex deflection (n_f,) m of the middle under a pressure in Pa times exp(i omega t)."""
        shares, squares = self._shares(pressure)
        damping = self.material.alpha * squares + self.material.beta
        return np.array([np.sum(shares * squares / (squares - w * w + 1j * w * damping)) for w in 2 * np.pi * frequencies])

    def step(self, pressure: float, times: np.ndarray) -> np.ndarray:
        """Return the deflection (nt,) m of the middle at times >= 0 s after a pressure in Pa is put on the plate at rest."""
        shares, squares = self._shares(pressure)
        omega = np.sqrt(squares)
        ratio = (self.material.alpha * omega + self.material.beta / omega) / 2
        deflection = np.full(len(times), shares.sum())
        for k in np.flatnonzero(np.abs(shares) > 1e-9 * np.max(np.abs(shares))):
            deflection -= shares[k] * let_go(omega[k], ratio[k], times)
        return deflection


def let_go(omega: float, ratio: float, times: np.ndarray) -> np.ndarray:
    """Return the free motion (nt,) of a damped oscillator let go at 1: under-, over- or critically damped."""
    root = np.sqrt(complex(ratio**2 - 1))
    if abs(root) < 1e-8:
        return (1 + omega * times) * np.exp(-omega * times)
    slow, fast = -omega * (ratio - root), -omega * (ratio + root)
    motion: np.ndarray = ((fast * np.exp(slow * times) - slow * np.exp(fast * times)) / (fast - slow)).real
    return motion


def lifted_strip(load: float, rigidity: float, bed: float) -> tuple[float, float]:
    """Return the deflection in m under a load in N on a long weightless beam, EI in N m2, and half the length in m that stays down.

    The bed, `bed` N/m2 for the width of the beam, pushes and cannot pull. Whatever the load, the beam touches it on a length of
    pi / lambda, lambda^4 = bed / (4 EI), and carries the load as a beam of that length with free ends: Y. Weitsman, J. Appl. Mech. 37
    (1970) 1019-1024; M. Hetenyi, Beams on Elastic Foundation (1946), section 10.
    """
    wave = (bed / (4 * rigidity)) ** 0.25
    length = np.pi  # times 1 / lambda
    deflection = load * wave / (2 * bed) * (np.cosh(length) + np.cos(length) + 2) / (np.sinh(length) + np.sin(length))
    return float(deflection), float(np.pi / (2 * wave))
