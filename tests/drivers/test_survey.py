"""The survey of uplift: its variations, its superposed passes and its page."""

import copy
import math
from dataclasses import replace

import numpy as np
import pytest

from tests.process import SCENE, child
from tests.small import history_of
from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.evidence.survey import runs as survey_runs
from uplift.drivers.evidence.survey import survey
from uplift.drivers.evidence.survey.cases import CASES, COMMON, Case
from uplift.drivers.scene.paths import varied
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene
from uplift.forms.loads.signals import Ricker
from uplift.meshes.checked import ModelError
from uplift.solvers.contact.published_passes import Passes


def rows(page, heading):
    """Return the cells of the first table under a heading by the first of them."""
    section = page.split(f"## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("| ")][2:]
    return {cells[0]: cells[1:] for cells in ([cell.strip() for cell in line.strip("|").split("|")] for line in lines)}


@pytest.mark.check
def test_quick_survey_writes_its_page(tmp_path):
    out = tmp_path / "new folder" / "page.md"
    done = child("survey", "--quick", "--quiet", "--out", out)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert [path.name for path in out.parent.iterdir()] == ["page.md"]
    page = out.read_text(encoding="utf-8")
    exact = rows(page, "Uplift solved exactly")
    # Converged solutions of these cases by an independent dense model, printed digits.
    assert [float(cell) for cell in exact["reference"][:3]] == pytest.approx([-0.0567170, 0.0094744, -0.0640488], abs=1.01e-7)
    assert [float(cell) for cell in exact["amplitude 4 m/s2"][:3]] == pytest.approx([0.0021439, -0.0139049, -0.2245635], abs=1.01e-7)
    assert [cells[3] for cells in exact.values()] == ["3", "4", "3"]
    assert all(float(cells[4]) < 1e-8 for cells in exact.values())
    passes = rows(page, "The published passes")
    assert 120 < int(passes["reference"][0]) < 150 and float(passes["reference"][1]) < 1e-6
    assert 120 < int(passes["reference"][3]) < 170
    assert passes["amplitude 4 m/s2"][0].startswith("diverges after pass")
    number, largest = passes["amplitude 4 m/s2"][2].split(", by way of ")
    assert 500 < int(number) < 700 and float(largest.split()[0]) > 1e11
    assert passes["amplitude 4 m/s2"][3].startswith("diverges after pass")
    assert float(rows(page, "Penalty stiffness")["1e+12"][0]) == pytest.approx(3.3e-4, rel=0.02)
    chatter = rows(page, "Supports so stiff that contacts chatter")
    # Round-off itself decides how far the two part; what matters is that one does and the other does not.
    assert float(chatter["average acceleration"][1]) > 1e-5
    assert float(chatter["HHT, alpha = 0.05"][1]) < 1e-9
    assert float(chatter["HHT, alpha = 0.05"][3]) < 0.5 * float(chatter["average acceleration"][3])
    assert f"`python3 -m drivers survey --out {out} --quick`" in page
    assert "petsc scalars complex" in page


def test_bad_input_is_code_2(tmp_path):
    text = SCENE.read_text(encoding="utf-8")
    scene = tmp_path / "scene.toml"
    scene.write_text(text.split("[fourier]")[0], encoding="utf-8")
    done = child("survey", scene, "--out", tmp_path / "page.md")
    assert done.returncode == 2 and done.stderr.startswith(f"uplift: {scene}: fourier: missing; the survey needs")
    done = child("survey", "--out", tmp_path)
    assert done.returncode == 2 and "expected the name of a file" in done.stderr


@pytest.mark.both
def test_variations_change_what_they_name_and_nothing_else(sdls119a):
    table = sdls119a.source
    before = copy.deepcopy(table)
    changed = {case.name: varied(table, COMMON | case.changes) for case in CASES}
    scenes = {name: build_scene(entries, SCENE.parent) for name, entries in changed.items()}
    assert table == before
    reference = scenes["reference"]
    assert reference.model.supports == sdls119a.model.supports
    # A changed signal is tabulated as the scene's own, to six digits.
    signal = scenes["f = 1.5 Hz"].model.motions[0].signal
    smooth = Ricker(2.2408445351690323, 1.5, 1.92, 0.9)(signal.times)
    assert signal.times == pytest.approx(0.01 * np.arange(len(signal.times)))
    assert np.all(np.abs(signal.values - smooth) <= 5e-6 * np.abs(smooth))  # half a unit of the sixth digit
    assert scenes["damping / 5"].model.material == replace(reference.model.material, alpha=1e-3, beta=0.02)
    assert [p[0] for p in scenes["two supports"].model.supports[0].points] == [0.0, 4.0]
    assert scenes["no gravity"].model.gravity == 0.0
    penalty = scenes["penalty 1e13 N/m"].model.supports[0]
    assert (penalty.stiffness[:2], penalty.contact[:2]) == ((1e13, 1e8), (1e13, 1e13))
    with pytest.raises(ModelError, match="no such value to begin from"):
        varied({"plate": {}}, {"plate.young": lambda old: 10 * old})
    odd = Case("odd", {"plate.young": -1.0})
    fitting, left_out = survey.fitting_cases(
        [CASES[0], odd], lambda case: build_scene(varied(table, case.changes), SCENE.parent)
    )
    assert len(fitting) == 1 and left_out == ["odd (plate.young: expected > 0 Pa, got -1.0)"]


@pytest.mark.both
@pytest.mark.parametrize("nt", [5, 32, 100, 257])
def test_causal_convolution(nt):
    generator = np.random.default_rng(7)
    kernel, values = generator.normal(size=(nt, 3, 2)), generator.normal(size=(nt, 2))
    convolve = survey_runs.causal(kernel)
    here = convolve(values)
    for n in range(nt):
        assert here[n] == pytest.approx(sum(kernel[n - m] @ values[m] for m in range(n + 1)), rel=1e-12, abs=1e-12)
    later = values.copy()
    later[nt // 2 + 1 :] *= 1e30
    assert convolve(later)[: nt // 2 + 1] == pytest.approx(here[: nt // 2 + 1], rel=1e-13, abs=1e-12)


@pytest.mark.both
def test_superposed_passes_are_those_of_time_stepping(sdls119a, comm):
    """Also where a contact is in tension at time 0: one support lies deeper than the others."""
    changes = {"transient.duration": 1.5, "load.amplitude": 8.0, "load.center": 0.9}
    table = varied(sdls119a.source, COMMON | changes)
    support = table["supports"][0]
    del support["edge"], support["count"]
    shallow = support | {"points": [[x, 0.0] for x in (0.0, 1.0, 3.0, 4.0)]}
    table["supports"] = [shallow, support | {"name": "DEEP", "points": [[2.0, 0.0]], "gap": 0.05}]
    with prepare(build_scene(table, SCENE.parent), comm) as assembly:
        law = assembly.operators.contacts.law
        stepped = analyse(assembly, Request("transient", 4)).passes
        assert law.release(stepped.histories[0].elongation)[0].max() > 0
        solve = survey_runs.superposed(assembly, stepped.histories[0])
        assert solve(None) is stepped.histories[0]
        for there in stepped.histories[1:]:
            here = solve(there.release)
            assert survey_runs.relative(here.probes, there.probes) < 1e-12
            # A force that is there at once throws the point masses of 0.1 kg: dt^2 a is 1e4 times what they move, and so is its round-off.
            assert survey_runs.relative(here.elongation, there.elongation) < 1e-7


@pytest.mark.both
def test_high_part_and_order():
    times = 0.005 * np.arange(401)
    low, high = 3.0 + times + np.sin(2 * np.pi * 10 * times), 0.2 * np.sin(2 * np.pi * 80 * times)
    # Whole periods but for the last sample, which leaves a little of the one in the other.
    assert survey_runs.high_part(times, (low + high)[:, None])[50:-50, 0] == pytest.approx(high[50:-50], abs=5e-3)
    steps = 0.1 / 2 ** np.arange(5)
    order, limit = survey_runs.order_and_limit(3.0 + 2.0 * steps**2)
    assert (order, limit) == (pytest.approx(2.0), pytest.approx(3.0, abs=1e-12))
    assert math.isnan(survey_runs.order_and_limit(np.array([1.0, 2.0]))[0])


@pytest.mark.both
@pytest.mark.parametrize(("difference", "agree"), [(1e-9, True), (2e-7, False)])
def test_disagreement_fails_the_survey(tmp_path, monkeypatch, comm, capsys, difference, agree):
    """Of a case that is claimed; another may differ."""
    times = np.linspace(0.0, 5.0, 11)
    history = history_of(times, np.stack([np.sin(times), np.cos(times)], axis=1), np.zeros((11, 5)), np.zeros((11, 5)))
    passes = Passes([history], number=1, pull=[0.0], ended="converged")

    def outcome(scene, comm, case):
        part = difference if case.name == "gap 5 mm" else 1e-3 if not case.claimed else 1e-10
        changed = replace(history, outputs=history.outputs * (1 + 1e-3 * len(case.changes)))
        return survey_runs.Outcome(case, changed, part, 1, survey_runs.PassesInTime(passes, 0.0), passes)

    monkeypatch.setattr(survey, "run_case", outcome)
    monkeypatch.setattr(survey, "run_chatter", lambda scene, comm, case: survey_runs.Chatter(case, history, 1e-3, 1e6, 1e5))
    levels = iter(range(1, 6))

    def level(scene, comm, laplace):
        return survey_runs.Level(scene.transient.step, replace(history, outputs=history.outputs + 0.5 ** next(levels)), None, 0.0)

    monkeypatch.setattr(survey, "run_level", level)
    out = tmp_path / "page.md"
    assert survey.survey(comm, SCENE, out, quick=False, quiet=False) is agree
    page = out.read_text(encoding="utf-8")
    assert ("The methods agree" in page, "do not agree" in page) == (agree, not agree)
    assert set(rows(page, "Uplift solved exactly")) == {case.name for case in CASES}
    assert ("FAILED" in capsys.readouterr().out) is not agree
