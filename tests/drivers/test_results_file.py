"""What a run leaves for other programs, read back with meshio and h5py, and what the results file says read back by the project."""

import csv
import json
from dataclasses import replace

import h5py
import meshio
import numpy as np
import pytest

from tests.process import ROOT, SCENE, drivers, finish, start
from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.snapshots import Snapshots
from uplift.drivers.results.contact_lines import contact_lines
from uplift.drivers.results.hdf5 import read_results, write_results
from uplift.drivers.results.results import floor_acceleration
from uplift.drivers.results.viewers import real_fields
from uplift.drivers.scene.request import Request
from uplift.meshes.checked import ModelError
from uplift.solvers.spectra import second_differences


def run(*arguments):
    done = drivers("run", *arguments, "--no-plots")
    assert done.returncode == 0, done.stderr


def columns(path):
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    return rows[0], np.array(rows[1:], dtype=float)


def test_histories_are_those_of_the_tables_with_units(reference_run):
    _, history = columns(reference_run / "history.csv")
    _, contacts = columns(reference_run / "contacts.csv")
    _, energy = columns(reference_run / "energy.csv")
    with h5py.File(reference_run / "results.h5") as file:
        assert file.attrs["format"] == "uplift results" and file.attrs["units"] == "SI"
        assert file["scene"].asstr()[()] == SCENE.read_text(encoding="utf-8")
        assert json.loads(file["facts"].asstr()[()])["dofs"] == 100
        assert file["times"].attrs["unit"] == "s"
        assert np.max(np.abs(file["times"][()] - history[:, 0])) < 1e-12
        displacement = file["probes/displacement"]
        assert list(displacement.attrs["names"]) == ["P3.DX", "P3.DY"] and displacement.attrs["unit"] == "m"
        assert np.array_equal(displacement[()], history[:, 1:3])
        assert np.array_equal(file["contacts/force"][()], contacts[:, 1:6]) and file["contacts/force"].attrs["unit"] == "N"
        assert np.array_equal(file["contacts/gap"][()], contacts[:, 6:]) and file["contacts/gap"].attrs["unit"] == "m"
        assert np.array_equal(file["energy/ledger"][()], energy[:, 1:]) and file["energy/ledger"].attrs["unit"] == "J"
        assert np.array_equal(file["points/directions"][()], np.tile([0.0, 1.0, 0.0], (5, 1)))
        everything = []
        file.visititems(lambda key, item: everything.append((key, item)))
        for key, item in everything:
            if isinstance(item, h5py.Dataset) and key not in ("scene", "facts", "mesh/cells"):
                assert "unit" in item.attrs, key


def test_the_file_is_read_as_it_was_written(reference_run):
    results = read_results(reference_run)
    assert results.name.endswith("(transient, uplift exact)")
    assert results.step == pytest.approx(0.01, rel=1e-12)
    names, absolute = floor_acceleration(results.series)
    ground = results.series["ground/acceleration"].values
    assert names == ("P3.DX", "P3.DY")
    assert np.array_equal(absolute[:, 0] - ground[:, 0], results.series["probes/acceleration"].values[:, 0] + ground[:, 0] - ground[:, 0])
    assert np.min(ground[:, 0]) == -2.24084 and not ground[:, 1:].any()
    # Over the archived 0.01 s the differences of displacements are coarse, but until a contact opens they are those of the same motion:
    # of a component at 3 Hz, the third mode, they miss (2 pi 3 0.01)^2 / 12 = 0.3 %.
    smooth = slice(1, int(np.argmax(np.any(results.series["contacts/gap"].values > 0, axis=1))) - 1)
    again = second_differences(results.series["probes/displacement"].values, results.step)[smooth]
    assert smooth.stop > 150
    assert np.max(np.abs(again - results.series["probes/acceleration"].values[smooth])) < 5e-3 * np.max(np.abs(again))
    assert np.array_equal(results.spectra.floor, np.max(np.abs(absolute), axis=0))
    other = results.with_spectra((0.05,))
    assert results.spectra.damping.tolist() == [0.02, 0.05, 0.10]
    assert np.array_equal(other.spectra.acceleration, results.spectra.acceleration[1:2])


def test_line_forces_add_up_to_the_contact_forces(reference_run):
    series = read_results(reference_run).series
    line = series["contacts/line force/RESS"]
    assert line.unit == "N/m"
    total = line.values @ np.array([0.5, 1.0, 1.0, 1.0, 0.5])
    assert total == pytest.approx(series["contacts/force"].values.sum(axis=1), rel=1e-12)


def test_lines_of_contacts():
    points = np.array([[3.0, 1.0], [0.0, 1.0], [1.0, 1.0], [0.0, 0.0], [1.0, 0.5], [5.0, 5.0], [0.0, 0.0], [0.0, 0.0]])
    groups = {"row": np.array([0, 1, 2]), "bent": np.array([3, 4, 5]), "one": np.array([3]), "twice": np.array([6, 7])}
    (line,) = contact_lines(groups, points)
    assert line.name == "row" and line.contacts.tolist() == [1, 2, 0]
    assert line.position == pytest.approx([0, 1, 3]) and line.share == pytest.approx([0.5, 1.5, 1.0])


def test_film_opens_with_meshio(reference_run):
    results = read_results(reference_run)
    with meshio.xdmf.TimeSeriesReader(reference_run / "film.xdmf") as reader:
        points, cells = reader.read_points_cells()
        assert len(points) == 45 and cells[0].type == "quad" and len(cells[0].data) == 32
        corner = int(np.argmin(np.linalg.norm(points - [4, 8, 0], axis=1)))
        assert reader.num_steps == 200
        for k in (0, 77, 199):
            time, data, _ = reader.read_data(k)
            row = results.plate.rows[k]
            assert time == pytest.approx(results.times[row], abs=1e-12)
            here = data["displacement [m]"][corner]
            assert np.isrealobj(here)
            # Frames are in single precision.
            assert here[:2] == pytest.approx(results.series["probes/displacement"].values[row], rel=1e-7)


def test_fields_open_with_meshio(reference_run):
    results = read_results(reference_run)
    probes = results.series["probes/displacement"].values
    for name, suffix in (("deformed.vtu", " [m]"), ("deformed.med", "")):
        mesh = meshio.read(reference_run / name)
        corner = int(np.argmin(np.linalg.norm(mesh.points - [4, 8, 0], axis=1)))
        assert mesh.point_data[f"displacement{suffix}"][corner, :2] == pytest.approx(probes[np.argmax(np.max(np.abs(probes), axis=1))])
        # Every archived instant counts in the envelope, not only the frames.
        assert mesh.point_data[f"least displacement{suffix}"][corner, :2] == pytest.approx(probes.min(axis=0))
        assert mesh.point_data[f"largest displacement{suffix}"][corner, :2] == pytest.approx(probes.max(axis=0))
    assert results.plate.watched == 501


def test_the_tour_of_a_results_file_runs(reference_run, tmp_path):
    done = finish(start("-W", "error", ROOT / "docs" / "read_results.py", reference_run, cwd=tmp_path))
    assert done.returncode == 0, done.stderr
    assert "P3.DX: -6.404" in done.stdout and "first opening at t =" in done.stdout and "45 nodes, 200 frames" in done.stdout


def test_nine_node_cells_open_too(tmp_path):
    text = SCENE.read_text(encoding="utf-8").replace("degree = 1", "degree = 2").replace("duration = 5.0", "duration = 0.1")
    scene = tmp_path / "nine.toml"
    scene.write_text(text.replace("instants = [2.33, 2.34]", ""), encoding="utf-8")
    run(scene, "--out", tmp_path / "out")
    with meshio.xdmf.TimeSeriesReader(tmp_path / "out" / "film.xdmf") as reader:
        points, cells = reader.read_points_cells()
        assert cells[0].type == "quad9" and len(points) == 153 and reader.num_steps == 11
    med = meshio.read(tmp_path / "out" / "deformed.med")
    assert med.cells[0].type == "quad" and len(med.points) == 45


def test_a_sweep_leaves_its_complex_field_as_modulus_and_phase(tmp_path):
    run(SCENE, "--out", tmp_path, "--method", "time-frequency", "--iterations", "1")
    mesh = meshio.read(tmp_path / "amplitude.vtu")
    (modulus, size), (phase, angle) = sorted(mesh.point_data.items())
    assert modulus.endswith(", modulus") and phase.endswith(", phase [rad]")
    corner = int(np.argmin(np.linalg.norm(mesh.points - [4, 8, 0], axis=1)))
    history = read_results(tmp_path).series["probes/displacement"].values
    spectrum = np.fft.rfft(history, axis=0)[1:] * 2 / len(history)
    strongest = int(np.argmax(np.max(np.abs(spectrum), axis=1)))
    assert f"{(strongest + 1) / 20.48:.6g} Hz" in modulus
    here = (size * np.exp(1j * angle))[corner, :2]
    assert np.abs(here - spectrum[strongest]) == pytest.approx(0.0, abs=1e-12 * np.abs(spectrum).max())


def test_real_fields_stay_as_they_are():
    values = np.array([[1.0, -2.0, 0.0]])
    assert real_fields("u", values)["u"] is values


def test_other_files_are_refused_in_one_line(tmp_path, reference_run):
    text = tmp_path / "text.h5"
    text.write_text("no", encoding="utf-8")
    other, newer, damaged = (tmp_path / f"{name}.h5" for name in ("other", "newer", "damaged"))
    with h5py.File(other, "w"):
        pass
    for path, damage in ((newer, lambda file: file.attrs.__setitem__("version", 99)), (damaged, lambda file: file.pop("times"))):
        path.write_bytes((reference_run / "results.h5").read_bytes())
        with h5py.File(path, "r+") as file:
            damage(file)
    for path, words in (
        (text, "not a results file"), (other, "not a results file of this program"), (newer, "version 99"), (damaged, "damaged"),
        (tmp_path / "none", "expected a results file or a folder"),
    ):
        with pytest.raises(ModelError, match=words) as caught:
            read_results(path)
        assert len(str(caught.value).splitlines()) == 1


@pytest.mark.both
@pytest.mark.parametrize("passes", [pytest.param(None, marks=pytest.mark.ranks), 2])
def test_film_shows_what_the_probes_record(assembly, passes):
    snapshots = Snapshots(assembly)
    analysis = analyse(assembly, Request("transient", passes), snapshots)
    snapshot_data = snapshots.develop(analysis.final.peak_field)
    if assembly.operators.comm.rank != 0:
        assert snapshot_data is None
        return
    corner = int(np.argmin(np.linalg.norm(snapshot_data.points - [4, 8, 0], axis=1)))
    probes = analysis.final.probes
    assert len(snapshot_data.rows) == 200 and snapshot_data.watched == len(probes)
    assert np.max(np.abs(snapshot_data.snapshots[:, corner, :2] - probes[snapshot_data.rows])) < 1e-7 * np.max(np.abs(probes))
    assert snapshot_data.envelope[0, corner, :2] == pytest.approx(probes.min(axis=0), rel=1e-12)
    assert snapshot_data.peak[0, corner, :2] == pytest.approx(probes[analysis.final.peak], rel=1e-12)


def test_a_large_model_has_fewer_frames_or_none(assembly, monkeypatch):
    snapshots = Snapshots(assembly)
    snapshots.start(501)
    assert len(snapshots.rows) == 200 and snapshots.rows[0] == 0 and snapshots.rows[-1] == 500
    monkeypatch.setattr("uplift.drivers.analysis.snapshots.FILM_BYTES", 8 * 100 * 20)
    snapshots.start(501)
    assert len(snapshots.rows) == 20 and snapshots.rows[-1] == 500
    monkeypatch.setattr("uplift.drivers.analysis.snapshots.FILM_BYTES", 8 * 100 * 3)
    snapshots.start(501)
    assert len(snapshots.rows) == 0
    snapshots.watch(0, np.ones(assembly.operators.n_local))
    snapshot_data = snapshots.develop(None)
    assert snapshot_data.snapshots.shape == (0, 45, 3) and len(snapshot_data.envelope) == 2


def test_ten_thousand_contacts_have_their_names(tmp_path, reference_run):
    whole = read_results(reference_run)
    n = 10_000
    names = tuple(f"SOIL.{i}" for i in range(1, n + 1))
    values = np.zeros((len(whole.times), n))
    series = {key: replace(whole.series[key], names=names, values=values) for key in ("contacts/force", "contacts/gap")}
    write_results(tmp_path / "results.h5", replace(whole, series=whole.series | series))
    assert read_results(tmp_path / "results.h5").series["contacts/force"].names == names


def test_names_of_contacts_cannot_clash(tmp_path):
    """Contact 11 of S and contact 1 of S1 had one name; so had contact 1 of S.1 and others."""
    text = SCENE.read_text(encoding="utf-8").split("[[supports]]")[0]
    rest = '[[probes]]\nname = "P"\npoint = "P3"\n[transient]\nstep = 0.01\nduration = 0.05\n'
    for name, row in (("S", 0.0), ("S1", 8.0), ("S.1", 4.0)):
        text += f'[[supports]]\nname = "{name}"\npoints = {[[float(x), row] for x in range(5)]}\n'
        text += 'stiffness = { X = 1e8, Y = 1e8 }\ncontact = { X = 1e12, Y = 1e12 }\nunilateral = "Y"\n'
    (tmp_path / "scene.toml").write_text(text + rest, encoding="utf-8")
    run(tmp_path / "scene.toml", "--out", tmp_path / "out")
    header, values = columns(tmp_path / "out" / "contacts.csv")
    expected = [f"{name}.{number}" for name in ("S", "S1", "S.1") for number in range(1, 6)]
    assert header == ["t", *(f"{name} force [N]" for name in expected), *(f"{name} gap [m]" for name in expected)]
    assert len(set(header)) == len(header) == values.shape[1]
