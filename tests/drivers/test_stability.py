"""The stability table: its independent model, that its rows can fail, and its page."""

import csv
import itertools
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from tests.process import SCENE, child
from tests.small import quadrilateral_matrices, to_dense
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.evidence.stability import laws, table
from uplift.drivers.evidence.stability.bench import ROUND_OFF, Bench, Finding, condition, contact_forces, toml
from uplift.drivers.evidence.stability.cases import Case
from uplift.drivers.evidence.stability.oracle import EXTENDED, DensePlate, complementary, element_matrices, inverse, solver
from uplift.drivers.evidence.stability.page import Row, csv_text, page
from uplift.drivers.evidence.stability.refusals import methods, refusals, windows
from uplift.solvers.time_domain.scheme import Scheme


def bench(**fault):
    """The reference case up to 2.5 s, its first uplift, and changes that the program alone sees."""
    table = tomllib.loads(SCENE.read_text(encoding="utf-8"))
    table["transient"]["duration"] = 2.5
    return Bench(table, SCENE.parent, MPI.COMM_WORLD, {key.replace("__", "."): value for key, value in fault.items()})


def holds(case, at):
    return Row(case, case.run(at)).holds


def case_named(name):
    return next(case for case in table.cases(quick=False) if case.name == name)


@pytest.mark.check
def test_quick_table_writes_page_and_figures(tmp_path):
    out = tmp_path / "new" / "page.md"
    done = child("stability", "--quick", "--quiet", "--out", out)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    text = out.read_text(encoding="utf-8")
    with (out.parent / "page.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["verdict"] for row in rows} == {"holds"} and len(rows) == len(table.cases(quick=True)) > 10
    assert f"**All {len(rows)} cases hold.**" in text and "FAILS" not in text
    assert all(row["case"] in text for row in rows)
    assert "exit code 2: plate.density: expected > 0 kg/m3" in text


@pytest.mark.both
def test_elements_of_the_independent_model(sdls119a):
    material = sdls119a.model.material
    corners = np.array([[0.0, 0.0], [0.7, 0.0], [0.7, 1.9], [0.0, 1.9]])
    there = quadrilateral_matrices(corners, material.young, material.poisson, material.density, material.thickness)
    for here, matrix in zip(element_matrices(0.7, 1.9, material), there, strict=True):
        assert here.dtype == EXTENDED
        assert here.astype(float) == pytest.approx(matrix, rel=1e-12, abs=1e-14 * np.max(matrix))


@pytest.mark.both
def test_independent_model_gives_the_converged_values_of_the_reference_case(sdls119a):
    support = replace(sdls119a.model.supports[0], mass=0.0)
    model = DensePlate(replace(sdls119a, model=replace(sdls119a.model, supports=(support,))))
    motion = model.march(Scheme(), 0.005, 500)
    # Published figures of a converged solution of this case at this step; the joints' 0.1 kg, left out here, are worth 1e-6 of them.
    assert motion.probes[468] == pytest.approx([-0.0567170, 0.0094744], rel=1e-6, abs=5e-8)
    assert motion.probes[:, 0].min() == pytest.approx(-0.0640488, rel=1e-6, abs=5e-8)
    # Published to 1e-8; the weight of 0.1 kg on a support of 1e8 N/m counts.
    assert motion.probes[0] == pytest.approx([2.4783508e-05, -7.0878060e-03 + 0.981e-8], abs=5e-11)
    assert np.all(motion.forces >= 0)
    assert np.max(motion.forces * np.maximum(motion.openings, 0)) == 0


@pytest.mark.both
@pytest.mark.parametrize("precision", [float, EXTENDED])
def test_algebra_of_the_independent_model(precision):
    rng = np.random.default_rng(3)
    root = rng.normal(size=(6, 6))
    size = np.logspace(0, 6, 6)
    scaled = root @ root.T + np.eye(6)
    matrix = scaled * size * size[:, None]
    # Cholesky's error is that of the matrix scaled to a unit diagonal, whatever its size (Demmel 1989; Higham, section 10.1): a residual
    # of some (3 n + 1) n units of round-off times the condition of that matrix, rows and columns scaled back.
    unit = np.sqrt(np.diag(scaled))
    limit = 19 * 6 * np.finfo(float).eps * np.linalg.cond(scaled / unit / unit[:, None])
    answers = solver(matrix.astype(precision))(np.eye(6).astype(precision)).astype(float)
    rest = (answers @ matrix - np.eye(6)) * size[:, None] / size
    assert np.max(np.abs(rest * unit[:, None] / unit)) < limit
    rest = inverse(matrix.astype(EXTENDED)) @ matrix - np.eye(6)
    assert np.max(np.abs(rest)) < 1e-12 or np.finfo(EXTENDED).eps > 1e-17
    law = root @ root.T + 0.1 * np.eye(6)
    for _ in range(20):
        opening = rng.normal(size=6)
        here = complementary(law.astype(precision), opening.astype(precision), rng.normal(size=6) > 0).astype(float)
        for pattern in itertools.product([False, True], repeat=6):
            pressed, p = np.array(pattern), np.zeros(6)
            if pressed.any():
                p[pressed] = -np.linalg.solve(law[np.ix_(pressed, pressed)], opening[pressed])
            if np.all(p >= 0) and np.all((law @ p + opening)[~pressed] >= 0):
                assert here == pytest.approx(p, abs=1e-9)


@pytest.mark.both
def test_condition_numbers(assembly):
    dense = to_dense(assembly.operators.stiffness).real
    values = np.linalg.eigvalsh(dense)
    assert condition(assembly.operators.stiffness) == pytest.approx(values[-1] / values[0], rel=0.1)
    size = np.sqrt(np.diag(dense))
    values = np.linalg.eigvalsh(dense / size / size[:, None])
    assert condition(assembly.operators.stiffness, scaled=True, steps=200) == pytest.approx(values[-1] / values[0], rel=0.1)


def slightly(value):
    return value * (1 + 1e-6)


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("contacts and sideways springs 1e+18 N/m", {"plate__young": slightly}),
        ("neighbours 1e+00 and 1e+09 N/m", {"supports__stiffness__Y": slightly}),
        ("thickness / span 1, supports in proportion", {"plate__thickness": slightly}),
        ("undamped, energy", {"transient__method": "hht"}),
        ("dt = 1e-06 s", {"load__amplitude": slightly}),
        ("amplitude 1e-12 m/s2", {"plate__young": lambda e: 2 * e}),
        ("gravity reversed", {"springs__stiffness__Y": lambda k: k * (1 + 1e-5)}),
        ("no support", {"gravity__acceleration": slightly}),
        ("one, static state", {"supports__stiffness__Y": lambda k: k * 1.01}),
        ("plate of 4 km x 8 km", {"plate__density": slightly}),
        ("one element", {"plate__density": slightly}),
        ("one element, a rigid body on two springs", {"supports__stiffness__Y": lambda k: k * 1.001}),
        ("100000 kg under each contact", {"supports__mass": slightly}),
        ("bent, thickness / span 1e-05", {"plate__young": lambda e: e * 1.01}),
    ],
)
def test_rows_fail_where_a_quantity_is_wrong(name, fault):
    """The program's scene differs from the oracle's in one number; the verdict turns, and without the fault it does not."""
    case = case_named(name)
    assert holds(case, bench())
    assert not holds(case, bench(**fault))


def test_drift_fails_where_a_stiffness_is_wrong(monkeypatch):
    """With 1,000 steps instead of 100,000 a part of 1e-6 of Young's modulus turns the verdict."""
    case = case_named("100,000 steps")
    monkeypatch.setattr(laws, "MANY", 1000)
    assert holds(case, bench())
    assert not holds(case, bench(plate__young=slightly))


def test_a_node_that_follows_the_plate_fails_its_row(monkeypatch):
    case = case_named("100000 kg under each contact")
    monkeypatch.setattr("uplift.solvers.contact.auxiliary_nodes.COUNTING_MASS", 1e30)
    assert not holds(case, bench())


def test_a_static_state_that_moves_or_a_start_without_a_warning_fails_its_row(monkeypatch):
    gap = case_named("gap of 5 mm, ten settling steps")
    assert holds(gap, bench())
    monkeypatch.setattr("uplift.drivers.analysis.initial_state.SETTLED", 1.0)
    assert not holds(gap, bench())
    assert not holds(case_named("amplitude 0"), bench(load__amplitude=1e-9))


@pytest.mark.complex
def test_rows_of_the_window_fail_without_a_warning(monkeypatch):
    short, cut = windows()[1], windows()[-1]
    assert short.name == "5.12 s, too short" and holds(short, bench()) and holds(cut, bench())
    assert not holds(cut, bench(load__frequency=lambda f: 1.1 * f))
    monkeypatch.setattr("uplift.drivers.analysis.time_frequency.WRAPPED", 1.0)
    monkeypatch.setattr("uplift.drivers.analysis.time_frequency.LOST", 1.0)
    assert not holds(short, bench()) and not holds(cut, bench())


@pytest.mark.complex
def test_two_methods_and_chatter_can_fail(monkeypatch):
    case = methods()[0]
    assert holds(case, bench()) and not holds(case, bench(plate__young=slightly))
    chatter = case_named("all supports 1e+12 N/m, average acceleration")
    assert holds(chatter, bench())
    # A contact that keeps a thousandth of what it should let go.
    monkeypatch.setattr(laws, "contact_forces", lambda assembly, history: contact_forces(assembly, history) - 1e-3 * history.release)
    assert not holds(chatter, bench())


def test_refusals_need_their_words():
    case = next(case for case in refusals() if case.name == "gravity reversed, no spring: flies off")
    finding = case.run(bench())
    assert (finding.figure, finding.sound) == (0.0, True)
    assert finding.note.startswith("exit code 2: supports: the static loads lift or tip the plate off its supports")
    assert bench().refused({"plate.density": 0.0}, "a word that is not there").figure == 1.0
    assert bench(plate__density=2500.0).refused({"plate.density": 0.0}, "plate.density").figure == 1.0


@pytest.mark.both
def test_a_failed_case_fails_the_table(tmp_path, monkeypatch, capsys, comm):
    def broken(bench):
        raise ZeroDivisionError("nothing to divide by")

    def group():
        return [
            Case("Good", "below", "what", lambda bench: Finding(1e-9)),
            Case("Bad", "above", "what", lambda bench: Finding(2e-8, "a | b")),
            Case("Bad", "not a number", "what", lambda bench: Finding(float("nan"))),
            Case("Bad", "unsound", "what", lambda bench: Finding(0.0, sound=False)),
            Case("Bad", "raises", "what", broken),
        ]

    monkeypatch.setattr(table, "GROUPS", (group,))
    out = tmp_path / "page.md"
    assert table.stability(comm, SCENE, out, quick=False, quiet=False) is False
    text = out.read_text(encoding="utf-8")
    assert "**4 of 5 cases fail.**" in text and text.count("**FAILS**") == 4
    assert "ZeroDivisionError: nothing to divide by" in text and "a \\| b" in text
    assert "5 cases, 4 failed" in capsys.readouterr().out
    monkeypatch.setattr(table, "GROUPS", (lambda: group()[:1],))
    assert table.stability(comm, SCENE, out, quick=False, quiet=True) is True


@pytest.mark.both
def test_figures_are_printed_with_few_digits():
    case = Case("g", "c", "what", lambda bench: Finding(0.0))
    shown = {value: Row(case, Finding(value)).shown() for value in (0.0123, 3.1e-11, 6.2e-9, 0.0, 4e-8)}
    assert shown == {0.0123: "1.2e-02", 3.1e-11: "< 1e-10", 6.2e-9: "< 1e-08", 0.0: "< 1e-16", 4e-8: "< 1e-06"}
    assert Row(case, Finding(ROUND_OFF)).holds and not Row(case, Finding(1.01 * ROUND_OFF)).holds
    assert "g,c,< 1e-10,1e-08,round-off,holds,what," in csv_text([Row(case, Finding(3.1e-11))])
    assert "python3 -m drivers stability" in page([Row(case, Finding(3.1e-11))], "python3 -m drivers stability", 1.0)


@pytest.mark.both
def test_scenes_survive_being_written_as_toml(sdls119a):
    table = sdls119a.source | {"odd": {"a b": [1.5, {"x": float("inf")}], "text": 'a "quoted" word', "yes": True}}
    table["odd"] = {key.replace(" ", "_"): value for key, value in table["odd"].items()}
    assert tomllib.loads(toml(table)) == table


@pytest.mark.both
def test_independent_model_says_what_it_does_not_know(sdls119a, comm):
    with pytest.raises(ValueError, match="quadrilaterals of degree 1"):
        DensePlate(replace(sdls119a, plate=replace(sdls119a.plate, degree=2)))
    with prepare(sdls119a, comm) as assembly:
        assert assembly.operators.n == DensePlate(sdls119a).n
