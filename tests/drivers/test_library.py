"""The face for scripts: the example of the documentation, models from matrices, and what is said where something cannot be had."""

import subprocess
import sys

import numpy as np
import pytest
from petsc4py import PETSc
from scipy.linalg import expm

import uplift
from tests import oscillator
from tests.process import ROOT

COMPLEX = issubclass(PETSc.ScalarType, complex)


def oscillator_model():
    return uplift.from_matrices(oscillator.STIFFNESS, oscillator.MASS, oscillator.DAMPING, loads=[(oscillator.FORCE, np.ones_like)])


@pytest.mark.check
def test_the_example_runs_and_its_ways_agree():
    done = subprocess.run(
        [sys.executable, str(ROOT / "docs" / "examples" / "library.py")], cwd=ROOT, env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin",
        "OMP_NUM_THREADS": "1", "HOME": str(ROOT.parent)}, capture_output=True, text=True, timeout=600,
    )
    assert done.returncode == 0, done.stderr
    peak, basis, block = done.stdout.splitlines()
    assert peak.startswith("largest P3.DX 0.2245") and " m, " in peak
    assert all(float(word) < 1e-6 for word in basis.replace(",", "").split() if word[0].isdigit())
    assert block.startswith("largest rotation ")


def from_rest(times):
    """Motion (nt, 2) of the oscillator from rest under its sudden load, by the exponential of its generator."""
    inverse = np.linalg.inv(oscillator.MASS)
    generator = np.zeros((5, 5))
    generator[:2, 2:4] = np.eye(2)
    generator[2:4] = np.hstack([-inverse @ oscillator.STIFFNESS, -inverse @ oscillator.DAMPING, (inverse @ oscillator.FORCE)[:, None]])
    return np.array([expm(t * generator)[:2, 4] for t in times])


def test_a_model_from_matrices_moves_as_its_closed_form():
    """The average acceleration lengthens a period by (omega dt)^2 / 12: at 5 ms and some 5 rad/s by 5e-5, over some two periods."""
    with oscillator_model() as model:
        found = uplift.transient(model, step=0.005, steps=400, start="rest")
    assert found.units["u0"] == "m" and found.units["u0 acceleration"] == "m/s2"
    exact = from_rest(found.times)
    assert np.max(np.abs(np.stack([found["u0"], found["u1"]], axis=1) - exact)) < 1e-3 * np.max(np.abs(exact))


def test_matrices_come_back():
    with oscillator_model() as model:
        back = uplift.to_matrices(model)
    assert np.allclose(back["stiffness"].toarray(), oscillator.STIFFNESS) and np.allclose(back["damping"].toarray(), oscillator.DAMPING)


def test_a_one_sided_spring_only_pushes():
    """A mass on a one-sided spring stands on it under its weight, and falls freely away from it."""
    def fall(weight):
        contacts = uplift.contacts(np.array([[1.0]]), 1000.0)
        with uplift.from_matrices([[0.0]], [[2.0]], loads=[([weight], np.ones_like)], contacts=contacts) as model:
            return uplift.transient(model, step=0.001, steps=500, start="rest")

    upwards = fall(20.0)
    assert upwards["u0"][-1] == pytest.approx(0.5 * 10.0 * 0.5**2, rel=1e-6) and np.all(np.abs(upwards["c1 force"]) < 1e-9)
    pressed = fall(-20.0)
    assert pressed["c1 force"].max() == pytest.approx(40.0, rel=1e-3)  # a sudden load presses twice as hard as one at rest


@pytest.mark.parametrize(("change", "words"), [
    ({"mass": np.eye(3)}, "matrices: expected matrices of one shape"),
    ({"loads": [([1.0], np.ones_like)]}, r"loads.1: expected a vector of shape \(2,\)"),
])
def test_shapes_that_do_not_fit_are_named(change, words):
    given = {"stiffness": oscillator.STIFFNESS, "mass": oscillator.MASS, "loads": ()} | change
    with pytest.raises(uplift.ModelError, match=words):
        uplift.from_matrices(**given)


@pytest.mark.skipif(COMPLEX, reason="complex PETSc has the sweep in all dofs")
def test_what_cannot_be_had_in_this_process_is_said_with_the_way_that_can():
    with oscillator_model() as model:
        with pytest.raises(uplift.ModelError, match="uplift.choose_scalars.*krylov_basis"):
            uplift.time_frequency(model, step=0.01, steps=10, start="rest")
        with uplift.project(model, uplift.krylov_basis(model, tolerance=1e-10, band=2.0)) as small:
            stepped = uplift.transient(small, step=0.01, steps=200, start="rest")
            swept = uplift.time_frequency(small, step=0.01, steps=200, start="rest")
    assert np.max(np.abs(stepped["u0"] - swept["u0"])) < 1e-9 * np.max(np.abs(stepped["u0"]))
