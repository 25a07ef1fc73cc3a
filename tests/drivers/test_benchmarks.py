"""The benchmarks: their closed forms against models of their own, a quick selection of them, and their page."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.mindlin import LegendrePlate
from tests.process import child
from uplift.drivers.evidence.benchmarks import cases as benchmark_cases
from uplift.drivers.evidence.benchmarks import page as benchmarks
from uplift.drivers.evidence.benchmarks import vibration as benchmark_vibration
from uplift.drivers.evidence.benchmarks.runs import Benchmark, Check, Outcome, Runner, targets
from uplift.drivers.evidence.benchmarks.theory import SupportedPlate, let_go, lifted_strip
from uplift.forms.shells.material import Material

STEEL = Material(young=200e9, poisson=0.3, density=8000.0, thickness=1.0, alpha=6.929e-5, beta=5.772)
THIN = Material(young=200e9, poisson=0.3, density=8000.0, thickness=0.05)


def runner(comm, folder):
    return Runner(comm, folder, quick=True)


@pytest.mark.parametrize("case", [
    *(pytest.param(case, marks=pytest.mark.ranks) for case in ("cantilever", "tensionless_bed")),
    "free_plate", "tapered_membrane", "roof", "clamped_disc",
])
def test_cases_meet_their_targets(case, comm, tmp_path):
    folder = comm.bcast(tmp_path, root=0)
    outcomes = getattr(benchmark_cases, case)(runner(comm, folder))
    assert outcomes
    for outcome in outcomes:
        assert outcome.dofs > 0 and outcome.checks
        for check in outcome.checks:
            assert check.met, (outcome.mesh, check)


@pytest.mark.complex
@pytest.mark.parametrize("case", ["harmonic", "transient"])
def test_vibration_meets_its_series(case, comm, tmp_path):
    for outcome in getattr(benchmark_vibration, case)(runner(comm, comm.bcast(tmp_path, root=0))):
        for check in outcome.checks:
            assert check.met, (outcome.mesh, check)


def test_the_double_series_is_that_of_thin_plates_where_the_plate_is_thin():
    """Navier's 0.00406 p L4 / D in the middle, and pi / 2 sqrt(D / rho t) (m2 + n2) / L2 Hz."""
    plate = SupportedPlate(10.0, THIN)
    assert abs(plate.harmonic(100.0, np.zeros(1))[0]) == pytest.approx(0.00406235 * 100 * 1e4 / plate.rigidity, rel=1e-3)
    thin = np.pi / 2 * np.sqrt(plate.rigidity / 400.0) / 100 * np.array([2, 5, 5, 8, 10, 10])
    assert plate.frequencies(6) == pytest.approx(thin, rel=1e-3)


def test_the_step_of_the_series_is_integrated_in_time():
    """The modes of one pair of wave numbers by a Runge-Kutta method on the equations of motion."""
    plate = SupportedPlate(10.0, STEEL, terms=1)
    stiffness, mass = plate._matrices(1, 1)
    damping = STEEL.alpha * stiffness + STEEL.beta * np.diag(mass)
    times = np.linspace(0.0, 0.05, 26)
    load = np.array([16e6 / np.pi**2, 0.0, 0.0])

    def motion(_, state):
        return np.concatenate([state[3:], (load - damping @ state[3:] - stiffness @ state[:3]) / mass])

    exact = solve_ivp(motion, (0.0, 0.05), np.zeros(6), t_eval=times, method="Radau", rtol=1e-9, atol=1e-13).y[0]
    assert plate.step(1e6, times) == pytest.approx(exact, abs=1e-6 * exact.max())
    steady = np.linalg.solve(stiffness + 2j * np.pi * 40 * damping - (2 * np.pi * 40) ** 2 * np.diag(mass), load)[0]
    assert plate.harmonic(1e6, np.array([40.0]))[0] == pytest.approx(steady, rel=1e-12)


@pytest.mark.parametrize("ratio", [0.02, 1.0, 1.0 + 1e-7, 3.0])
def test_oscillators_of_any_damping_start_at_rest_at_one(ratio):
    times = np.linspace(0.0, 2.0, 41)

    def motion(_, state):
        return [state[1], -2 * 5.0 * ratio * state[1] - 25.0 * state[0]]

    exact = solve_ivp(motion, (0.0, 2.0), [1.0, 0.0], t_eval=times, rtol=1e-10, atol=1e-12).y[0]
    assert let_go(5.0, ratio, times) == pytest.approx(exact, abs=1e-8)


def test_targets_of_clamped_and_free_plates_by_polynomials():
    """Ritz's method confirms what is printed for the thick clamped plate; the free one settles 0.8 % below the series for mode 9."""
    unit = np.pi / 2 * np.sqrt(200e9 / (12 * 0.91) * 0.1**2 / 8000.0)  # pi2 sqrt(D / rho t) / (2 pi) for L = 1
    clamped = LegendrePlate(1.0, 200e9, 0.3, 0.1, 11, clamped=True).frequencies(8000.0, 0.1, 8)
    assert clamped / unit == pytest.approx(list(targets("CLAMPED_THICK").values()), rel=1e-4)
    free = LegendrePlate(10.0, 200e9, 0.3, 0.05, 14).frequencies(8000.0, 0.05, 9)
    assert free[3:8] == pytest.approx(list(targets("FV12").values())[:5], rel=2e-3)
    assert free[8] == pytest.approx(7.354, rel=1e-3)


def test_the_strip_that_lifts_is_a_beam_on_springs_that_push():
    """The closed form against a long beam of exact cells on fine springs, its contacts settled in turn."""
    from tests.forms.test_lifted_plates import lifted, timoshenko

    bending, bed, load, cells, length = 4e7, 1e7, 1e4, 240, 14.0
    deflection, contact = lifted_strip(load, bending, bed)
    stiffness, right = timoshenko(length, cells, bending, 1e6 * bending), np.zeros(2 * cells + 2)
    right[cells] = -load
    rows = np.zeros((cells + 1, 2 * cells + 2))
    rows[np.arange(cells + 1), 2 * np.arange(cells + 1)] = 1.0
    u, force = lifted(stiffness, right, rows, np.full(cells + 1, bed * length / cells))
    assert -u[cells] == pytest.approx(deflection, rel=1e-3)
    touching = np.flatnonzero(force > 0)
    assert (touching[-1] - touching[0]) * length / cells / 2 == pytest.approx(contact, abs=length / cells)


def test_a_value_that_misses_its_limit_is_marked_and_ends_in_code_1(comm, tmp_path, monkeypatch, capsys):
    good, bad = Check("a", "m", 1.009, 1.0), Check("b", "Hz", 1.011, 1.0)
    assert good.met and not bad.met
    assert Check("c", "m", 0.02, 0.0, scale=1.0).difference == 0.02

    def two(_):
        return [Outcome("a mesh", 7, (good, bad))]

    monkeypatch.setattr(benchmarks, "BENCHMARKS", (Benchmark("Case", "Its source.", two),))
    assert not benchmarks.benchmarks(comm, tmp_path / "page.md", quick=True)
    page = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert "1 of 2 values meet their limits" in page and "| b | 1.0110 Hz | 1 Hz | +1.10 % | 1 %, **missed** |" in page
    assert "MISSED" in capsys.readouterr().out
    monkeypatch.setattr(benchmarks, "BENCHMARKS", (Benchmark("Case", "Its source.", lambda _: [Outcome("a mesh", 7, (good,))]),))
    assert benchmarks.benchmarks(comm, tmp_path / "page.md", quick=True)


def test_the_page_may_not_be_a_folder(tmp_path):
    done = child("benchmarks", "--quick", "--out", tmp_path)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1
    assert "is a folder" in done.stderr
