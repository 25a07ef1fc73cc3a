"""What the ground does to a plate, by springs and by conditions, against matrices and a time integration that are written out by hand."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from tests.small import marched, quadrilateral_matrices
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.scene.scene import build_scene
from uplift.forms.assembly.reactions import BY_GROUP
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import load_values

PLATE = {"young": 1e7, "poisson": 0.3, "density": 2000.0, "thickness": 0.5, "alpha": 2e-3, "beta": 0.4}
MESH = {"width": 2.0, "height": 3.0, "nx": 2, "ny": 3}


def scene(**sections):
    table = {"mesh": MESH, "plate": PLATE, "kinematics": {"kind": "plane stress"}, "gravity": {"acceleration": 10.0},
             "probes": [{"name": "A", "point": [2.0, 3.0]}]}
    return prepare(build_scene(table | sections, Path()), MPI.COMM_WORLD)


def at_rest(assembly):
    """Resultants at rest by their names, the group "reactions" and those of each group."""
    operators = assembly.operators
    with static_state(operators, exact_uplift=True) as state:
        outputs = operators.outputs
        linear = outputs.total(outputs.partial(np.real(state.displacement.array_r)))[None]
        loads = load_values(operators, np.zeros(1), static_only=True)
        values = outputs.values(linear, state.release[None], loads, np.zeros((1, len(outputs.accelerated))))[0]
    names = [name for group in outputs.groups for name in group.names]
    kept = {**{name: None for name in operators.reactions.names}, **{name: None for name in outputs[BY_GROUP].names}}
    for group in ("reactions", BY_GROUP):
        rows = outputs.layout[group]
        kept |= dict(zip(names[rows], values[rows].tolist(), strict=True))
    return kept


@pytest.mark.ranks
@pytest.mark.both
def test_a_clamped_edge_carries_the_weight():
    """2 x 3 x 0.5 m of 2000 kg/m3 at 10 m/s2, a mass of 50 kg on a held corner and one of 100 kg at the top right corner."""
    masses = [{"name": "LOW", "points": [[0.0, 0.0]], "mass": 50.0}, {"name": "TOP", "points": [[2.0, 3.0]], "mass": 100.0}]
    with scene(conditions=[{"group": "DBAS", "zero": ["DX", "DY"]}], masses=masses) as made:
        found = at_rest(made)
        assert made.plate.moments_about == pytest.approx([1.0, 0.0, 0.0])
    weight = 2 * 3 * 0.5 * 2000 * 10
    expected = {"base shear": 0.0, "vertical reaction": weight + 1500, "overturning moment": 1000 * 1.0 - 500 * 1.0}
    expected |= {"DBAS.FX": 0.0, "DBAS.FY": weight + 1500, "DBAS.MZ": 500.0}
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-6)


@pytest.mark.ranks
@pytest.mark.both
def test_the_resultants_of_groups_add_up():
    """A plate that hangs on its left edge and stands on a contact at the right: by symmetry of nothing, sum and moments still balance."""
    support = {"name": "S", "points": [[2.0, 0.0]], "stiffness": {"Y": 1e6}, "contact": {"Y": 1e12}, "unilateral": "Y", "preload": 3e3}
    spring = {"name": "W", "points": [[2.0, 3.0], [0.0, 3.0]], "stiffness": {"X": 2e5, "Y": 1e5}}
    with scene(conditions=[{"group": "DGAU", "zero": ["DX", "DY"]}], supports=[support], springs=[spring]) as made:
        found = at_rest(made)
        assert made.plate.moments_about == pytest.approx([2.0, 0.0, 0.0]), "that of the supports"
    for name, short in (("base shear", "FX"), ("vertical reaction", "FY"), ("overturning moment", "MZ")):
        assert found[name] == pytest.approx(sum(found[f"{group}.{short}"] for group in ("S", "W", "DGAU")), rel=1e-12, abs=1e-6)
    assert found["S.FY"] > 3e3
    assert found["base shear"] == pytest.approx(0.0, abs=1e-6)
    assert found["vertical reaction"] == pytest.approx(60_000.0, rel=1e-9)
    # The weight acts 1 m to the left of the point that moments are taken about.
    assert found["overturning moment"] == pytest.approx(-60_000.0, rel=1e-9)


def shaken_by_hand(steps, dt, acceleration):
    """Forces on the held bottom row by the trapezoidal rule: base shear, vertical reaction and moment about the middle of the foot."""
    at = np.array([[x, y] for y in range(4) for x in range(3)], dtype=float)
    K, M = np.zeros((24, 24)), np.zeros((24, 24))
    element, inertia = quadrilateral_matrices(np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]), 1e7, 0.3, 2000.0, 0.5)
    for row in range(3):
        for column in range(2):
            first = 3 * row + column
            dofs = np.array([[2 * k, 2 * k + 1] for k in (first, first + 1, first + 4, first + 3)]).ravel()
            K[np.ix_(dofs, dofs)] += element
            M[np.ix_(dofs, dofs)] += inertia
    C = 2e-3 * K + 0.4 * M
    x, y = np.tile([1.0, 0.0], 12), np.tile([0.0, 1.0], 12)
    held, free = np.arange(6), np.arange(6, 24)
    weight, shake = -10.0 * M @ y, -acceleration * M @ x
    inner = np.ix_(free, free)
    u = np.linalg.solve(K[inner], weight[free])
    v, f = np.zeros(18), weight + shake
    a = np.linalg.solve(M[inner], f[free] - K[inner] @ u)
    found = []
    for _ in range(steps + 1):
        force = K[np.ix_(held, free)] @ u + C[np.ix_(held, free)] @ v + M[np.ix_(held, free)] @ a - f[held]
        found.append([force[::2].sum(), force[1::2].sum(), np.sum((at[:3, 0] - 1) * force[1::2])])
        known, rate = u + dt * v + dt**2 / 4 * a, v + dt / 2 * a
        effective = M[inner] + dt / 2 * C[inner] + dt**2 / 4 * K[inner]
        a = np.linalg.solve(effective, f[free] - C[inner] @ rate - K[inner] @ known)
        u, v = known + dt**2 / 4 * a, rate + dt / 2 * a
    return np.array(found)


@pytest.mark.ranks
def test_a_clamped_edge_that_shakes():
    load = {"direction": "X", "signal": "step", "amplitude": 2.0}
    with scene(conditions=[{"group": "DBAS", "edge": "clamped"}], load=[load]) as made:
        start = static_state(made.operators)
        history = marched(made.operators, Scheme(), 2e-3, 200, start)
        by_group = history.group(BY_GROUP)
    expected = shaken_by_hand(200, 2e-3, 2.0)
    assert np.abs(expected[:, 0]).max() > 1e4
    for column, values in enumerate(expected.T):
        assert history.reactions[:, column] == pytest.approx(values, abs=1e-9 * np.abs(expected).max())
    assert by_group == pytest.approx(history.reactions, abs=1e-6)
