"""The sweep in a basis against the direct one."""

from dataclasses import replace

import numpy as np
import pytest

from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.evidence.scaling.cost import refined
from uplift.solvers.bases.krylov import krylov_basis
from uplift.solvers.bases.project import project
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.frequency_domain.harmonic import FourierResponse, harmonic_sweep
from uplift.solvers.frequency_domain.laplace import laplace_run
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.scheme import Scheme


def relative(here, there):
    return np.max(np.abs(here - there)) / np.max(np.abs(there))


@pytest.mark.complex
@pytest.mark.ranks
def test_sweep_in_the_basis_equals_the_direct_sweep(sdls119a, comm):
    scene = refined(sdls119a, 2)
    window = replace(scene.fourier, length=5.12, samples=512)
    with prepare(scene, comm) as assembly:
        operators = assembly.operators
        basis = krylov_basis(operators, KrylovSettings(tolerance=1e-6))
        omega = 2 * np.pi * window.frequencies
        direct = harmonic_sweep(operators, omega)
        small = project(operators, basis)
        here = harmonic_sweep(small, omega)
        for j in range(direct.probes.shape[2]):
            assert relative(here.probes[..., j], direct.probes[..., j]) < 1e-8
            assert relative(here.elongation[..., j], direct.elongation[..., j]) < 1e-9
        release = np.random.default_rng(3).random((window.samples, direct.elongation.shape[1])) * 1e4
        there, reached = (FourierResponse(o, window, t).history(release) for o, t in ((operators, direct), (small, here)))
    assert relative(reached.probes, there.probes) < 1e-8
    assert relative(reached.peak_field, there.peak_field) < 1e-8


@pytest.mark.complex
@pytest.mark.ranks
def test_march_over_contact_forces_equals_that_of_the_direct_sweep(sdls119a, comm):
    with prepare(refined(sdls119a, 2), comm) as assembly, static_state(assembly.operators, exact_uplift=True) as start:
        model = project(assembly.operators, krylov_basis(assembly.operators, KrylovSettings(tolerance=1e-6)))
        direct = laplace_run(assembly.operators, Scheme(), 0.01, 200, start, every=2)
        with static_state(model, exact_uplift=True) as rest:
            here = laplace_run(model, Scheme(), 0.01, 200, rest, every=2)
        fields = here.field(77), direct.field(77)
    assert relative(here.history.probes, direct.history.probes) < 1e-6
    assert relative(*fields) < 1e-6
