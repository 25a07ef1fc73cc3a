import numpy as np
import pytest

from uplift.forms.contact.law import UpliftLaw
from uplift.forms.contact.supports import Spring, Support, joint_term
from uplift.meshes.checked import ModelError


@pytest.mark.parametrize(("support", "contact"), [(1e8, 1e15), (1e15, 1e8), (3.0, 3.0), (0.0, 5.0), (5.0, 0.0)])
def test_joint_is_the_plain_series_of_two_springs_in_other_unknowns(support, contact):
    term = joint_term(support, contact, 0.7)
    # Plain unknowns: plate displacement q and auxiliary node b; the joint's own dof r gives b = node . (q, r).
    to_plain = np.array([[1.0, 0.0], term.load])
    plain = np.array([[contact, -contact], [-contact, contact + support]])
    scale = contact + support
    assert np.max(np.abs(to_plain.T @ plain @ to_plain - term.stiffness)) < 1e-15 * scale
    assert np.allclose(to_plain.T @ np.diag([0.0, 0.7]) @ to_plain, term.mass, atol=1e-16)
    assert np.allclose(term.elongation, np.array([1.0, -1.0]) @ to_plain)
    assert np.linalg.eigvalsh(term.stiffness).min() > -1e-15 * scale


@pytest.mark.parametrize("penalty", [1e12, 1e15, 1e18])
def test_contact_force_keeps_its_digits_beside_any_penalty(penalty):
    """The tension under a unit displacement of the plate is that of the series stiffness, to the last digits."""
    term = joint_term(1e8, penalty, 0.0)
    r = -term.stiffness[1, 0] / term.stiffness[1, 1]
    tension = penalty * (term.elongation @ [1.0, r])
    assert tension == pytest.approx(1 / (1 / 1e8 + 1 / penalty), rel=4e-16)


def test_release_force_is_the_tension_and_never_a_push():
    law = UpliftLaw(np.array([2.0, 3.0]), np.array([0.5, 0.4]))
    elongation = np.array([[1.0, -1.0], [0.0, 2.0]])
    release = law.release(elongation)
    assert np.array_equal(release, [[2.0, 0.0], [0.0, 6.0]])
    assert np.array_equal(law.tension(elongation), [[2.0, -3.0], [0.0, 6.0]])
    assert np.array_equal(law.compression(law.tension(elongation), release), [[0.0, 3.0], [0.0, 0.0]])
    assert law.gap(release) == pytest.approx(np.array([[1.0, 0.0], [0.0, 2.4]]))


def test_sideways_channels_belong_to_their_contact_and_are_left_alone_by_the_published_law():
    law = UpliftLaw(np.array([2.0, 3.0, 7.0]), np.array([0.5, 0.4, 0.2]), np.array([0, 1, 1]))
    assert (law.n_contacts, law.n_channels) == (2, 3)
    assert np.array_equal(law.release(np.array([1.0, 1.0, 1.0])), [2.0, 3.0, 0.0])


@pytest.mark.parametrize(
    ("unilateral", "sideways", "follows"), [("Y", "bonded", False), ("Y", "released", True), ("", "bonded", False)]
)
def test_sideways_forces_follow_a_contact_that_can_open_and_does_not_hold_them(unilateral, sideways, follows):
    support = Support("S", ((0.0, 0.0),), (1.0, 1.0), (1.0, 1.0), unilateral=unilateral, sideways=sideways)
    assert support.follows_sideways is follows


def test_preload_is_a_negative_gap():
    preloaded = Support("S", ((0.0, 0.0),), (0.0, 4.0), (0.0, 12.0), preload=6.0)
    assert preloaded.flexibility(1) == pytest.approx(1 / 3)
    assert preloaded.settlement == pytest.approx(-2.0)
    assert Support("S", ((0.0, 0.0),), (0.0, 4.0), (0.0, 12.0), gap=0.1).settlement == 0.1


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: Spring("S", ((0.0, 0.0),), (-1.0, 0.0)), "stiffness.X"),
        (lambda: Support("S", ((0.0, 0.0),), (1.0, float("nan")), (1.0, 1.0)), "stiffness.Y"),
        (lambda: Support("S", ((0.0, 0.0),), (1.0, 1.0), (1.0, 0.0)), "contact.Y"),
        (lambda: Support("S", ((0.0, 0.0),), (1.0, 0.0), (1.0, 1.0)), "stiffness.Y"),
        (lambda: Support("S", ((0.0, 0.0),), (1.0, 1.0), (1.0, 1.0), gap=1.0, preload=1.0), "preload"),
        (lambda: Support("S", ((0.0, 0.0),), (1.0, 1.0), (1.0, 1.0), unilateral="", gap=1.0), "gap"),
        (lambda: Support("S", ((0.0, 0.0),), (1.0, 1.0), (1.0, 1.0), sideways="unrestrained"), "sideways"),
        (lambda: Support("S", ((0.0, 0.0),), (1.0, 1.0), (1.0, 1.0), mass=-1.0), "mass"),
        (lambda: Support("S", ((0.0, 0.0),), (1.0, 1.0), (1.0, 1.0), unilateral="Z"), "contact.Z"),
        (lambda: Support("S", ((0.0, 0.0),), (1.0, 1.0), (1.0, 1.0), unilateral="RX"), "unilateral"),
    ],
)
def test_impossible_supports_are_refused_by_key(make, key):
    with pytest.raises(ModelError) as error:
        make()
    assert error.value.key == key
