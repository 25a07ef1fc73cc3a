"""The drivers that tabulate modes and the error of a truncated basis."""

import copy
import csv
import json
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.process import SCENE, child, drivers
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.analysis.modes import Wanted, find_modes, wanted_modes
from uplift.drivers.scene.scene import build_scene
from uplift.drivers.studies.mode_table import tabulate_modes
from uplift.drivers.studies.truncation import measure, mode_counts, tabulate_truncation
from uplift.meshes.checked import ModelError
from uplift.solvers.errors import SolverError
from uplift.solvers.time_domain.march import transient

FREQUENCIES = [1.8210208051600427, 6.51606067886772, 7.933281514035725]
"""Hz, from an independent dense model of SDLS119."""


def read_columns(path):
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    return dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))


@pytest.fixture
def changed(sdls119a, comm):
    """Plants of the scene with whole sections replaced (None: taken out)."""
    made = []

    def make(**sections):
        table = {k: v for k, v in (copy.deepcopy(sdls119a.source) | sections).items() if v is not None}
        made.append(prepare(build_scene(table, Path()), comm))
        return made[-1]

    yield make
    for assembly in made:
        assembly.__exit__()


def test_modes_are_tabulated_drawn_and_written_for_paraview(tmp_path):
    done = child("modes", SCENE, "--out", tmp_path, "--quiet")
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["modes.csv", "modes.png", "modes.vtu", "summary.json"]
    columns = read_columns(tmp_path / "modes.csv")
    assert columns["mode"].tolist() == list(range(1, 21))
    assert columns["frequency [Hz]"][:3] == pytest.approx(FREQUENCIES, rel=1e-9)
    assert columns["period [s]"] == pytest.approx(1 / columns["frequency [Hz]"], rel=1e-15)
    assert columns["residual"].max() < 1e-9
    omega = 2 * np.pi * columns["frequency [Hz]"]
    # Springs are not damped, so the ratio stays below that of a plate with C = alpha K + beta M throughout.
    assert np.all(columns["damping [%]"] <= 100 * (5e-3 * omega + 0.1 / omega) / 2)
    assert columns["damping [%]"][0] == pytest.approx(2.6145, abs=5e-5)
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["frequencies_Hz"] == columns["frequency [Hz]"].tolist()
    assert summary["sturm_count"]["inside"] == 20
    assert summary["sum_of_effective_masses"]["X"] == pytest.approx(columns["mass X [%]"].sum() / 100, rel=1e-12)
    assert 0.9 < summary["sum_of_effective_masses"]["X"] < 1 and 0.9 < summary["sum_of_effective_masses"]["Y"] < 1
    mesh = meshio.read(tmp_path / "modes.vtu")
    assert len(mesh.point_data) == 20
    first, second = mesh.point_data["mode 1, 1.821 Hz"], mesh.point_data["mode 2, 6.516 Hz"]
    assert np.linalg.norm(first, axis=1).max() == pytest.approx(1.0) and np.all(first[:, 2] == 0)
    top = mesh.points[:, 1] == 8
    assert np.all(np.abs(first[top, 0]) > 0.8) and abs(first[top, 0].sum()) > 4  # sway
    assert np.all(np.abs(second[top, 1]) > 0.8) and abs(second[top, 0].sum()) < 1e-9  # heave


def test_all_modes_carry_the_whole_mass(assembly, tmp_path):
    lines = tabulate_modes(assembly, Wanted(100, None, 0.0), tmp_path, plots=False)
    columns = read_columns(tmp_path / "modes.csv")
    for axis in "XY":
        assert columns[f"mass {axis} [kg]"].sum() == pytest.approx(assembly.plate.total_mass, rel=1e-9)
        assert columns[f"mass {axis} [%]"].sum() == pytest.approx(100, rel=1e-9)
    foot = next(line.split() for line in lines if line.startswith("  sum"))
    assert [float(v) for v in foot[1:]] == pytest.approx([80000.5, 100, 80000.5, 100], abs=1e-4)
    assert "as many were found and none is missing" in lines[-2]


def test_a_band_keeps_the_numbers_of_the_whole_spectrum(assembly, tmp_path):
    lines = tabulate_modes(assembly, wanted_modes(assembly.scene, None, [6.0, 8.0]), tmp_path, plots=False)
    columns = read_columns(tmp_path / "modes.csv")
    assert columns["mode"].tolist() == [2, 3]
    assert columns["frequency [Hz]"] == pytest.approx(FREQUENCIES[1:], rel=1e-9)
    assert "1 below 6 Hz and 3 below 8 Hz, so 2 modes between" in lines[-2]


def test_a_scene_that_asks_for_no_modes_gets_twenty_or_all_it_has(changed):
    assembly = changed(modal=None)
    assert find_modes(assembly, wanted_modes(assembly.scene, None, None)).number == 20
    held = {"name": "feet", "points": ["P1", "P2"], "stiffness": {"X": 1e8, "Y": 1e8}}
    assembly = changed(modal=None, supports=[], springs=[held], mesh=assembly.scene.source["mesh"] | {"nx": 1, "ny": 1})
    assert find_modes(assembly, wanted_modes(assembly.scene, None, None)).number == 8


def test_what_cannot_be_is_refused_by_the_name_under_which_it_was_asked(assembly, changed):
    scene = assembly.scene
    with pytest.raises(ModelError, match="^--number: expected >= 1 and <= 100, the dofs that have mass, got 101"):
        find_modes(assembly, wanted_modes(scene, 101, None))
    with pytest.raises(ModelError, match="^--band: there is no mode between 2 and 5 Hz; the nearest are at 1.82102 Hz and 6.51606 Hz"):
        find_modes(assembly, wanted_modes(scene, None, [2.0, 5.0]))
    with pytest.raises(ModelError, match="^--band: expected 0 <= low < high in Hz"):
        find_modes(assembly, wanted_modes(scene, None, [5.0, 2.0]))
    crowded = changed(modal={"number": 101})
    with pytest.raises(ModelError, match="^modal.number: expected >= 1 and <= 100"):
        find_modes(crowded, wanted_modes(crowded.scene, None, None))


def test_a_plate_that_nothing_holds(changed, tmp_path, monkeypatch):
    free = changed(supports=[], springs=[])
    with pytest.raises(ModelError, match="^modal: the plate can move .*, in 3 rigid-body.*set modal.shift < 0, such as -900 r"):
        find_modes(free, wanted_modes(free.scene, None, None))
    with pytest.raises(ModelError, match="modal: the plate can move without strain"):
        tabulate_truncation(free, tmp_path, plots=False)
    shifted = changed(supports=[], springs=[], modal={"number": 5, "shift": -900.0})
    tabulate_modes(shifted, wanted_modes(shifted.scene, None, None), tmp_path, plots=False)
    columns = read_columns(tmp_path / "modes.csv")
    assert columns["frequency [Hz]"][:3].tolist() == [0, 0, 0] and np.all(np.isinf(columns["period [s]"][:3]))
    assert columns["mass X [%]"][:3].sum() == pytest.approx(100, rel=1e-9)  # rigid bodies take all of it
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["rigid_body_modes"] == 3
    with pytest.raises(ModelError, match="modal: nothing holds the plate, so it has no static state"):
        tabulate_truncation(shifted, tmp_path, plots=False)

    def lost(number=19):
        raise SolverError(f"{number} modes were found and 21 are there")

    held = changed()
    real = sys.modules["uplift.drivers.analysis.modes"].modes
    monkeypatch.setattr("uplift.drivers.analysis.modes.modes", lambda *a, **o: real(*a, **o) if o["shift"] else lost())
    with pytest.raises(SolverError, match="19 modes"):  # another failure is not taken for a free plate
        find_modes(held, wanted_modes(held.scene, None, None))
    monkeypatch.setattr("uplift.drivers.analysis.modes.modes", lambda *a, **o: lost(20 if o["shift"] else 19))
    with pytest.raises(SolverError, match="19 modes"):  # nor is the search for rigid motions, if that fails too
        find_modes(held, wanted_modes(held.scene, None, None))


def test_the_shift_that_is_named_for_a_thin_free_plate_finds_its_modes(comm):
    table = {
        "mesh": {"width": 10.0, "height": 10.0, "nx": 4, "ny": 4}, "kinematics": {"kind": "bending"}, "modal": {"number": 4},
        "plate": {"young": 2e11, "poisson": 0.3, "density": 8000.0, "thickness": 5e-4},
    }
    with prepare(build_scene(table, Path()), comm) as free:
        with pytest.raises(ModelError, match="in 3 rigid-body.*such as -0.006 rad2/s2") as error:
            find_modes(free, wanted_modes(free.scene, None, None))
        table["modal"]["shift"] = float(str(error.value).split("such as ")[1].split()[0])
    with prepare(build_scene(table, Path()), comm) as free:
        assert find_modes(free, wanted_modes(free.scene, None, None)).rigid == 3


def test_a_free_plate_is_one_line_and_code_2(tmp_path):
    text = SCENE.read_text(encoding="utf-8")
    scene, out = tmp_path / "free.toml", tmp_path / "out"
    kept = [part for part in text.split("\n[") if not part.startswith(("[supports]", "[springs]"))]
    scene.write_text("\n[".join(kept), encoding="utf-8")
    done = drivers("modes", scene, "--out", out, "--quiet")
    assert done.returncode == 2 and done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith(f"uplift: {scene}: modal: the plate can move without strain")
    assert list(out.iterdir()) == []


def test_two_ranks_write_the_same_modes(tmp_path):
    done = child("modes", SCENE, "--out", tmp_path, "--no-plots", "--quiet", ranks=2)
    assert done.returncode == 0, done.stderr
    assert read_columns(tmp_path / "modes.csv")["frequency [Hz]"][:3] == pytest.approx(FREQUENCIES, rel=1e-9)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["modes.csv", "modes.vtu", "summary.json"]


def test_truncation_is_tabulated(tmp_path):
    done = child("truncation", SCENE, "--out", tmp_path, "--no-plots")
    assert done.returncode == 0, done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["summary.json", "truncation.csv"]
    columns = read_columns(tmp_path / "truncation.csv")
    assert columns["modes"].tolist() == [n for n in (5, 10, 15, 20, 30, 40, 60, 80, 100) for _ in range(2)]
    with_, alone = columns["static correction"] == 1, columns["static correction"] == 0
    # With 80 of 100 modes what a static answer adds is below the round-off of the modes: errors of 2.7e-3 and 6.2e-3.
    for name, bound in (("displacement error", 5e-3), ("contact force error", 1e-2)):
        assert np.all(columns[name][with_] < bound) and np.all(np.diff(columns[name][with_][:6]) < 1e-6)
        assert np.all(columns[name][alone][:-1] > 50 * columns[name][with_][:-1])
        assert columns[name][-1] < 1e-9 and columns[name][-2] < 1e-9  # all modes are the model itself
    assert columns["vectors"][:2].tolist() == [5, 15]  # with answers to two loads, five contacts and three resultants
    table = [line.split() for line in done.stdout.splitlines() if line.strip()[:3] in ("20 ", "100")]
    assert [row[0] for row in table] == ["20", "100"]


def test_with_static_answers_twenty_modes_are_near_and_without_they_are_not(assembly):
    """Displacements are 2.1e-5 off with answers to loads and contacts alone, contact forces 2.7e-4; without any, by more than half."""
    alone, corrected = measure(assembly, assembly.scene.transient, find_modes(assembly, Wanted(20, None, 0.0)), [20]).levels
    assert (alone.vectors, corrected.vectors) == (20, 30)
    assert corrected.displacement < 2.1e-5 and corrected.contact < 2.8e-4
    assert alone.displacement > 0.5 and alone.contact > 0.5


def test_a_run_that_fails_leaves_a_gap_in_the_table(changed, tmp_path, monkeypatch):
    assembly = changed(transient={"step": 0.01, "duration": 0.1, "every": 1, "start": "static"})
    def failing(stepper, *arguments, **options):
        if stepper.operators.n == 5:
            raise SolverError("the open contacts of a time step cannot be found")
        return transient(stepper, *arguments, **options)

    monkeypatch.setattr("uplift.drivers.studies.truncation.transient", failing)
    lines = tabulate_truncation(assembly, tmp_path, plots=True)
    assert (tmp_path / "truncation.png").exists()
    assert lines[-9].split()[:5] == ["5", "5", "-", "-", "-"]
    assert (tmp_path / "truncation.csv").read_text(encoding="utf-8").splitlines()[1] == "5,0,5,,,,"
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["runs"]["displacement error"][0] is None


def test_large_models_stop_at_two_hundred_modes():
    assert mode_counts(4) == [4]
    assert mode_counts(100)[-2:] == [80, 100]
    assert mode_counts(300)[-2:] == [200, 300]
    assert mode_counts(5000)[-1] == 200


def test_truncation_needs_time_steps(changed, tmp_path):
    with pytest.raises(ModelError, match="^transient: missing; truncation needs the section"):
        tabulate_truncation(changed(transient=None), tmp_path, plots=False)
