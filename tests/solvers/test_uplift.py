"""Exact uplift in time stepping: a bouncing mass with a closed form, energy, and whole plates that lift."""

from dataclasses import replace

import numpy as np
import pytest

from tests import bouncing
from tests.small import marched
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.evidence.scaling.cost import on_a_line
from uplift.meshes.checked import ModelError
from uplift.solvers.bases.krylov import krylov_basis
from uplift.solvers.bases.project import project
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.contact.published_passes import published_passes
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.scheme import Scheme, generalised_alpha, hilber_hughes_taylor

DT = 0.005


def bounce(scheme, step, duration=2.0, **options):
    with bouncing.operators() as operators, static_state(operators) as start:
        start.velocity.array[:] = bouncing.START_VELOCITY
        with Newmark(operators, scheme, step, exact_uplift=True) as method:
            return transient(method, start, round(duration / step), **options)


@pytest.mark.both
def test_closed_form_is_continuous():
    t = np.linspace(0, 3, 30_001)
    assert np.max(np.abs(np.diff(bouncing.height(t)))) < 1.8e-4
    assert bouncing.height(np.array([0.0]))[0] == pytest.approx(-bouncing.MASS * bouncing.GRAVITY / bouncing.STIFFNESS)


@pytest.mark.both
@pytest.mark.parametrize("scheme", [Scheme(), hilber_hughes_taylor(0.1), generalised_alpha(0.6)])
def test_bouncing_mass_follows_its_closed_form(scheme):
    """The switch falls inside a step, which leaves a second-order error as long as the force itself is continuous."""
    errors = []
    for step in (2e-3, 1e-3, 5e-4):
        history = bounce(scheme, step)
        errors.append(np.max(np.abs(history.probes[:, 0] - bouncing.height(history.times))))
    assert errors[-1] < 2e-3 * 0.1
    slope = np.polyfit(np.log([2e-3, 1e-3, 5e-4]), np.log(errors), 1)[0]
    assert 1.7 < slope < 2.4


@pytest.mark.both
def test_contact_law_holds_at_every_step():
    history = bounce(Scheme(), 1e-3)
    tension = bouncing.STIFFNESS * history.elongation
    compression = history.release - tension
    # The tensions reach 1 kN here; what is left is round-off of them.
    assert np.min(compression) > -1e-9
    assert np.max(np.abs(compression * history.release)) < 1e-6
    assert np.array_equal(history.release[:, 0] > 0, history.probes[:, 0] > 1e-12)
    assert history.release.max() > 100


@pytest.mark.both
def test_energy_is_conserved_between_contacts():
    """Undamped, the ledger moves only in the steps in which the contact opens or closes."""
    ledger_history = bounce(Scheme(), 1e-3, energy=True)
    numerical = ledger_history.ledger.numerical
    switched = np.flatnonzero(np.diff(ledger_history.release[:, 0] > 0))
    quiet = np.ones(len(numerical) - 1, dtype=bool)
    quiet[switched] = False
    scale = 0.5 * bouncing.MASS * bouncing.START_VELOCITY**2
    assert len(switched) == 8
    assert np.max(np.abs(np.diff(numerical)[quiet])) < 1e-13 * scale
    assert np.max(np.abs(numerical)) < 1e-3 * scale


def lifted(scene, comm, scheme=None, steps=500, **options):
    with prepare(scene, comm) as assembly, static_state(assembly.operators, exact_uplift=True) as start:
        with Newmark(assembly.operators, scheme or Scheme(), DT, exact_uplift=True) as method:
            history = transient(method, start, steps, **options)
        return history, assembly.operators.contacts.law, assembly.plate.total_mass


@pytest.mark.ranks
def test_converged_uplift_of_the_reference_case(sdls119a, comm):
    history, _, _ = lifted(sdls119a, comm)
    # Published figures of a converged solution of this case at this step, printed digits.
    assert history.times[468] == pytest.approx(2.34)
    assert history.probes[468] == pytest.approx([-0.0567170, 0.0094744], abs=5e-8)
    assert history.probes[:, 0].min() == pytest.approx(-0.0640488, abs=5e-8)


@pytest.mark.ranks
def test_reactions_are_weight_plus_inertia_and_energy_balances(sdls119a, comm):
    history, law, mass = lifted(sdls119a, comm, energy=True)
    compression = law.compression(law.tension(history.elongation), history.release)
    # The top springs of 1 N/m carry 1e-2 N, and while a contact is open its point mass of 1 N hangs on the plate.
    assert history.reactions[:, 1] == pytest.approx(compression.sum(axis=1), abs=20.0)
    assert history.reactions[0] == pytest.approx([0.0, 9.81 * (mass - 0.0), 0.0], abs=1e-3)
    ledger = history.ledger
    quiet = history.times < 1.0
    assert np.max(np.abs(ledger.numerical[quiet])) < 1e-9 * np.max(ledger.strain)
    assert np.max(np.abs(ledger.numerical)) < 5e-3 * np.max(ledger.work)
    assert np.min(ledger.damped) >= 0


def test_energies_in_a_basis_are_those_in_all_dofs(sdls119a, comm):
    """The basis meets 1e-9, so energies, which are squares of displacements, agree to some times that."""
    with prepare(sdls119a, comm) as assembly:
        operators = assembly.operators
        with project(operators, krylov_basis(operators, KrylovSettings(tolerance=1e-9))) as small:
            whole, reduced = (
                marched(model, Scheme(), DT, 400, static_state(model, exact_uplift=True), exact_uplift=True, energy=True).ledger
                for model in (operators, small)
            )
    assert whole.work.max() > 0
    for name in ("kinetic", "strain", "springs", "damped", "work", "numerical"):
        assert np.max(np.abs(getattr(reduced, name) - getattr(whole, name))) < 1e-7 * whole.work.max(), name


@pytest.mark.parametrize("gap", [0.005, 0.02])
def test_a_gap_lowers_the_plate_and_changes_nothing_else(sdls119a, comm, gap):
    """All supports lower by the same gap: the top springs of 1 N/m alone notice."""
    support = replace(sdls119a.model.supports[0], gap=gap)
    lowered, law, _ = lifted(replace(sdls119a, model=replace(sdls119a.model, supports=(support,))), comm)
    history, _, _ = lifted(sdls119a, comm)
    # They pull with 1e-8 of the force that a support would, on a plate that rocks by some 0.06 m.
    assert lowered.probes[:, 0] == pytest.approx(history.probes[:, 0], abs=1e-6 * gap)
    assert lowered.probes[:, 1] == pytest.approx(history.probes[:, 1] - gap, abs=1e-6 * gap)
    assert law.gap(lowered.release).max() == pytest.approx(law.gap(history.release).max(), rel=1e-6)


@pytest.mark.ranks
def test_preload_pushes_back(sdls119a, comm):
    """Without gravity a plate on preloaded supports stands where the preload is gone: at preload / stiffness."""
    support = replace(sdls119a.model.supports[0], preload=1e5)
    model = replace(sdls119a.model, supports=(support,), gravity=0.0, motions=(), springs=())
    with prepare(replace(sdls119a, model=model), comm) as assembly, static_state(assembly.operators, exact_uplift=True) as state:
        outputs = assembly.operators.outputs
        here = outputs.linear("probes", np.real(state.displacement.array_r))
    assert here[1] == pytest.approx(1e5 * support.flexibility(1), rel=1e-6)


def test_support_from_above_is_the_mirror_image(sdls119a, comm):
    """A plate that hangs under supports which push down, under gravity upwards, moves as the reference case upside down."""
    history, _, _ = lifted(sdls119a, comm)
    support = replace(sdls119a.model.supports[0], points=tuple((p[0], 8.0) for p in sdls119a.model.supports[0].points), unilateral="-Y")
    spring = replace(sdls119a.model.springs[0], points=((4.0, 0.0), (0.0, 0.0)))
    probe = replace(sdls119a.model.probes[0], point=(4.0, 0.0))
    model = replace(sdls119a.model, supports=(support,), springs=(spring,), probes=(probe,), gravity=-9.81)
    mirrored, _, _ = lifted(replace(sdls119a, model=model), comm)
    assert mirrored.probes[:, 0] == pytest.approx(history.probes[:, 0], abs=1e-9)
    assert mirrored.probes[:, 1] == pytest.approx(-history.probes[:, 1], abs=1e-9)


def test_plate_that_flies(sdls119a, comm):
    """No contact at all: with gravity upwards the plate leaves its supports and falls up, free but for 2 N/m and damping."""
    model = replace(sdls119a.model, motions=(), material=replace(sdls119a.model.material, beta=0.0, alpha=1e-3))
    with prepare(replace(sdls119a, model=model), comm) as assembly:
        operators = assembly.operators
        with static_state(operators, exact_uplift=True) as start, Newmark(operators, Scheme(), 1e-3, exact_uplift=True) as method:
            operators.loads[0].vector.scale(-1.0)
            history = transient(method, start, 1000)
        law = operators.contacts.law
    assert np.all(history.release[200:] > 0)
    late = history.times > 0.4
    acceleration = np.gradient(np.gradient(history.probes[:, 1], 1e-3), 1e-3)
    assert np.mean(acceleration[late][:-5]) == pytest.approx(9.81, rel=2e-2)
    assert law.gap(history.release)[-1].min() > 1.0


@pytest.mark.parametrize("points", [((0.0, 0.0), (1.0, 0.0)), ((0.0, 0.0), (4.0, 0.0))])
@pytest.mark.ranks
def test_a_plate_that_its_weight_tips_or_lifts_off_is_refused(sdls119a, comm, points):
    """On the two supports at the left it tips over; on those at the corners it is lifted by gravity reversed."""
    support = replace(sdls119a.model.supports[0], points=points)
    gravity = 9.81 if points[1][0] == 1.0 else -9.81
    model = replace(sdls119a.model, supports=(support,), springs=(), gravity=gravity)
    words = "lift or tip the plate off its supports"
    with prepare(replace(sdls119a, model=model), comm) as assembly, pytest.raises(ModelError, match=words):
        static_state(assembly.operators, exact_uplift=True)
    held = replace(model, springs=sdls119a.model.springs)
    with prepare(replace(sdls119a, model=held), comm) as assembly, static_state(assembly.operators, exact_uplift=True) as state:
        outputs = assembly.operators.outputs
        height = outputs.linear("probes", np.real(state.displacement.array_r))[1]
    # The two springs of 1 N/m on top carry what the supports do not.
    assert abs(height) > 1e4


@pytest.mark.ranks
def test_sideways_released_supports_slide_while_open(sdls119a, comm):
    """Released supports carry no sideways force while open, and stick where they land."""
    support = replace(sdls119a.model.supports[0], sideways="released")
    history, law, _ = lifted(replace(sdls119a, model=replace(sdls119a.model, supports=(support,))), comm)
    n = law.n_contacts
    sideways = law.tension(history.elongation)[:, n:] - history.release[:, n:]
    is_open = history.release[:, :n] > 0
    assert is_open.any()
    scale = np.max(np.abs(sideways))
    # A difference of two forces of 1e5 N in springs of 1e15 N/m: what is left are their last digits.
    assert np.max(np.abs(sideways[1:][is_open[1:] & is_open[:-1]])) < 1e-3 * scale
    closed = ~is_open[1:] & ~is_open[:-1]
    assert np.array_equal(history.release[1:, n:][closed], history.release[:-1, n:][closed])


@pytest.mark.parametrize(("every", "limit"), [(1, None), (2, [-0.0568127, 0.0095451])])
def test_published_passes_end_at_the_exact_answer(sdls119a, comm, every, limit):
    """With tensions at every step they end at the exact answer; with the source's, every second step, beside it."""
    exact, _, _ = lifted(sdls119a, comm)
    with (
        prepare(sdls119a, comm) as assembly,
        static_state(assembly.operators) as start,
        Newmark(assembly.operators, Scheme(), DT) as method,
    ):

        def solve(release):
            return transient(method, start, 500, every=every, release=release)

        passes = published_passes(solve, assembly.operators.contacts.law, 300, tolerance=1e-9, keep_all=False)
    assert passes.ended == "converged"
    assert passes.number > 100
    final = passes.final.probes
    if limit is None:
        assert np.max(np.abs(final - exact.probes)) < 1e-7 * np.max(np.abs(exact.probes))
    else:
        assert final[234] == pytest.approx(limit, abs=5e-8)


def test_many_supports_on_a_line(sdls119a, comm):
    """Supports that share the stiffness of the five: the law holds at each of them, and the weight is carried."""
    scene = on_a_line(sdls119a, 41)
    history, law, mass = lifted(replace(scene, plate=replace(scene.plate, ny=10)), comm, steps=480)
    compression = law.compression(law.tension(history.elongation), history.release)
    assert compression.shape[1] == 41
    assert np.min(compression) > -1e-6
    # The joints, 41 x 0.1 kg, rest on their own springs.
    assert compression[0].sum() == pytest.approx(9.81 * (mass - 4.1), rel=1e-6)
    share = (history.release > 0).mean(axis=1)
    assert 0.4 < share.max() < 1.0
    # They open from the edge inwards: what is open at an instant lies in one piece at either end.
    for is_open in history.release[share > 0] > 0:
        assert np.count_nonzero(np.diff(is_open.astype(int))) <= 2
