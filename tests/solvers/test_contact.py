import itertools

import numpy as np
import pytest

from uplift.forms.contact.law import UpliftLaw
from uplift.solvers.contact.step import ContactProblem
from uplift.solvers.errors import SolverError


def springs(rng, n, stiffness):
    """Compliance D of n contacts on springs under a random elastic body, and its law."""
    root = rng.normal(size=(n, n))
    body = root @ root.T + 0.1 * np.eye(n)
    flexibility = np.linalg.inv(body + np.diag(stiffness))
    return np.diag(stiffness) @ flexibility, UpliftLaw(stiffness, 1 / stiffness)


def by_enumeration(compliance, tension):
    """The one set of open contacts that satisfies the law, found by trying all of them."""
    n = len(tension)
    for pattern in itertools.product([False, True], repeat=n):
        open_ = np.array(pattern)
        release = np.zeros(n)
        if open_.any():
            block = (np.eye(n) - compliance)[np.ix_(open_, open_)]
            release[open_] = np.linalg.solve(block, tension[open_])
        left = tension + compliance @ release - release
        if np.all(release[open_] >= 0) and np.all(left[~open_] <= 0):
            return release
    raise AssertionError("no set of open contacts satisfies the law")


@pytest.mark.parametrize("stiffness", [1e-3, 1.0, 1e6])
def test_small_problems_equal_enumeration(stiffness):
    rng = np.random.default_rng(4)
    for n in (1, 2, 5, 8):
        for _ in range(40):
            compliance, law = springs(rng, n, stiffness * rng.uniform(0.1, 10.0, size=n))
            tension = rng.normal(size=n)
            before = rng.normal(size=n).clip(0)
            here = ContactProblem(law, compliance).solve(tension, before)
            assert here == pytest.approx(by_enumeration(compliance, tension), rel=1e-6, abs=1e-9 * np.max(np.abs(here), initial=1.0))


def test_hundreds_of_contacts_are_found_from_any_guess():
    rng = np.random.default_rng(5)
    compliance, law = springs(rng, 400, np.full(400, 3.0))
    tension = rng.normal(size=400)
    problem = ContactProblem(law, compliance)
    first = problem.solve(tension, np.zeros(400))
    left = tension + compliance @ first - first
    assert np.all(first >= 0) and np.all(left <= 1e-9 * np.max(first)) and np.max(np.abs(first * left)) < 1e-6 * np.max(first) ** 2
    other = problem.solve(tension, np.ones(400))
    assert other == pytest.approx(first, rel=1e-9, abs=1e-9)


def test_all_open_all_closed_and_none():
    compliance, law = springs(np.random.default_rng(6), 3, np.ones(3))
    problem = ContactProblem(law, compliance)
    assert np.array_equal(problem.solve(np.array([-1.0, -2.0, -3.0]), np.ones(3)), np.zeros(3))
    pulled = np.linalg.solve(np.eye(3) - compliance, np.ones(3))
    assert np.all(pulled > 0)
    assert problem.solve((np.eye(3) - compliance) @ pulled, np.zeros(3)) == pytest.approx(pulled, rel=1e-9)
    nothing = ContactProblem(UpliftLaw(np.zeros(0), np.zeros(0)), np.zeros((0, 0)))
    assert nothing.solve(np.zeros(0), np.zeros(0)).shape == (0,)


def test_contact_on_the_verge_stays_quiet():
    """Round-off in a tension of zero opens nothing."""
    compliance, law = springs(np.random.default_rng(7), 2, np.ones(2))
    assert np.array_equal(ContactProblem(law, compliance).solve(np.array([-5.0, 1e-15]), np.zeros(2)), np.zeros(2))


def test_sideways_force_is_released_while_open_and_kept_where_the_contact_lands():
    law = UpliftLaw(np.array([1.0, 4.0]), np.ones(2), np.array([0, 0]))
    compliance = np.diag([0.5, 0.25])
    problem = ContactProblem(law, compliance)
    opened = problem.solve(np.array([1.0, -3.0]), np.zeros(2))
    assert opened == pytest.approx([2.0, 0.0])
    # One step later the sideways force is free: what the spring would carry, 3 N, is cancelled.
    release = problem.solve(np.array([1.0, -3.0]), opened)
    assert release == pytest.approx([2.0, -4.0])
    # Closed again: the normal release is gone, the sideways one stays at its last value and so adds its share of tension.
    landed = problem.solve(np.array([-1.0, -3.0]), release)
    assert landed == pytest.approx([0.0, -4.0])
    assert problem.solve(np.array([-1.0, 5.0]), landed) == pytest.approx([0.0, -4.0])


def test_values_that_are_not_finite_end_the_run():
    problem = ContactProblem(UpliftLaw(np.ones(1), np.ones(1)), np.array([[0.5]]))
    with pytest.raises(SolverError, match="no longer finite"):
        problem.solve(np.array([np.nan]), np.zeros(1))


@pytest.mark.parametrize("least", [0.3, 1e-6, 1e-15, 0.0])
def test_least_stiffness_is_the_smallest_singular_value(least):
    rng = np.random.default_rng(3)
    turned, _ = np.linalg.qr(rng.standard_normal((40, 40)))
    left = turned @ np.diag([least, *np.linspace(0.5, 1.0, 39)]) @ turned.T
    compliance = np.eye(60)
    compliance[:40, :40] -= left
    problem = ContactProblem(UpliftLaw(np.ones(60), np.ones(60)), compliance)
    found = problem.least_stiffness(np.arange(60) < 40)
    assert found == pytest.approx(least, rel=0.05) if least > 1e-12 else found < 1e-12


def test_factors_of_many_sets_stay_within_their_memory(monkeypatch):
    n = 60
    monkeypatch.setattr("uplift.solvers.contact.step.KEPT_FACTORS", 10 * 8 * n * n)
    compliance, law = springs(np.random.default_rng(5), n, np.ones(n))
    problem = ContactProblem(law, compliance)
    rng = np.random.default_rng(6)
    for _ in range(50):
        tension = rng.standard_normal(n)
        release = problem.solve(tension, np.zeros(n))
        net = tension + (compliance - np.eye(n)) @ release
        assert np.max(net) < 1e-9 and np.min(release) >= 0 and np.max(np.abs(net * release)) < 1e-9
        assert sum(factor.nbytes for _, factor, _ in problem._factors.values()) <= 10 * 8 * n * n
