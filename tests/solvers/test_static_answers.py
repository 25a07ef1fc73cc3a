"""Static answers beside modes: with all modes the run in all dofs, whatever stands on the plate."""

import numpy as np
import pytest

from tests.small import dense_operators, marched, to_dense
from tests.solvers.test_modal import SCENE, TRAPEZOIDAL, chain, changed_plant, difference
from uplift.solvers.bases.modes import modes
from uplift.solvers.bases.pencil import dofs_with_mass
from uplift.solvers.bases.project import project
from uplift.solvers.bases.static_answers import with_static_answers
from uplift.solvers.errors import SolverError
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.state import at_rest

pytestmark = pytest.mark.both


@pytest.fixture(scope="module")
def reference():
    with changed_plant() as made:
        yield made


@pytest.fixture(scope="module")
def twenty(reference):
    return modes(reference.operators, number=20)


def shaken(support, plate):
    """The reference scene with another support and damping, started by a sudden acceleration that lifts it off some supports."""
    load = {"direction": "X", "signal": "step", "amplitude": 3.0}
    return changed_plant(supports=[SCENE["supports"][0] | support], plate=SCENE["plate"] | plate, load=load)


MASS_ALONE = {"alpha": 0.0, "beta": 0.5}
"""Damping in proportion to the mass, if the auxiliary nodes have none."""


@pytest.mark.parametrize(
    ("support", "plate", "diagonal"),
    [
        ({"gap": 0.002}, {}, False),
        ({"gap": 0.002, "mass": 0.0}, {}, False),
        ({"preload": 1e5, "mass": 0.0}, {}, False),
        ({"mass": 1e4}, {}, False),
        ({"mass": 1e6, "gap": 0.002}, {}, False),
        ({"mass": 0.0}, MASS_ALONE, True),
        ({"mass": 0.0, "gap": 0.002}, MASS_ALONE, True),
    ],
)
def test_all_modes_with_static_answers_are_the_run_in_all_dofs(support, plate, diagonal):
    """Also where the answer to a gap differs from the others in dofs without mass alone, and with damping that couples no modes."""
    with shaken(support, plate) as made:
        operators = made.operators
        expected = marched(operators, TRAPEZOIDAL, 5e-3, 200, static_state(operators, exact_uplift=True), exact_uplift=True)
        basis = with_static_answers(operators, modes(operators, number=dofs_with_mass(operators)).basis)
        with project(operators, basis, diagonal=diagonal) as model:
            got = marched(model, TRAPEZOIDAL, 5e-3, 200, static_state(model, exact_uplift=True), exact_uplift=True)
        law = operators.contacts.law
        assert 0 < np.max(np.sum(expected.openings(law) > 0, axis=1)) < 5, "some contacts open"
    assert max(difference(got, expected)) < 1e-9
    np.testing.assert_allclose(got.reactions, expected.reactions, atol=1e-9 * np.abs(expected.reactions).max())
    np.testing.assert_allclose(got.release, expected.release, atol=1e-9 * np.abs(expected.release).max())


def test_few_modes_balance_loads_and_inertia_through_stiff_sideways_springs(reference, twenty):
    """The base shear is that of springs of 1e15 N/m; strains of twenty modes alone leave a tenth of it out at impacts."""
    operators = reference.operators
    expected = marched(operators, TRAPEZOIDAL, 5e-3, 600, static_state(operators, exact_uplift=True), exact_uplift=True)
    with project(operators, with_static_answers(operators, twenty.basis)) as model:
        got = marched(model, TRAPEZOIDAL, 5e-3, 600, static_state(model, exact_uplift=True), exact_uplift=True)
    away = np.max(np.abs(got.reactions - expected.reactions), axis=0) / np.max(np.abs(expected.reactions), axis=0)
    assert np.all(away < 1e-3), away


@pytest.mark.parametrize("mass", [1e3, 1e6])
def test_few_modes_with_heavy_joints_make_no_energy(mass):
    """Below the open contacts the nodes swing on their own, at 1.6 Hz with 1e6 kg: their equation has to hold in the basis."""
    with shaken({"mass": mass}, {}) as made:
        operators = made.operators
        expected = marched(operators, TRAPEZOIDAL, 5e-3, 400, static_state(operators, exact_uplift=True), exact_uplift=True)
        basis = with_static_answers(operators, modes(operators, number=20).basis, joints=True)
        with project(operators, basis) as model:
            got = marched(model, TRAPEZOIDAL, 5e-3, 400, static_state(model, exact_uplift=True), exact_uplift=True)
    assert difference(got, expected)[0] < 1e-3


def test_a_force_on_a_dof_without_mass_needs_its_static_answer():
    """Two masses with a massless node between: with all modes and the answer to a force on the node, the run in all dofs."""
    with chain([2.0, 0.0, 0.5], proportional=True) as operators:
        basis = with_static_answers(operators, modes(operators, number=2).basis)
        expected = marched(operators, TRAPEZOIDAL, 0.01, 300, static_state(operators))
        with project(operators, basis) as model:
            assert np.diag(to_dense(model.mass)) == pytest.approx([1.0, 1.0, 0.0], abs=1e-12)
            got = marched(model, TRAPEZOIDAL, 0.01, 300, static_state(model))
    assert max(difference(got, expected)) < 1e-11


def test_static_answers_of_a_structure_that_nothing_holds_are_those_of_the_shift():
    with dense_operators([[3.0, -3.0], [-3.0, 3.0]], np.diag([1.0, 2.0]), loads=[([1.0, 0.0], np.ones_like, True)]) as operators:
        found = modes(operators, number=1, shift=-1.0)
        with pytest.raises(SolverError, match="singular"):
            with_static_answers(operators, found.basis)
        with project(operators, with_static_answers(operators, found.basis, shift=-1.0)) as model:
            assert model.n == 2
            got = marched(model, TRAPEZOIDAL, 0.01, 100, at_rest(model))
        expected = marched(operators, TRAPEZOIDAL, 0.01, 100, at_rest(operators))
    np.testing.assert_allclose(got.probes, expected.probes, atol=1e-12 * expected.probes.max())
