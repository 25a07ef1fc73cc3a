"""An independent model of a plate on supports: dense matrices in extended precision, for the stability table to measure against.

It shares no step with the solvers. Elements are four-node plane stress by 2 x 2 Gauss points, written out here. Contacts are absent from
the stiffness, and the plate is pressed by forces p >= 0 that follow from the law itself,

    s = opening + p / k >= 0,   p >= 0,   s p = 0,

where the solvers bond every contact and release what pulls. Joints without a point mass are condensed to their series spring; those
with one keep the auxiliary node as a dof. On x86 numbers carry 64 bits of mantissa, eleven more than a double, so that what differs is
the round-off of the solvers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse.linalg

from uplift.drivers.scene.scene import Scene
from uplift.forms.contact.supports import Support
from uplift.forms.loads.signals import Signal
from uplift.forms.shells.material import Material
from uplift.meshes.plate import Plate
from uplift.solvers.time_domain.scheme import Scheme

EXTENDED = np.longdouble


def element_matrices(width: float, height: float, material: Material) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness N/m and consistent mass kg (8, 8) of a plane-stress rectangle, nodes counter-clockwise, x and y by turns."""
    a, b, nu = EXTENDED(width), EXTENDED(height), EXTENDED(material.poisson)
    law = EXTENDED(material.young) / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]], dtype=EXTENDED)
    stiffness, mass = np.zeros((8, 8), dtype=EXTENDED), np.zeros((8, 8), dtype=EXTENDED)
    sx, sy = np.array([-1, 1, 1, -1], dtype=EXTENDED), np.array([-1, -1, 1, 1], dtype=EXTENDED)
    root = 1 / np.sqrt(EXTENDED(3))
    for xi in (-root, root):
        for eta in (-root, root):
            shape = (1 + sx * xi) * (1 + sy * eta) / 4
            by_x, by_y = sx * (1 + sy * eta) / (2 * a), sy * (1 + sx * xi) / (2 * b)
            strain, field = np.zeros((3, 8), dtype=EXTENDED), np.zeros((2, 8), dtype=EXTENDED)
            strain[0, 0::2], strain[1, 1::2], strain[2, 0::2], strain[2, 1::2] = by_x, by_y, by_y, by_x
            field[0, 0::2] = field[1, 1::2] = shape
            weight = EXTENDED(material.thickness) * a * b / 4
            stiffness += weight * (strain.T @ law @ strain)
            mass += weight * EXTENDED(material.density) * (field.T @ field)
    return stiffness, mass


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of a symmetric positive definite matrix in its own precision, by Gauss-Jordan, its diagonal scaled to one."""
    scale = 1 / np.sqrt(np.diag(matrix))
    work = matrix * scale[:, None] * scale
    for k in range(len(work)):
        pivot = work[k, k]
        column, row = work[:, k].copy(), work[k] / pivot
        column[k] = 0
        work -= np.outer(column, row)
        row[k] = 1 / pivot
        work[:, k] = -column / pivot
        work[k] = row
    return scale[:, None] * work * scale


def answers(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the solution of a symmetric positive definite system: extended by `inverse`, double by the sparse factors of SuperLU."""
    return solver(matrix)(right)


def solver(matrix: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Return the map from right-hand sides to solutions."""
    if matrix.dtype == EXTENDED:
        inverted = inverse(matrix)
        return lambda right: inverted @ right
    return scipy.sparse.linalg.splu(scipy.sparse.csc_matrix(matrix)).solve


@dataclass(frozen=True)
class Motion:
    """What the independent model gives at every step."""

    times: np.ndarray
    """(nt,) s."""
    probes: np.ndarray
    """(nt, 2 n_probes) m, DX and DY of each probe by turns."""
    forces: np.ndarray
    """(nt, n_c) N, compression positive."""
    openings: np.ndarray
    """(nt, n_c) m, plate over auxiliary node, elastic part included."""


class DensePlate:
    """The matrices of a scene: quadrilaterals of degree 1, supports unilateral along +Y, sideways bonded, probes at nodes."""

    def __init__(self, scene: Scene, precision: type = EXTENDED) -> None:
        """Assemble; `precision` is the type of all numbers, float for models of thousands of dofs."""
        plate, model = scene.plate, scene.model
        material = model.material
        upwards = all(s.unilateral == "Y" and s.sideways == "bonded" for s in model.supports)
        if not (isinstance(plate, Plate) and plate.cell == "quadrilateral" and plate.degree in (None, 1) and upwards):
            raise ValueError("the independent model knows quadrilaterals of degree 1 on supports that push up")
        self.plate, self.type = plate, precision
        nx, ny = plate.nx, plate.ny
        joints = [(support, point) for support in model.supports for point in support.points]
        nodes = (nx + 1) * (ny + 1)
        self.n = 2 * nodes + sum(2 for support, _ in joints if support.mass > 0)
        self.stiffness: np.ndarray = np.zeros((self.n, self.n), dtype=precision)
        self.mass: np.ndarray = np.zeros((self.n, self.n), dtype=precision)
        element = element_matrices(plate.width / nx, plate.height / ny, material)
        for j in range(ny):
            for i in range(nx):
                corner = np.array([j * (nx + 1) + i, j * (nx + 1) + i + 1, (j + 1) * (nx + 1) + i + 1, (j + 1) * (nx + 1) + i])
                dofs = np.column_stack([2 * corner, 2 * corner + 1]).ravel()
                self.stiffness[np.ix_(dofs, dofs)] += element[0]
                self.mass[np.ix_(dofs, dofs)] += element[1]
        self.damping = precision(material.alpha) * self.stiffness + precision(material.beta) * self.mass
        for spring in model.springs:
            for point in spring.points:
                for axis in range(2):
                    self.stiffness[2 * self._node(point) + axis, 2 * self._node(point) + axis] += precision(spring.stiffness[axis])
        self.opens: np.ndarray = np.zeros((len(joints), self.n), dtype=precision)
        """(n_c, n): plate over auxiliary node, or over the ground where the joint is condensed."""
        self.gap: np.ndarray = np.array([precision(support.gap) for support, _ in joints], dtype=precision)
        self.flexibility: np.ndarray = np.zeros(len(joints), dtype=precision)
        extra = 2 * nodes
        for contact, (support, point) in enumerate(joints):
            dof = 2 * self._node(point)
            self._sideways(support, dof, extra)
            self.opens[contact, dof + 1] = 1
            self.flexibility[contact] = 1 / precision(support.contact[1])
            if support.mass > 0:
                self.opens[contact, extra + 1] = -1
                self.stiffness[extra + 1, extra + 1] += precision(support.stiffness[1])
                self.mass[extra, extra] = self.mass[extra + 1, extra + 1] = precision(support.mass)
                extra += 2
            else:
                self.flexibility[contact] += 1 / precision(support.stiffness[1])
        along: list[np.ndarray] = [np.zeros(self.n, dtype=precision) for _ in range(2)]
        for axis in range(2):
            along[axis][axis::2] = 1
        self.loads: list[tuple[np.ndarray, Signal | None]] = [(-precision(model.gravity) * (self.mass @ along[1]), None)]
        for motion in model.motions:
            direction = precision(motion.direction[0]) * along[0] + precision(motion.direction[1]) * along[1]
            self.loads.append((-(self.mass @ direction), motion.signal))
        self.probed = np.array([2 * self._node(probe.point) + axis for probe in model.probes for axis in range(2)])

    def _sideways(self, support: Support, dof: int, extra: int) -> None:
        spring, contact = (self.type(k[0]) for k in (support.stiffness, support.contact))
        if support.mass > 0:
            self.stiffness[extra, extra] += spring + contact
            self.stiffness[dof, dof] += contact
            self.stiffness[dof, extra] -= contact
            self.stiffness[extra, dof] -= contact
        elif spring > 0 and contact > 0:
            self.stiffness[dof, dof] += 1 / (1 / spring + 1 / contact)

    def _node(self, point: tuple[float, ...]) -> int:
        plate = self.plate
        i, j = point[0] / plate.width * plate.nx, point[1] / plate.height * plate.ny
        if max(abs(i - round(i)), abs(j - round(j))) > 1e-6:
            raise ValueError(f"no node at {point}")
        return round(j) * (plate.nx + 1) + round(i)

    def static(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the displacements (n,) m and contact forces (n_c,) N under gravity: all sets of contacts are tried from all closed on."""
        closed = np.ones(len(self.flexibility), dtype=bool)
        for _ in range(10 * len(closed) + 10):
            rows = self.opens[closed]
            stiff = rows / self.flexibility[closed][:, None]
            u = answers(self.stiffness + self._spread(rows, stiff), self.loads[0][0] - stiff.T @ self.gap[closed])
            opening = self.opens @ u + self.gap
            if np.array_equal(closed, opening < 0):
                return u, np.maximum(-opening / self.flexibility, 0)
            closed = opening < 0
        raise ArithmeticError("no static state")

    def _spread(self, rows: np.ndarray, stiff: np.ndarray) -> np.ndarray:
        """Return rows^T stiff (n, n), which has few entries."""
        if self.type is EXTENDED:
            return rows.T @ stiff
        return (scipy.sparse.csr_matrix(rows).T @ scipy.sparse.csr_matrix(stiff)).toarray()

    def load_values(self, times: np.ndarray) -> np.ndarray:
        """Return the load histories (nt, n_loads)."""
        return np.stack([np.ones(len(times)) if signal is None else signal(times) for _, signal in self.loads], axis=1).astype(self.type)

    def march(self, scheme: Scheme, step: float, steps: int, *, rest: bool = False) -> Motion:
        """March from the static state, or from zero if `rest`, by the generalised-alpha scheme with the law of contact at every step."""
        t = self.type
        dt, beta, gamma, am, af = (t(x) for x in (step, scheme.beta, scheme.gamma, scheme.alpha_m, scheme.alpha_f))
        times = step * np.arange(steps + 1)
        vectors = np.stack([vector for vector, _ in self.loads], axis=1)
        loads = self.load_values(times) @ vectors.T
        stiffness, damping, mass = (m if t is EXTENDED else scipy.sparse.csr_matrix(m) for m in (self.stiffness, self.damping, self.mass))
        answer = solver((1 - am) * self.mass + (1 - af) * (gamma * dt * self.damping + beta * dt**2 * self.stiffness))
        presses = (1 - af) * answer(np.ascontiguousarray(self.opens.T))
        law = beta * dt**2 * (self.opens @ presses) + np.diag(self.flexibility)
        n_c = len(self.flexibility)
        u, p = (np.zeros(self.n, dtype=t), np.zeros(n_c, dtype=t)) if rest else self.static()
        v: np.ndarray = np.zeros(self.n, dtype=t)
        first = loads[0] - stiffness @ u + self.opens.T @ p
        a = answers(self.mass, first) if np.max(np.abs(first)) > 1e-9 * np.max(np.abs(loads)) else np.zeros(self.n, dtype=t)
        seen, forces, openings = np.zeros((steps + 1, len(self.probed))), np.zeros((steps + 1, n_c)), np.zeros((steps + 1, n_c))
        for n in range(steps + 1):
            if n > 0:
                old_u, old_v, old_a = u, v, a
                u = u + dt * v + dt**2 * (t(0.5) - beta) * a
                v = v + dt * (1 - gamma) * a
                right = (1 - af) * loads[n] + af * loads[n - 1] + af * (self.opens.T @ p)
                right -= stiffness @ ((1 - af) * u + af * old_u) + damping @ ((1 - af) * v + af * old_v)
                right -= am * (mass @ old_a)
                a = answer(right)
                u, v = u + beta * dt**2 * a, v + gamma * dt * a
                p = complementary(law, self.opens @ u + self.gap, p > 0)
                pushed = presses @ p
                a = a + pushed
                u, v = u + beta * dt**2 * pushed, v + gamma * dt * pushed
            seen[n], forces[n], openings[n] = u[self.probed], p, self.opens @ u + self.gap
        return Motion(times, seen, forces, openings)


def complementary(law: np.ndarray, opening: np.ndarray, guess: np.ndarray) -> np.ndarray:
    """Return p >= 0 with law p + opening >= 0 and their product zero, by changing the set of pressed contacts from a guess."""
    pressed = guess
    noise = 8 * np.finfo(law.dtype).eps
    for attempt in range(20 * len(opening) + 20):
        p = np.zeros_like(opening)
        if pressed.any():
            p[pressed] = -_solve(law[np.ix_(pressed, pressed)], opening[pressed])
        left = law @ p + opening
        wrong = np.where(pressed, p < -noise * np.max(np.abs(p), initial=0.0), left < -noise * np.max(np.abs(opening), initial=0.0))
        if not wrong.any():
            return np.maximum(p, 0)
        if attempt < 20:
            pressed = pressed ^ wrong
        else:  # single changes by lowest index cannot cycle
            pressed = pressed.copy()
            pressed[int(np.argmax(wrong))] ^= True
    raise ArithmeticError("no set of contacts satisfies the law")


def _solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    return np.linalg.solve(matrix, right) if matrix.dtype != EXTENDED else inverse(matrix) @ right
