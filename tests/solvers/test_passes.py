import numpy as np
import pytest

from tests.small import history_of
from uplift.forms.contact.law import UpliftLaw
from uplift.solvers.contact.published_passes import published_passes

LAW = UpliftLaw(np.array([4.0]), np.array([0.25]))


def one_contact(compliance):
    """A massless contact that is pulled by 1 N in the second instant and pushed in the first."""

    def solve(release):
        elongation = np.array([[-0.5], [0.25]])
        acted = np.zeros((2, 1)) if release is None else release
        elongation = elongation + compliance * acted
        return history_of(np.array([0.0, 1.0]), elongation.copy(), elongation, acted)

    return solve


def test_passes_contract_to_the_free_contact():
    """With compliance c the release force grows as 1 + 4 c + (4 c)^2 ..., whose limit carries no tension."""
    passes = published_passes(one_contact(0.1), LAW, 60)
    force = LAW.release(passes.histories[-1].elongation)[1, 0]
    assert force == pytest.approx(1 / (1 - 0.4), rel=1e-12)
    assert passes.pull[0] == pytest.approx(0.5)
    assert passes.pull[-1] < 1e-12
    assert passes.change[0] == pytest.approx(0.1 / np.hypot(0.5, 0.35))
    assert len(passes.change) == 59


def test_first_pass_is_the_linear_answer():
    passes = published_passes(one_contact(0.1), LAW, 1)
    assert len(passes.histories) == 1
    assert passes.change == []
    assert passes.histories[0].elongation[1, 0] == 0.25


def test_a_change_that_vanishes_does_not_hide_the_tension():
    """A contact of no compliance never moves: the change is nil from pass 2, and the law's residual still tells."""
    assert published_passes(one_contact(0.0), LAW, 1).pull == [0.5]


def test_tolerance_ends_the_iteration_on_both_norms():
    passes = published_passes(one_contact(0.1), LAW, 500, tolerance=1e-6)
    assert passes.ended == "converged"
    assert passes.number < 40
    assert passes.pull[-1] <= 1e-6 and passes.change[-1] <= 1e-6
    assert published_passes(one_contact(0.1), LAW, 3, tolerance=1e-6).ended == "not converged"


def test_a_still_contact_that_pulls_is_not_converged():
    """Its displacement never changes, and yet it carries tension."""
    passes = published_passes(one_contact(0.0), LAW, 1, tolerance=1e-6)
    assert passes.ended == "not converged"


def test_divergence_is_named_and_the_last_finite_pass_kept():
    passes = published_passes(one_contact(1.0), LAW, 500, tolerance=1e-6, keep_all=False)
    assert passes.ended == "diverged"
    assert np.all(np.isfinite(passes.final.probes))
    assert passes.number < 15
    assert len(passes.histories) <= 3
