"""The Krylov basis against dense algebra in all dofs, and runs in it against the full runs."""

from dataclasses import replace

import numpy as np
import pytest

from tests import oscillator
from tests.small import dense_operators, marched, to_dense
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.evidence.scaling.cost import refined
from uplift.forms.contact.supports import Spring
from uplift.meshes.checked import ModelError
from uplift.solvers.bases.krylov import krylov_basis
from uplift.solvers.bases.project import project
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.bases.springs import inside_contacts, spring_forces
from uplift.solvers.errors import SolverError
from uplift.solvers.frequency_domain.harmonic import harmonic_sweep
from uplift.solvers.frequency_domain.laplace import laplace_run
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.scheme import Scheme, hilber_hughes_taylor
from uplift.solvers.time_domain.state import at_rest

pytestmark = pytest.mark.both


def relative(here, there):
    return np.max(np.abs(here - there)) / np.max(np.abs(there))


def with_support(scene, **changes):
    return replace(scene, model=replace(scene.model, supports=(replace(scene.model.supports[0], **changes),)))


def dense_forces(operators):
    """Loads and unit release forces as columns, whole."""
    own = np.column_stack([*(np.real(load.vector.array_r) for load in operators.loads), operators.contacts.push.toarray()])
    return np.concatenate(operators.comm.allgather(own))


def on_springs(scene, stiffness=2e5):
    """The left edge on springs at all nodes, in N/m for each metre."""
    side = Spring("SIDE", (), (stiffness, 0.0), group="DGAU", per="length")
    return replace(scene, model=replace(scene.model, springs=(side,)))


def with_dampers(operators):
    """Dashpots of 1e5 N s/m at every fifth row, which no a K + b M describes."""
    begin, end = operators.damping.getOwnershipRange()
    for row in range(begin + (-begin) % 5, end, 5):
        operators.damping.setValue(row, row, 1e5, addv=True)
    operators.damping.assemble()


ESTIMATES = [
    ("reference", 1, 1e-2, 0.0), ("reference", 1, 1e-4, 0.0), ("reference", 1, 1e-4, 500.0),
    pytest.param("reference", 1, 1e-6, 0.0, marks=pytest.mark.ranks),
    ("springs", 2, 1e-4, 0.0), ("springs", 2, 1e-6, 0.0), pytest.param("springs", 2, 1e-6, 500.0, marks=pytest.mark.ranks),
    ("dampers", 2, 1e-6, 0.0),
]


@pytest.mark.parametrize(("name", "order", "tolerance", "shift"), ESTIMATES)
def test_estimate_follows_the_error(sdls119a, comm, name, order, tolerance, shift):
    """In the norm of the energy, for every column, over frequencies that are neither built nor tested with."""
    scene = refined(sdls119a, 1 + order)
    with prepare(on_springs(scene) if name == "springs" else scene, comm) as assembly:
        operators = assembly.operators
        if name == "dampers":
            with_dampers(operators)
        K, M, C = (np.real(to_dense(a)) for a in (operators.stiffness, operators.mass, operators.damping))
        basis = krylov_basis(operators, KrylovSettings(tolerance=tolerance, shift=shift))
        V, B = np.concatenate(comm.allgather(basis.vectors)), dense_forces(operators)
    growth = basis.growth
    assert growth.order == order
    assert basis.size < 0.3 * len(K)
    assert V.T @ M @ V == pytest.approx(np.eye(basis.size), abs=1e-11)
    A = K + shift * M + (np.sqrt(shift) * C if order == 2 else 0.0)
    size = np.sqrt(np.einsum("ij,ij->j", B, np.linalg.solve(A, B)))

    def exact(omega):
        dynamic = K + 1j * omega * C - omega**2 * M
        inside = V @ np.linalg.solve(V.T @ dynamic @ V, V.T @ B)
        rest = B - dynamic @ inside
        difference = np.linalg.solve(dynamic, B) - inside
        dual, energy = (np.sqrt(np.real(np.einsum("ij,ij->j", a.conj(), b))) for a, b in (
            (rest, np.linalg.solve(A, rest)), (difference, A @ difference)))
        return dual / size, energy / size

    for frequency, value in growth.checked:
        # Random combinations of the columns are as large as their root sum of squares in the mean square.
        there = np.linalg.norm(exact(2 * np.pi * frequency)[0])
        # Round-off of the dense product with entries of 1e15 N/m, seen as the value at frequencies near 0.
        assert 0.3 * there < value + 1e-7 and value < 3 * there + 1e-7
    assert growth.estimate <= tolerance
    errors = [np.max(exact(2 * np.pi * f)[1]) for f in np.linspace(0.3, 25.0, 15)]
    assert growth.estimate / 300 < max(errors) < 10 * growth.estimate + 1e-7


def full_and_reduced(scene, comm, settings, scheme=None, step=0.005, steps=600):
    scheme = scheme or Scheme()
    with prepare(scene, comm) as assembly, static_state(assembly.operators, exact_uplift=True) as start:
        operators = assembly.operators
        with Newmark(operators, scheme, step, exact_uplift=True) as method:
            full = transient(method, start, steps)
        with project(operators, krylov_basis(operators, settings)) as model:
            stepped = marched(model, scheme, step, steps, static_state(model, exact_uplift=True), exact_uplift=True)
            with static_state(model, exact_uplift=True) as rest:
                swept = laplace_run(model, scheme, step, steps, rest).history
    assert np.max(full.release) > 0
    return full, stepped, swept


CASES = {
    "reference": {},
    "gap": {"gap": 0.005},
    "massless joints": {"mass": 0.0},
    "heavy joints": {"mass": 1.0},
    "soft sideways": {"stiffness": (3e7, 1e8)},
    "stiff sideways": {"stiffness": (1e11, 1e8)},
    "released sideways": {"sideways": "released", "contact": (1e10, 1e15)},
}


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=pytest.mark.ranks if name in ("reference", "released sideways") else ()) for name in CASES
])
def test_uplift_in_the_basis_equals_uplift_in_all_dofs(sdls119a, comm, name):
    scene = with_support(refined(sdls119a, 2), **CASES[name])
    full, stepped, swept = full_and_reduced(scene, comm, KrylovSettings(tolerance=1e-6))
    for here in (stepped, swept):
        assert relative(here.probes, full.probes) < 1e-6
        assert relative(here.release[:, :5], full.release[:, :5]) < 5e-6
    assert here.peak == full.peak
    assert relative(here.peak_field, full.peak_field) < 1e-6


@pytest.mark.ranks
def test_a_line_of_springs_costs_no_columns(sdls119a, comm):
    """As many vectors on twice as many springs, and the march in all dofs."""
    sizes = []
    for factor in (2, 4):
        with prepare(on_springs(refined(sdls119a, factor)), comm) as assembly:
            sizes.append(krylov_basis(assembly.operators, KrylovSettings(tolerance=1e-6)).size)
    assert sizes[0] == pytest.approx(sizes[1], rel=0.1)
    full, stepped, swept = full_and_reduced(on_springs(refined(sdls119a, 2)), comm, KrylovSettings(tolerance=1e-6))
    for here in (stepped, swept):
        assert relative(here.probes, full.probes) < 1e-6
        assert relative(here.release[:, :5], full.release[:, :5]) < 5e-6


def test_dissipative_scheme(sdls119a, comm):
    full, stepped, swept = full_and_reduced(refined(sdls119a, 2), comm, KrylovSettings(tolerance=1e-6), hilber_hughes_taylor(0.1))
    assert relative(stepped.probes, full.probes) < 1e-6
    assert relative(swept.probes, full.probes) < 1e-6


def test_a_small_space_is_used_up():
    """Two dofs, one load: two vectors are all there are, and the answer is the closed form."""
    loads = [(oscillator.FORCE, np.ones_like, False)]
    with dense_operators(oscillator.STIFFNESS, oscillator.MASS, oscillator.DAMPING, loads) as operators:
        basis = krylov_basis(operators, KrylovSettings(tolerance=1e-12, band=2.0))
        with project(operators, basis) as small:
            here = harmonic_sweep(small, np.array([0.0, 3.0, 7.0]))
    assert basis.size == 2
    for omega, answer in zip((0.0, 3.0, 7.0), here.probes[:, :, 0], strict=True):
        assert answer == pytest.approx(oscillator.frequency_response(omega), rel=1e-11)


def test_sudden_load_and_further_columns():
    loads = [(oscillator.FORCE, np.ones_like, False)]
    with dense_operators(oscillator.STIFFNESS, oscillator.MASS, oscillator.DAMPING, loads) as operators, at_rest(operators) as start:
        with Newmark(operators, Scheme(), 0.02) as method:
            stepped = transient(method, start, 300)
        with project(operators, krylov_basis(operators, KrylovSettings(tolerance=1e-10, band=2.0))) as model, at_rest(model) as rest:
            run = laplace_run(model, Scheme(), 0.02, 300, rest)
    assert relative(run.history.probes, stepped.probes) < 1e-9


def test_what_cannot_be_reached_is_said():
    free = np.array([[20.0, -20.0], [-20.0, 20.0]])
    loads = [(oscillator.FORCE, np.ones_like, False)]
    with dense_operators(free, oscillator.MASS, None, loads) as operators:
        basis = krylov_basis(operators, KrylovSettings(tolerance=1e-10, band=1.0, shift=3.0))
        assert basis.size == 2
    nothing = pytest.raises(SolverError, match="nothing to start from")
    with dense_operators(oscillator.STIFFNESS, oscillator.MASS) as operators, nothing:
        krylov_basis(operators, KrylovSettings())
    with pytest.raises(ModelError, match="tolerance"):
        KrylovSettings(tolerance=2.0)


@pytest.mark.ranks
def test_too_few_blocks(sdls119a, comm):
    words = r"residual of .* \(tolerance 1e-09\) and 3 blocks"
    with prepare(refined(sdls119a, 2), comm) as assembly, pytest.raises(SolverError, match=words):
        krylov_basis(assembly.operators, KrylovSettings(tolerance=1e-9, blocks=3))


def test_springs_are_found(sdls119a, comm):
    """Joints of 1e15 and 1e15 N/m in series sideways, plain springs of 1 N/m, and the inside of the joints that can open."""
    with prepare(sdls119a, comm) as assembly:
        rows, stiffness = spring_forces(assembly.operators)
        inside = inside_contacts(assembly.operators)
        kept = assembly.operators.bonded_springs.diagonal()[rows]
        elongation = assembly.operators.contacts.elongation.local
    assert sorted(stiffness) == pytest.approx([1.0] * 2 + [5e14] * 5)
    assert np.all(kept > 0)
    assert sorted(inside) == sorted(elongation.indices)


def test_stiff_directions_do_not_spoil_soft_ones(sdls119a, comm):
    """Scaled to a unit diagonal, the projected stiffness is well conditioned though its entries span twelve decades."""
    with prepare(refined(sdls119a, 2), comm) as assembly:
        stiffness = krylov_basis(assembly.operators, KrylovSettings(tolerance=1e-6)).projected.stiffness
    size = np.sqrt(np.diag(stiffness))
    assert np.max(size) > 1e5 * np.min(size)
    assert np.linalg.eigvalsh(stiffness / np.outer(size, size))[0] > 1e-4
