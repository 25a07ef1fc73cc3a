"""Modes, effective masses and reduced models, against dense algebra solved another way and against runs in all dofs."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scipy import linalg

from tests.small import contact_on, dense_operators, marched, to_dense
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.scene.scene import build_scene
from uplift.meshes.checked import ModelError
from uplift.solvers.bases import modes as module
from uplift.solvers.bases.basis import Basis
from uplift.solvers.bases.modes import effective_masses, modes
from uplift.solvers.bases.project import project
from uplift.solvers.bases.static_answers import with_static_answers
from uplift.solvers.errors import SolverError
from uplift.solvers.time_domain.initial import settled_state, static_state
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.scheme import Scheme, generalised_alpha, hilber_hughes_taylor
from uplift.solvers.time_domain.state import at_rest

pytestmark = pytest.mark.both

SCENE = tomllib.loads((Path(__file__).parents[2] / "drivers" / "scenes" / "sdls119a.toml").read_text(encoding="utf-8"))
TRAPEZOIDAL = Scheme()


def changed_plant(**changes):
    """The reference scene with whole sections replaced (None: taken out)."""
    table = copy.deepcopy(SCENE)
    for section, value in changes.items():
        if value is None:
            del table[section]
        else:
            table[section] = value
    return prepare(build_scene(table, Path()), MPI.COMM_WORLD)


@pytest.fixture(scope="module")
def reference():
    with changed_plant() as made:
        yield made


@pytest.fixture(scope="module")
def twenty(reference):
    return modes(reference.operators, number=20)


@pytest.fixture(scope="module")
def every_one(reference):
    return modes(reference.operators, number=reference.operators.n)


def supports_of(penalty):
    return [SCENE["supports"][0] | {"stiffness": {"X": penalty, "Y": 1e8}, "contact": {"X": penalty, "Y": penalty}}]


def frequencies_from_flexibility(penalty, number):
    """Frequencies from the flexibility of the plate alone, so that no large stiffness is ever added to a small one.

    A joint is the compliance 1/k_c + 1/(k_s - lambda m), which depends on the eigenvalue: a fixed point for each mode,
    contracting by lambda m / k_s < 1e-4. K0, the plate on springs k0, is updated by Woodbury's formula.
    """
    feet = [{"name": f"N{i}", "point": [float(i), 0.0]} for i in range(5)]
    with changed_plant(supports=[], probes=feet) as bare:
        K, M = np.real(to_dense(bare.operators.stiffness)), np.real(to_dense(bare.operators.mass))
        rows = bare.operators.probes.local.toarray()
        feet_rows = np.hstack(MPI.COMM_WORLD.allgather(rows))
    k0, k_s, mass = 3e7, np.tile([penalty, 1e8], 5), 0.1
    F0 = linalg.inv(K + k0 * feet_rows.T @ feet_rows)
    G, L = F0 @ feet_rows.T, linalg.cholesky(M, lower=True)
    values = np.zeros(number)
    for i in range(number):
        for _ in range(5):
            stiffness = 1 / (1 / penalty + 1 / (k_s - values[i] * mass))
            F = F0 - G @ linalg.solve(np.diag(1 / (stiffness - k0)) + feet_rows @ G, G.T, assume_a="sym")
            largest = linalg.eigvalsh(L.T @ (F + F.T) / 2 @ L)[::-1]
            values[i] = 1 / largest[i]
    return np.sqrt(values) / (2 * np.pi)


@pytest.mark.parametrize("penalty", [1e12, 1e15, pytest.param(1e18, marks=pytest.mark.ranks)])
def test_frequencies_keep_their_digits_beside_stiff_joints(penalty):
    with changed_plant(supports=supports_of(penalty)) as made:
        found = modes(made.operators, number=20)
        whole = modes(made.operators, number=made.operators.n)
    expected = frequencies_from_flexibility(penalty, 20)
    # Both methods are good to 1e-12; a single cancellation beside the penalty would cost 1e-9 at 1e12 and all digits at 1e18.
    np.testing.assert_allclose(found.frequencies, expected, rtol=1e-11)
    np.testing.assert_allclose(whole.frequencies[:20], expected, rtol=1e-11)
    assert whole.sturm.inside == whole.number


@pytest.mark.ranks
def test_modes_are_counted_orthonormal_and_solve_the_equations(reference, twenty, every_one):
    assert (twenty.number, twenty.rigid, twenty.sturm.below_lower, twenty.sturm.inside) == (20, 0, 0, 20)
    assert twenty.frequencies[-1] < np.sqrt(twenty.sturm.upper) / (2 * np.pi) < every_one.frequencies[20]
    assert twenty.residuals.max() < 1e-10
    assert twenty.orthonormality < 1e-11
    assert every_one.residuals.max() < 1e-8
    assert every_one.orthonormality < 1e-10
    np.testing.assert_allclose(every_one.frequencies[:20], twenty.frequencies, rtol=1e-11)
    # Independent of the module's own figures: the matrices gathered and multiplied.
    K, M = np.real(to_dense(reference.operators.stiffness)), np.real(to_dense(reference.operators.mass))
    V = np.vstack(MPI.COMM_WORLD.allgather(twenty.basis.vectors))
    np.testing.assert_allclose(V.T @ M @ V, np.eye(20), atol=1e-11)
    np.testing.assert_allclose(V.T @ K @ V, np.diag(twenty.eigenvalues), atol=1e-9 * twenty.eigenvalues[-1])
    np.testing.assert_allclose(np.abs(V).max(axis=0), V.max(axis=0), rtol=1e-5)


@pytest.mark.ranks
def test_a_band_holds_the_same_modes_as_the_lowest(reference, twenty):
    low = modes(reference.operators, band=(0.0, 20.0))
    inner_band = modes(reference.operators, band=(5.0, 53.0))
    np.testing.assert_allclose(low.frequencies, twenty.frequencies[:5], rtol=1e-11)
    np.testing.assert_allclose(inner_band.frequencies, twenty.frequencies[1:19], rtol=1e-11)
    np.testing.assert_allclose(inner_band.basis.vectors, twenty.basis.vectors[:, 1:19], atol=1e-8)
    assert (inner_band.sturm.below_lower, inner_band.sturm.below_upper) == (1, 19)


@pytest.mark.ranks
def test_joints_are_found_as_a_band_too(reference, every_one):
    joints = modes(reference.operators, band=(1e5, 2e5))
    np.testing.assert_allclose(joints.frequencies, every_one.frequencies[85:88], rtol=1e-11)


@pytest.mark.ranks
def test_effective_masses_of_all_modes_are_the_total_mass(reference, twenty, every_one):
    gravity, motion = (load.vector for load in reference.operators.loads)
    total = reference.plate.total_mass
    masses = effective_masses(every_one, [motion, gravity]) / [1.0, 9.81**2]
    np.testing.assert_allclose(masses.sum(axis=0), total, rtol=1e-11)
    some = effective_masses(twenty, [motion, gravity]) / [1.0, 9.81**2]
    np.testing.assert_allclose(some, masses[:20], rtol=1e-6, atol=1e-8 * total)
    assert np.all(some.sum(axis=0) < total)
    assert np.all(some.sum(axis=0) > 0.9 * total)


@pytest.mark.ranks
def test_a_free_square_plate_has_three_rigid_modes_double_modes_and_rayleigh_damping():
    with changed_plant(supports=[], springs=[], mesh=SCENE["mesh"] | {"height": 4.0, "ny": 4}) as free:
        found = modes(free.operators, number=20, shift=-1e4)
        K, M = np.real(to_dense(free.operators.stiffness)), np.real(to_dense(free.operators.mass))
        with pytest.raises(SolverError, match="rigid-body modes or mechanisms.*negative shift"):
            modes(free.operators, number=5)
        with pytest.raises(SolverError, match="rigid-body"):
            modes(free.operators, band=(0.0, 30.0))
        with pytest.raises(SolverError, match="rigid-body"):
            modes(free.operators, number=50)
        all_of_them = modes(free.operators, number=50, shift=-1e4)
    expected = linalg.eigvalsh(K, M)
    assert found.rigid == 3
    assert np.all(found.frequencies[:3] == 0) and np.all(found.damping[:3] == 0)
    # The dense reference is good to eps * lambda_max.
    np.testing.assert_allclose(found.eigenvalues[3:], expected[3:20], rtol=1e-9)
    np.testing.assert_allclose(all_of_them.eigenvalues[3:], expected[3:], rtol=1e-9)
    assert np.min(np.diff(found.eigenvalues[3:]) / found.eigenvalues[4:]) < 1e-9, "a square plate has double modes"
    assert found.orthonormality < 1e-10
    w = found.omega[3:]
    np.testing.assert_allclose(found.damping[3:], (5e-3 * w + 0.1 / w) / 2, rtol=1e-9)


def test_a_very_thin_plate_has_its_frequencies_in_spite_of_the_round_off_of_its_stiff_shear():
    """t / L = 1e-5: shear is some 1e10 times as stiff as bending. Thin-plate theory of the supported square plate, its mesh 0.1 % off."""
    plate = {"young": 2e11, "poisson": 0.3, "density": 8000.0, "thickness": 1e-5}
    held = [{"group": group, "edge": "hard"} for group in ("DBAS", "DDRO", "DHAU", "DGAU")]
    table = {"mesh": {"width": 1.0, "height": 1.0, "nx": 8, "ny": 8}, "plate": plate, "conditions": held, "kinematics": {"kind": "bending"}}
    with prepare(build_scene(table, Path()), MPI.COMM_WORLD) as thin:
        found = modes(thin.operators, number=4)
    unit = np.pi / 2 * np.sqrt(2e11 * 1e-10 / (12 * 0.91 * 8000.0))
    assert found.frequencies == pytest.approx(unit * np.array([2, 5, 5, 8]), rel=3e-3)
    assert found.frequencies[2] == pytest.approx(found.frequencies[1], rel=1e-5)


def test_two_masses_that_nothing_holds():
    with dense_operators([[3.0, -3.0], [-3.0, 3.0]], np.diag([1.0, 2.0])) as operators:
        for options in ({"number": 1}, {"number": 2}, {"band": (0.0, 1.0)}):
            with pytest.raises(SolverError, match="at least 1 rigid-body modes or mechanisms"):
                modes(operators, **options)
        found = modes(operators, number=2, shift=-1.0)
        same = modes(operators, band=(0.0, 1.0), shift=-1.0)
    np.testing.assert_allclose(found.eigenvalues, [0.0, 4.5], rtol=1e-14)
    np.testing.assert_allclose(same.eigenvalues, [0.0, 4.5], rtol=1e-14)
    np.testing.assert_allclose(found.basis.vectors[:, 0], 3**-0.5, rtol=1e-14)


@pytest.mark.parametrize("computed", [-1e-15, 1e-15])
def test_a_rigid_motion_is_named_whichever_sign_round_off_gives_its_eigenvalue(monkeypatch, computed):
    """Both the count at 0 and the eigenvalue are round-off then; whether another mode is lost as well, it is the rigid one that counts."""
    rigid = np.array([[3**-0.5], [3**-0.5]])
    with dense_operators([[3.0, -3.0], [-3.0, 3.0]], np.diag([1.0, 2.0])) as operators:
        monkeypatch.setattr(module, "_nearest", lambda *_, **options: (
            (np.zeros(0), np.zeros((2, 0))) if "away_from" in options else (np.array([computed]), rigid)))
        for counted in (1, 2):
            monkeypatch.setattr(module, "count_below", lambda _, value, counted=counted: counted if value > 0 else 0)
            with pytest.raises(SolverError, match="rigid-body modes or mechanisms.*negative shift"):
                modes(operators, band=(0.0, 1.0))


@pytest.mark.ranks
def test_errors_say_what_is_wrong(reference):
    operators = reference.operators
    with pytest.raises(ModelError, match="number: expected >= 1 and <= 100, the dofs that have mass, got 101"):
        modes(operators, number=101)
    with pytest.raises(ModelError, match="no mode between 2 and 5 Hz; the nearest are at 1.82102 Hz and 6.51606 Hz"):
        modes(operators, band=(2.0, 5.0))
    with pytest.raises(ModelError, match="band: expected 0 <= low < high"):
        modes(operators, band=(5.0, 5.0))
    with pytest.raises(ModelError, match="shift: expected <= 0"):
        modes(operators, number=3, shift=1.0)
    with pytest.raises(ModelError, match="either"):
        modes(operators)
    with pytest.raises(SolverError, match="linearly dependent"):
        project(operators, Basis(np.ones((operators.n_local, 2)), operators.comm))


def difference(one, other):
    """Largest differences of probes and elongations, relative to their largest values."""
    pairs = (one.probes, other.probes), (one.elongation, other.elongation)
    return [np.max(np.abs(a - b)) / np.max(np.abs(b)) for a, b in pairs]


@pytest.fixture(scope="module")
def physical(reference):
    """Two passes in all dofs over the strong part of the pulse, from the over-damped start of modelisation B."""
    operators = reference.operators
    with (
        settled_state(operators, Scheme(1.0, 1.5), 1e-3, 10) as start,
        Newmark(operators, TRAPEZOIDAL, 4e-3) as method,
    ):
        first = transient(method, start, 700, every=2)
        release = operators.contacts.law.release(first.elongation)
        return first, transient(method, start, 700, every=2, release=release), release


def run(operators, basis, release, **options):
    model = project(operators, basis, **options)
    return marched(model, TRAPEZOIDAL, 4e-3, 700, settled_state(model, Scheme(1.0, 1.5), 1e-3, 10), every=2, release=release)


@pytest.mark.ranks
def test_all_modes_give_the_physical_run(reference, every_one, physical):
    first, second, release = physical
    assert release.max() > 1e4, "the scene must open its contacts"
    one = run(reference.operators, every_one.basis, None)
    # The physical run itself is good to about 1e-10 of the contact forces.
    assert max(difference(one, first)) < 1e-9
    assert max(difference(run(reference.operators, every_one.basis, release), second)) < 1e-9
    np.testing.assert_array_equal(one.times, first.times)
    np.testing.assert_allclose(one.reactions, first.reactions, atol=1e-9 * np.abs(first.reactions).max())
    np.testing.assert_allclose(one.accelerations, first.accelerations, atol=1e-8 * np.abs(first.accelerations).max())
    assert one.peak == first.peak
    np.testing.assert_allclose(one.peak_field, first.peak_field, atol=1e-9 * np.abs(first.probes).max())


@pytest.mark.ranks
def test_static_answers_bring_the_contacts_closer(reference, twenty, physical):
    _, second, release = physical
    operators = reference.operators
    corrected = with_static_answers(operators, twenty.basis)
    assert corrected.size == 30, "two loads, five contacts and three resultants are added"
    np.testing.assert_allclose(to_dense(project(operators, corrected).mass), np.eye(30), atol=1e-11)
    plain = difference(run(operators, twenty.basis, release), second)
    better = difference(run(operators, corrected, release), second)
    # Measured: 17 % and 0.02 % of the contact forces, 0.6 % and 0.002 % of the displacements.
    assert plain[1] > 0.1
    assert better[0] < 1e-4 and better[1] < 1e-3
    assert with_static_answers(operators, corrected).size == 30, "nothing is new the second time"


def test_diagonal_keeps_modes_and_drops_damping_between_them(reference, twenty):
    full, diagonal = (project(reference.operators, twenty.basis, diagonal=d) for d in (False, True))
    for name in ("stiffness", "mass", "damping"):
        matrix = to_dense(getattr(diagonal, name))
        assert np.count_nonzero(matrix - np.diag(np.diag(matrix))) == 0
        np.testing.assert_array_equal(np.diag(matrix), np.diag(to_dense(getattr(full, name))))
    whole, kept = to_dense(full.damping), to_dense(diagonal.damping)
    np.testing.assert_allclose(np.diag(kept), 2 * twenty.damping * twenty.omega, rtol=1e-10)
    assert np.abs(whole - kept).max() > 1e-2 * np.abs(whole).max()


CHAIN = 1e3 * np.array([[3.0, -1.0, 0.0], [-1.0, 4.0, -2.0], [0.0, -2.0, 2.5]])


def chain(mass, *, proportional):
    """Three masses in a row between walls, two loads and one contact, on this rank alone."""
    M = np.diag(mass)
    C = 2e-4 * CHAIN + 0.3 * M if proportional else np.diag([1.0, 0.0, 2.0])
    loads = [([1.0, 2.0, 3.0], np.ones_like, True), ([0.0, 5.0, -4.0], lambda t: np.sin(20 * t) + t, False)]
    return dense_operators(CHAIN, M, C, loads, contact_on(1, 1e3, 3))


@pytest.mark.parametrize("start_kind", ["rest", "static", "settled"])
@pytest.mark.parametrize("scheme", [Scheme(), Scheme(0.36, 0.7), hilber_hughes_taylor(0.2), generalised_alpha(0.3), generalised_alpha(0.9)])
def test_a_small_system_marches_as_in_all_dofs(start_kind, scheme):
    settling = Scheme(1.0, 1.5), 0.01, 7
    times = 0.01 * np.arange(0, 301, 3)
    release = np.maximum(0.0, np.sin(3 * times))[:, None]
    for proportional in (True, False):
        with chain([2.0, 1.0, 0.5], proportional=proportional) as operators:
            starts = {"rest": at_rest, "static": static_state, "settled": lambda o: settled_state(o, *settling)}
            expected = marched(operators, scheme, 0.01, 300, starts[start_kind](operators), every=3, release=release)
            bases = [Basis(np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 1.0], [0.5, 0.0, 1.0]]), operators.comm)]
            found = modes(operators, number=3)
            bases.append(found.basis)
            for basis in bases:
                # Proportional damping couples no modes, so the diagonals are the whole.
                model = project(operators, basis, diagonal=proportional and basis is found.basis)
                got = marched(model, scheme, 0.01, 300, starts[start_kind](model), every=3, release=release)
                assert max(difference(got, expected)) < 1e-11
                np.testing.assert_array_equal(got.release, expected.release)
                np.testing.assert_array_equal(got.times, expected.times)


def test_dofs_without_mass_are_condensed():
    with chain([2.0, 0.0, 0.5], proportional=True) as operators:
        with pytest.raises(ModelError, match="number: expected >= 1 and <= 2"):
            modes(operators, number=3)
        all_of_them, lowest = (modes(operators, number=k) for k in (2, 1))
    condensed = CHAIN[np.ix_([0, 2], [0, 2])] - np.outer(CHAIN[[0, 2], 1], CHAIN[1, [0, 2]]) / CHAIN[1, 1]
    expected = linalg.eigvalsh(condensed, np.diag([2.0, 0.5]))
    np.testing.assert_allclose(all_of_them.eigenvalues, expected, rtol=1e-12)
    np.testing.assert_allclose(lowest.eigenvalues, expected[:1], rtol=1e-12)
    np.testing.assert_allclose(CHAIN[1] @ all_of_them.basis.vectors, 0.0, atol=1e-12 * CHAIN.max())
