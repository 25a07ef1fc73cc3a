"""Error against run time: measures of error, references, the efficient front, the advice, and a slice of the runs."""

import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from uplift.drivers.evidence.pareto import cases as pareto_cases
from uplift.drivers.evidence.pareto import errors as pareto_errors
from uplift.drivers.evidence.pareto import orders as pareto_orders
from uplift.drivers.evidence.pareto import page as pareto_page
from uplift.drivers.evidence.pareto import pareto
from uplift.drivers.evidence.pareto import runs as pareto_runs
from uplift.drivers.evidence.pareto.cases import AS_PUBLISHED, CORRECTED, FOURIER, KRYLOV, LAPLACE, MODES, SPREAD, Mesh, Run
from uplift.drivers.evidence.pareto.errors import Reference, Trace
from uplift.drivers.evidence.pareto.runs import Outcome, assemble, execute_once
from uplift.drivers.evidence.pareto.tables import tables
from uplift.drivers.evidence.peers import peer_scipy, peers
from uplift.drivers.scene.shipped import REFERENCE
from uplift.meshes.checked import ModelError
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.state import tensions


def trace(value):
    return Trace(np.full((3, 2), value), np.full((3, 1), 2 * value), np.array([value]))


@pytest.fixture
def short(sdls119a):
    return replace(sdls119a, transient=replace(sdls119a.transient, duration=2.6, start="static"))


@pytest.mark.both
def test_open_time_is_of_second_order():
    """sin(t) + 1/2 is positive up to 7 pi / 6, and from 11 to 19 pi / 6."""
    off = []
    for n in (100, 200, 400, 800):
        t = np.linspace(0.0, 10.0, n + 1)
        off.append(abs(pareto_errors.open_time(np.sin(t)[:, None] + 0.5, 10.0 / n)[0] - 2.5 * math.pi))
    assert 0 < off[-1] < 1e-4 and off[-1] < off[0] / 16
    assert pareto_errors.open_time(np.array([[1.0], [-3.0], [-1.0], [0.0]]), 2.0)[0] == pytest.approx(0.5)
    assert pareto_errors.open_time(np.zeros((5, 2)), 1.0) == pytest.approx([0.0, 0.0])


@pytest.mark.both
def test_errors_are_relative_to_the_largest_value():
    there = Trace(np.array([[1.0, -4.0]]), np.array([[2.0]]), np.zeros(1))
    here = Trace(np.array([[1.5, -4.0]]), np.array([[1.0]]), np.array([0.25]))
    assert pareto_errors.errors(here, there) == pytest.approx([0.125, 0.5, 0.25])


@pytest.mark.both
def test_richardson_takes_the_second_order_away_and_states_what_is_left():
    def level(h, k=0.0):
        return trace(1.0 + 3.0 * h**2 + 5.0 * h**4 + 2.0 * k**2 + 0.1 * h**2 * k**2)

    levels = [level(h) for h in (0.4, 0.2, 0.1)]
    assert pareto_errors.richardson(levels[1], levels[2], 2).probe[0, 0] == pytest.approx(1.0 - 5.0 * 4 * 0.1**4, rel=1e-12)
    reference = pareto_errors.extrapolated(levels, "")
    true = abs(reference.trace.probe[0, 0] - 1.0)
    assert true < reference.error[0] < 20 * true
    twice = pareto_errors.extrapolated_twice(
        [level(0.1, k) for k in (0.2, 0.1, 0.05, 0.2)], [level(h, 0.2) for h in (0.2, 0.1, 0.05)],
        [level(0.2, k) for k in (0.2, 0.1, 0.05, 0.2)], "",
    )
    true = abs(twice.trace.probe[0, 0] - 1.0)
    assert 0 < true < twice.error[0] < 1e-2


@pytest.mark.both
def test_order_and_front():
    h = 0.5 ** np.arange(5)
    assert pareto_errors.order(h, 7.0 * h**2 + 100.0 * (h > 0.3)) == pytest.approx(2.0)
    assert math.isnan(pareto_errors.order(h[:2], h[:2])) and math.isnan(pareto_errors.order(h, 0.0 * h))
    seconds, values = [3.0, 1.0, 2.0, 2.0, 4.0, 0.5], [0.1, 1.0, 0.5, 0.4, 0.2, math.nan]
    assert pareto_errors.efficient(seconds, values) == [1, 3, 0]


@pytest.mark.both
@pytest.mark.parametrize("degree", [1, 2])
def test_spread_supports_keep_stiffness_and_mass(sdls119a, degree):
    scene = pareto_cases.spread(sdls119a, Mesh(2, degree))
    own = sdls119a.model.supports[0]
    groups = scene.model.supports
    assert sum(len(g.points) * g.stiffness[1] for g in groups) == pytest.approx(5 * own.stiffness[1])
    assert sum(len(g.points) * g.mass for g in groups) == pytest.approx(5 * own.mass)
    points, share = pareto_cases.edge_shares(4.0, 8, degree)
    assert len(points) == sum(len(g.points) for g in groups) == 8 * degree + 1
    # The rules integrate what the shape functions can: squares, and with degree 2 cubes.
    assert share @ points ** (2 * degree - 1) == pytest.approx(4.0 ** (2 * degree) / (2 * degree))
    odd = replace(own, points=own.points[:-1])
    with pytest.raises(ModelError, match="equidistant"):
        pareto_cases.spread(replace(sdls119a, model=replace(sdls119a.model, supports=(odd,))), Mesh())


@pytest.mark.both
@pytest.mark.parametrize("quick", [True, False])
def test_run_table(sdls119a, quick):
    table = pareto_cases.runs(quick, spread_too=True)
    assert len(set(table)) == len(table)
    assert {run.method for run in table} == set(pareto_cases.METHODS)
    references = [run for case in (AS_PUBLISHED, SPREAD) for group in pareto_cases.reference_runs(case, quick) for run in group]
    for run in [*table, *references]:
        ratio = pareto_cases.INSTANTS / run.step
        assert ratio == pytest.approx(round(ratio), rel=1e-12)
    for case in (AS_PUBLISHED, SPREAD):
        finest = min(run.step for run in pareto_cases.reference_runs(case, quick)[0])
        assert all(run.step > finest or run in references for run in table if run.case == case)


@pytest.mark.complex
def test_methods_agree(short, comm):
    """Laplace and time stepping on the same steps are one answer; passes to the end come near; bases of all that matters as well."""
    with assemble(short, AS_PUBLISHED, Mesh(), comm) as model:
        here = execute_once(model, Run(AS_PUBLISHED, "Newmark", Mesh(), 0.01))
        swept = execute_once(model, Run(AS_PUBLISHED, LAPLACE, Mesh(), 0.01))
        assert np.all(pareto_errors.errors(swept.trace, here.trace) < 1e-7)
        assert set(swept.seconds) == {"start", "factorisation", "sweep", "march"} and min(swept.seconds.values()) > 0
        passes = execute_once(model, Run(AS_PUBLISHED, FOURIER, Mesh(), 0.01, 25.0, 20.48))
        assert passes.ended == "converged" and pareto_errors.errors(passes.trace, here.trace)[0] < 0.05
        assert pareto_errors.errors(passes.bonded, here.trace)[0] > 0.5
        assert here.trace.probe.shape == (131, 2) and here.trace.force.shape == (131, 5)


@pytest.mark.parametrize(("method", "setting", "limits"), [
    (CORRECTED, {"size": 20}, (1e-3, 1e-2)), (KRYLOV, {"tolerance": 0.01}, (1e-4, 1e-3)), (MODES, {"size": 20}, (2.0, 2.0)),
])
def test_bases_on_spread_supports(short, comm, method, setting, limits):
    with assemble(short, SPREAD, Mesh(2), comm) as model:
        whole = execute_once(model, Run(SPREAD, "Newmark", Mesh(2), 0.01))
        small = execute_once(model, Run(SPREAD, method, Mesh(2), 0.01, **setting))
        found = pareto_errors.errors(small.trace, whole.trace)
        assert found[0] < limits[0] and found[1] < limits[1]
        assert small.vectors is not None and (small.blocks is not None) == (method == KRYLOV)
        # Half the load in N/m times the length of the plate: the weight, carried by the contacts before the shaking.
        assert model.share == pytest.approx([0.25, 0.5, 0.5, 0.5, 0.25])
        share = pareto_cases.edge_shares(4.0, 8, 1)[1]
        with static_state(model.operators, exact_uplift=True) as state:
            law = model.operators.contacts.law
            force = law.compression(tensions(model.operators, state.displacement), state.release)
        order = np.argsort(model.operators.contacts.points[:, 0])
        assert force.sum() == pytest.approx(9.81 * (4 * 8 * 2500), rel=1e-4)
        assert whole.trace.force[0] == pytest.approx((force[order] / share)[::2], rel=1e-9)


def test_refused_run_says_why(short, comm):
    with assemble(short, AS_PUBLISHED, Mesh(), comm) as model:
        outcome = execute_once(model, Run(AS_PUBLISHED, MODES, Mesh(), 0.01, size=1000))
    assert outcome.trace is None and "dofs that have mass, got 1000" in outcome.ended


@pytest.mark.parametrize("change", [{"gap": 0.01}, {"stiffness": (1e8, 1e8)}])
def test_peers_say_what_they_cannot(sdls119a, change):
    assert peers.misfit(sdls119a) == ""
    support = replace(sdls119a.model.supports[0], **change)
    words = peers.misfit(replace(sdls119a, model=replace(sdls119a.model, supports=(support,))))
    assert words in ("a gap or a preload", "a foot that can slide")


def test_scipy_loop_has_the_same_answer(short, comm):
    steps = round(short.transient.duration / pareto_cases.MESH_STEP)
    there = peers.run_peer(peers.SCIPY, sys.executable, short, Mesh(2), steps, steps)
    own = peers.measure_own(peers.without_joint_mass(short), Mesh(2), comm)
    apart = peers.differences([own, there])[peers.SCIPY, Mesh(2)]
    # The foot is held there, and on 5e14 N/m here.
    assert np.all(apart < 1e-6)
    assert there.dofs == 2 * 9 * 17 - 9 and there.peak > there.libraries > 1e6


def test_element_of_the_scipy_loop():
    from tests.small import quadrilateral_matrices

    corners = np.array([[0.0, 0.0], [0.5, 0.0], [0.5, 0.25], [0.0, 0.25]])
    expected = quadrilateral_matrices(corners, 1.4e8, 0.3, 2500.0, 1.0)
    for here, there in zip(peer_scipy.element(np.array([0.5, 0.25]), 1.4e8, 0.3, 2500.0, 1.0), expected, strict=True):
        assert here == pytest.approx(there, rel=1e-12, abs=1e-6 * np.abs(there).max())


def study_of(scene, seconds, scored, reference_error):
    outcomes = [
        Outcome(Run(AS_PUBLISHED, "Newmark", Mesh(), 0.02 / 2**i), 100, 5, trace(1.0), {"march": s}) for i, s in enumerate(seconds)
    ]
    reference = Reference(trace(1.0), np.full(3, reference_error), "runs")
    return pareto_page.Study(
        scene, outcomes, np.array(scored), {(AS_PUBLISHED, Mesh()): 0.1}, {AS_PUBLISHED: reference}, [], [], [], "none", "command",
        "page", 1.0,
    )


@pytest.mark.both
def test_advice_follows_the_data(sdls119a):
    scored = [[5e-3, 2e-2, 1e-3], [2e-3, 5e-3, 2e-3], [5e-5, 2e-4, 1e-5]]
    study = study_of(sdls119a, [1.0, 2.0, 4.0], scored, 1e-5)
    first, second = pareto_page.advice(study, AS_PUBLISHED, 1e-2)
    assert "dt 0.02 s (1 s, 10 factorisations)" in first and "error of 5.0e-03" in first
    assert "take Newmark, dt 0.01 s (2 s, 20 factorisations)" in second
    first, second = pareto_page.advice(study, AS_PUBLISHED, 1e-4)
    assert "dt 0.005 s" in first and "contact forces are at best 2.0e-04 off" in second
    assert "No run reaches this in P3" in pareto_page.advice(study, AS_PUBLISHED, 1e-6)[0]
    slower = study_of(sdls119a, [9.0, 2.0, 4.0], scored, 1e-5)
    assert "It holds the contact forces (5.0e-03)" in pareto_page.advice(slower, AS_PUBLISHED, 1e-2)[1]
    vague = study_of(sdls119a, [1.0, 2.0, 4.0], [[1e-5, 1e-5, 1e-5]] * 3, 5e-4)
    assert "the reference itself is only known to 5.0e-04" in pareto_page.advice(vague, AS_PUBLISHED, 1e-4)[0]
    assert pareto_page.error_words(1e-5, 5e-4) == "< 5.0e-04" and pareto_page.error_words(math.nan, 1.0) == ""
    text = pareto_page.page(study)
    assert "## Efficient runs: as published" in text and "Not measured in this run" in text
    table = tables(study)["page.csv"].splitlines()
    assert len(table) == 4 and table[1].split(",")[:3] == ["as published", "Newmark", "4 x 8"]


@pytest.mark.both
def test_verdict_names_the_winner():
    def measured(program, seconds, peak):
        return peers.Measured(program, Mesh(), 100, 0.0, seconds, 1.0, peak, None, 10, 10)

    words = pareto_page.verdict([measured(peers.OWN, 1.0, 5.0), measured(peers.SCIPY, 0.5, 1.0), measured(peers.OPENSEES, 10.0, 9.0)])
    assert words == ("scipy loop is quicker than this project: 2 times at 100 dofs; it needs less memory at 100 dofs. "
                     "OpenSeesPy takes longer: 10 times at 100 dofs.")


@pytest.mark.both
def test_orders_of_made_up_traces():
    traces = {Run(AS_PUBLISHED, "Newmark", Mesh(), h): trace(1.0 + h**2) for h in (0.02, 0.01, 0.005, 0.0025)}
    traces |= {Run(SPREAD, "Newmark", Mesh(f), 0.005): trace(1.0 + f**-1.5) for f in (1, 2, 4, 8)}
    rows = pareto_orders.observed([], traces, 0.3)
    assert [row.parameter for row in rows] == ["time step", "mesh, bilinear"]
    assert rows[0].rates == pytest.approx((2.0, 2.0, 2.0)) and rows[1].rates == pytest.approx((1.5, 1.5, 1.5))


def test_opensees_that_cannot_be_had_is_one_line(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))

    def no(*arguments, **options):
        raise subprocess.CalledProcessError(1, "pip", stderr="looking\nERROR: No matching distribution found for openseespy\n")

    monkeypatch.setattr(subprocess, "run", no)
    assert peers.opensees() == (None, "ERROR: No matching distribution found for openseespy")
    assert peers.environment() == tmp_path / "uplift" / "peers"


def test_bad_input(sdls119a, tmp_path, comm):
    with pytest.raises(ModelError, match="expected the name of a file"):
        pareto.pareto(comm, pareto.Options(REFERENCE, tmp_path, True, False, True))
    unrestrained = replace(sdls119a.model.supports[0], stiffness=(0.0, 1e8), contact=(0.0, 1e15))
    with pytest.raises(ModelError, match="nothing holds the plate against"):
        assemble(replace(sdls119a, model=replace(sdls119a.model, supports=(unrestrained,))), AS_PUBLISHED, Mesh(), comm)
    with pytest.raises(ModelError, match="at least one unilateral"):
        pareto_runs.check(replace(sdls119a, model=replace(sdls119a.model, supports=())))
