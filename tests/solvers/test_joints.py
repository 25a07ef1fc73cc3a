"""Auxiliary nodes with a mass: a plate that leaves its joint, in closed form, and whole plates by every method."""

import dataclasses

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tests.small import dense_operators, marched
from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.scene.request import Request
from uplift.forms.contact.law import UpliftLaw
from uplift.forms.contact.supports import joint_term
from uplift.forms.loads.signals import Constant
from uplift.forms.operators import Contacts, Functionals
from uplift.solvers.bases.basis import Basis
from uplift.solvers.bases.project import project
from uplift.solvers.contact.auxiliary_nodes import AuxiliaryNodes
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.scheme import Scheme, generalised_alpha

PLATE, NODE, SUPPORT, CONTACT, GRAVITY, UP = 10.0, 2.0, 800.0, 1e15, 9.81, 2.5


def operators(node=NODE):
    """A rigid plate on one joint: dofs are the plate's displacement and the joint's elongation."""
    term = joint_term(SUPPORT, CONTACT, node)
    mass = np.diag([PLATE, 0.0]) + term.mass
    weight = -GRAVITY * (np.array([PLATE, 0.0]) + node * term.load)
    law = UpliftLaw(np.array([CONTACT]), np.array([1 / SUPPORT + 1 / CONTACT]), mass=np.array([node]))
    row = sparse.csr_matrix(term.elongation[None, :])
    push = sparse.csr_matrix(np.array([[1.0], [0.0]]))
    contacts = Contacts(("c1",), np.zeros((1, 2)), Functionals(("c1",), row, MPI.COMM_SELF), push, law)
    return dense_operators(term.stiffness, mass, None, [(weight, Constant(1.0), True)], contacts=contacts)


def flight(times):
    """Height of the plate and of the node (nt,) m after both were thrown up from rest with UP, until they meet again.

    Bonded they swing as one mass; the contact opens where the spring is slack, and each goes its own way: a throw, and an oscillator.
    """
    both, sag = np.sqrt(SUPPORT / (PLATE + NODE)), (PLATE + NODE) * GRAVITY / SUPPORT
    leave = np.arcsin(sag * both / UP) / both
    speed = UP * np.cos(both * leave)
    t = times - leave
    own, low = np.sqrt(SUPPORT / NODE), NODE * GRAVITY / SUPPORT
    bonded = UP / both * np.sin(both * times) - sag
    node = -low * (1 - np.cos(own * t)) + speed / own * np.sin(own * t)
    return np.where(t < 0, bonded, speed * t - 0.5 * GRAVITY * t**2), np.where(t < 0, bonded, node)


def thrown(step, scheme, node=NODE, duration=0.4):
    with operators(node) as model, static_state(model) as start, Newmark(model, scheme, step, exact_uplift=True) as method:
        start.velocity.array[0] = UP
        return transient(method, start, round(duration / step)), model.contacts.law


@pytest.mark.both
@pytest.mark.parametrize("scheme", [Scheme(), generalised_alpha(0.0)])
def test_a_heavy_node_stays_behind_and_swings_free(scheme):
    """The closed form in which nothing of the node's history comes from the plate; the opening is that of the two."""
    errors = []
    for step in (2e-3, 1e-3, 5e-4):
        history, law = thrown(step, scheme)
        plate, node = flight(history.times)
        gap = history.openings(law)[:, 0]
        assert np.max(plate - node) > 0.1
        errors.append(max(np.max(np.abs(history.probes[:, 0] - plate)), np.max(np.abs(gap - (plate - node)))))
    assert errors[-1] < 1e-4
    assert 1.7 < np.polyfit(np.log([2e-3, 1e-3, 5e-4]), np.log(errors), 1)[0] < 2.3


@pytest.mark.both
def test_a_node_that_follows_the_plate_would_be_wrong_and_a_light_one_need_not_be_told():
    heavy, law = thrown(1e-3, Scheme())
    followed = law.gap(heavy.release)[:, 0]
    plate, node = flight(heavy.times)
    assert np.max(np.abs(followed - (plate - node))) > 0.01
    light, none = thrown(1e-3, Scheme(), node=1e-9)[0], thrown(1e-3, Scheme(), node=0.0)[0]
    assert light.gap is None and none.gap is None
    assert light.probes[:, 0] == pytest.approx(none.probes[:, 0], abs=1e-9)


@pytest.mark.both
def test_either_side_of_the_threshold_is_the_same_answer(monkeypatch):
    """A node just light enough to be left out, taken along all the same."""
    step = 1e-3
    node = 0.9 * 1e-3 * step**2 * SUPPORT / 2
    left_out, _ = thrown(step, generalised_alpha(0.0), node=node)
    monkeypatch.setattr("uplift.solvers.contact.auxiliary_nodes.COUNTING_MASS", 0.0)
    taken, _ = thrown(step, generalised_alpha(0.0), node=node)
    assert left_out.gap is None and taken.gap is not None
    assert taken.probes[:, 0] == pytest.approx(left_out.probes[:, 0], abs=1e-6)


def test_the_basis_that_spans_all_gives_the_same():
    scheme, step = generalised_alpha(0.0), 1e-3
    stepped, law = thrown(step, scheme)
    with operators() as model:
        small = project(model, Basis(np.eye(2), MPI.COMM_SELF))
        start = static_state(small)
        start.velocity.array[:] = UP, 0.0
        history = marched(small, scheme, step, 400, start, exact_uplift=True)
    assert history.probes[:, 0] == pytest.approx(stepped.probes[:, 0], abs=1e-9)
    assert history.openings(law)[:, 0] == pytest.approx(stepped.openings(law)[:, 0], abs=1e-9)


@pytest.mark.complex
@pytest.mark.ranks
def test_sweep_and_stepping_agree_on_heavy_joints(sdls119a, comm):
    support = dataclasses.replace(sdls119a.model.supports[0], mass=1e5)
    settings = dataclasses.replace(sdls119a.transient, method="generalised-alpha", rho_infinity=0.0, start="static", every=1)
    scene = dataclasses.replace(sdls119a, model=dataclasses.replace(sdls119a.model, supports=(support,)), transient=settings)
    with prepare(scene, comm) as assembly:
        law, mass = assembly.operators.contacts.law, assembly.plate.total_mass
        stepped, swept = (analyse(assembly, Request(method)).final for method in ("transient", "time-frequency"))
    assert np.max(np.abs(swept.probes - stepped.probes)) < 1e-9 * np.max(np.abs(stepped.probes))
    assert swept.openings(law) == pytest.approx(stepped.openings(law), abs=1e-9)
    assert swept.reactions == pytest.approx(stepped.reactions, rel=1e-6, abs=1.0)
    assert stepped.reactions[0, 1] == pytest.approx(9.81 * mass, rel=1e-6)
    assert stepped.openings(law).max() > 0.01


@pytest.mark.both
def test_where_a_mass_counts():
    law = UpliftLaw(np.full(3, 1e15), np.full(3, 1e-8 + 1e-15), mass=np.array([0.0, 0.1, 10.0]))
    assert AuxiliaryNodes(law, 0.005).inertia_matters.tolist() == [False, False, True]
    assert AuxiliaryNodes(law, 0.0005).inertia_matters.tolist() == [False, True, True]
