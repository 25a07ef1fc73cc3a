"""Bent plates that lift from springs which cannot pull, against models of their own: exact beams, and Mindlin's plate in polynomials."""

from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import legendre

from tests.mindlin import LegendrePlate
from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene

RIGID = 1e15
"""N/m of the contacts, which stand for nothing else than contact."""


def lifted(stiffness, load, rows, springs):
    """Displacements under `load` and forces (n_c,) of springs which push only; `rows` (n_c, n) give their displacements.

    All springs are closed at first; then those that are pressed, until that is so of the same ones twice: no force pulls and no
    closed spring is missing.
    """
    closed = np.ones(len(springs), dtype=bool)
    for _ in range(50):
        active = rows[closed]
        u = np.linalg.solve(stiffness + active.T @ (springs[closed, None] * active), load)
        pressed = rows @ u < 0
        if np.array_equal(pressed, closed):
            return u, np.where(closed, -springs * (rows @ u), 0.0)
        closed = pressed
    raise AssertionError("the contacts do not settle")


def timoshenko(length, cells, bending, shear):
    """Stiffness of a beam of exact two-node cells in deflection w and rotation theta = w' + shear angle, (2 n, 2 n)."""
    h = length / cells
    phi = 12 * bending / (shear * h * h)
    cell = bending / ((1 + phi) * h**3) * np.array([
        [12, 6 * h, -12, 6 * h], [6 * h, (4 + phi) * h * h, -6 * h, (2 - phi) * h * h],
        [-12, -6 * h, 12, -6 * h], [6 * h, (2 - phi) * h * h, -6 * h, (4 + phi) * h * h],
    ])
    stiffness = np.zeros((2 * cells + 2, 2 * cells + 2))
    for i in range(cells):
        stiffness[2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += cell
    return stiffness


YOUNG, THICKNESS, LENGTH = 3e10, 0.5, 12.0
ACROSS = ((0.0, 1 / 6), (0.5, 4 / 6), (1.0, 1 / 6))
"""Places across a strip of one cell of degree 2 and their shares of a line load, which then bends it to a cylinder."""


def strip(comm, load, weight, bed, gap=0.0):
    """Deflections of the middle line and contact forces of a strip of 12 m x 1 m at 25 stations, under a force on its middle."""
    stations = np.linspace(0.0, LENGTH, 25)
    supports = [
        {"name": f"{number}", "points": [[x, y] for x in stations], "stiffness": {"Z": share * bed}, "contact": {"Z": RIGID},
         "unilateral": "Z", "gap": gap} for number, (y, share) in enumerate(ACROSS)
    ]
    loads = [{"kind": "force", "points": [[LENGTH / 2, y]], "force": {"Z": -share * load}} for y, share in ACROSS]
    table = {
        "mesh": {"width": LENGTH, "height": 1.0, "nx": 96, "ny": 1},
        "plate": {"young": YOUNG, "poisson": 0.0, "density": weight / 10.0 / THICKNESS, "thickness": THICKNESS},
        "gravity": {"acceleration": 10.0}, "supports": supports, "load": loads,
        "probes": [{"name": f"P{i}", "point": [x, 0.5]} for i, x in enumerate(stations)],
    }
    with prepare(build_scene(table, Path()), comm) as assembly:
        history = analyse(assembly, Request("static")).final
        law = assembly.operators.contacts.law
        force = law.compression(law.tension(history.elongation), history.release)[0]
        return stations, history.probes[0], force.reshape(3, -1).sum(axis=0), history.reactions[0]


@pytest.mark.both
@pytest.mark.parametrize(
    ("load", "weight", "gap", "open_at_end"),
    [(2e6, 1.0, 0.0, 5), (2e6, 12.5e3, 0.0, 4), pytest.param(2e6, 12.5e3, 2e-3, 4, marks=pytest.mark.ranks), (1e5, 12.5e3, 0.0, 0)],
)
def test_a_strip_under_a_central_load_lifts_its_ends(comm, load, weight, gap, open_at_end):
    """Against a beam of exact cells on the same springs: deflections, contact forces and the stations that lift.

    Without weight, with it, with springs 2 mm below, and pressed so little that nothing lifts.
    """
    bed = 2e7
    stations, deflection, force, reactions = strip(comm, load, weight, bed, gap)
    bending, shear = YOUNG * THICKNESS**3 / 12, 5 / 6 * YOUNG / 2 * THICKNESS
    cells = 24
    stiffness, h = timoshenko(LENGTH, cells, bending, shear), LENGTH / cells
    right = np.zeros(2 * cells + 2)
    for i in range(cells):  # constant load of a cell; its exact end forces and moments are those of the clamped beam
        right[2 * i : 2 * i + 4] -= weight * np.array([h / 2, h * h / 12, h / 2, -h * h / 12])
    right[cells] -= load
    rows = np.zeros((cells + 1, 2 * cells + 2))
    rows[np.arange(cells + 1), 2 * np.arange(cells + 1)] = 1.0
    # Springs that begin `gap` lower: measured from there, the beam lies at the height gap and is otherwise the same.
    u, expected = lifted(stiffness, right, rows, np.full(cells + 1, bed * RIGID / (bed + RIGID)))
    assert np.count_nonzero(expected[: cells // 2] == 0) == open_at_end
    assert (force < 1e-9 * load).tolist() == (expected == 0).tolist()
    assert deflection == pytest.approx(u[0::2] - gap, abs=1e-4 * np.max(np.abs(u[0::2])))
    assert force == pytest.approx(expected, abs=1e-4 * np.max(expected))
    assert reactions[0] == pytest.approx(load + weight * LENGTH, rel=1e-9)


RAFT = {"young": 3e10, "poisson": 0.2, "density": 2500.0, "thickness": 0.3}
"""The raft that ships, its slab only 0.3 m thick, so that a central load lifts its corners."""

SPRING, BED = 2e7, 2e7
"""N/m of each of its 11 x 11 springs, and N/m3 of a bed that is spread over its area."""

SPRINGS = {"grid": {"from": [0.0, 0.0], "to": [10.0, 10.0], "count": [11, 11]}, "stiffness": {"Z": SPRING}}
SPREAD = {"group": "DAL1", "per": "area", "stiffness": {"Z": BED}}


def raft(comm, load, n, bed):
    """Places and forces of the contacts, and the deflections of corner and middle, of the raft under its weight and a central load.

    The load is spread evenly over the middle 2 m x 2 m, by Simpson's rule on the nodes of n x n cells of degree 2.
    """
    at = np.linspace(4.0, 6.0, 2 * (n // 5) + 1)
    simpson = np.ones(len(at))
    simpson[1:-1:2], simpson[2:-1:2] = 4.0, 2.0
    simpson /= simpson.sum()
    loads = [
        {"kind": "force", "points": [[float(x), float(y)]], "force": {"Z": -load * a * b}}
        for x, a in zip(at, simpson, strict=True) for y, b in zip(at, simpson, strict=True)
    ]
    table = {
        "mesh": {"width": 10.0, "height": 10.0, "nx": n, "ny": n}, "plate": RAFT, "gravity": {"acceleration": 9.81}, "load": loads,
        "supports": [{"name": "BED", "contact": {"Z": RIGID}, "unilateral": "Z", **bed}],
        "probes": [{"name": name, "point": point} for name, point in (("CORNER", "P3"), ("MIDDLE", [5.0, 5.0]))],
    }
    with prepare(build_scene(table, Path()), comm) as assembly:
        history = analyse(assembly, Request("static")).final
        contacts = assembly.operators.contacts
        force = contacts.law.compression(contacts.law.tension(history.elongation), history.release)[0]
        return contacts.points[:, :2], force, history.probes[0]


def raft_in_polynomials(load, degree, points, springs):
    """Forces of springs (n,) N/m at points (n, 2) m, and the deflections of corner and middle, by the polynomials."""
    plate = LegendrePlate(10.0, RAFT["young"], RAFT["poisson"], RAFT["thickness"], degree, symmetric=True)
    weight = 9.81 * RAFT["density"] * RAFT["thickness"] * 100.0
    right = -load * plate.spread(4.0, 6.0) - weight * plate.spread(0.0, 10.0)
    u, force = lifted(plate.stiffness, right, plate.at(points), springs)
    return force, plate.at([(10.0, 10.0), (5.0, 5.0)]) @ u


def test_a_raft_on_springs_lifts_its_corners_under_a_central_load(comm):
    """The same 72 of 121 springs lift, and all forces and deflections agree to 2e-3 of the largest.

    More is not to be had: under a point spring the deflection of Mindlin's plate is logarithmic, so that each halving of the
    cells moves it by some 1e-3 / 2 pi of the spring's share; the polynomials, of degree 24, 32 and 40, still move by 1e-3 and 2e-4.
    """
    points = np.stack(np.meshgrid(*2 * [np.linspace(0.0, 10.0, 11)]), axis=-1).reshape(-1, 2)
    springs = np.full(len(points), SPRING * RIGID / (SPRING + RIGID))
    expected, deflections = raft_in_polynomials(2e7, 32, points, springs)
    places, force, found = raft(comm, 2e7, 20, SPRINGS)
    assert places == pytest.approx(points, abs=1e-9)
    assert np.count_nonzero(expected == 0) == 72 and deflections[0] > 0.03
    assert (force <= 1e-9 * expected.max()).tolist() == (expected == 0).tolist()
    assert force == pytest.approx(expected, abs=2e-3 * expected.max())
    assert found == pytest.approx(deflections, rel=2e-3)


def test_a_raft_on_a_bed_that_cannot_pull_converges_to_the_plate_in_polynomials(comm):
    """No point force, so no logarithm: 2e-2, 2e-3 and 1e-4 with 5, 10 and 20 cells a side (the last takes 10 s and is left out)."""
    gauss, weights = legendre.leggauss(40)
    inside, weights = 5 + 5 * gauss[20:], weights[20:]  # a quarter of the bed, for all four
    points = np.stack(np.meshgrid(inside, inside), axis=-1).reshape(-1, 2)
    _, deflections = raft_in_polynomials(2e7, 32, points, 4 * 25 * BED * np.outer(weights, weights).ravel())
    for n, limit in ((5, 3e-2), (10, 3e-3)):
        _, force, found = raft(comm, 2e7, n, SPREAD)
        assert np.max(np.abs(found / deflections - 1)) < limit
        assert force.sum() == pytest.approx(2e7 + 9.81 * 2500 * 0.3 * 100, rel=1e-9)
