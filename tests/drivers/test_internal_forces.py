"""Internal forces in the files of a run, by every method that has a history, on ranks and through a checkpoint."""

import csv
import tomllib
from pathlib import Path

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.report.files import write_run
from uplift.drivers.results.collect import collect
from uplift.drivers.results.hdf5 import read_results
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene
from uplift.drivers.studies.comparison import compare
from uplift.drivers.studies.harmonic_files import respond
from uplift.meshes.checked import ModelError

SLAB = """
[mesh]
width = 4.0
height = 3.0
nx = 4
ny = 3
degree = 2
[plate]
young = 3e10
poisson = 0.2
density = 2500.0
thickness = 0.2
alpha = 2e-3
beta = 1.0
[gravity]
acceleration = 9.81
direction = "-Z"
[[load]]
direction = "Z"
signal = "ricker"
amplitude = 8.0
frequency = 4.0
center = 0.2
[[supports]]
name = "CORNERS"
points = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]
stiffness = { Z = 5e7 }
contact = { Z = 1e12 }
unilateral = "Z"
[[probes]]
name = "MID"
point = [2.0, 1.5]
forces = true
[[cuts]]
name = "HALF"
plane = { point = [2.0, 0.0], normal = [1.0, 0.0, 0.0] }
point = [2.0, 1.5]
[transient]
step = 0.01
duration = 0.4
[modal]
number = 6
[fourier]
length = 4.0
samples = 400
cutoff = 40.0
"""


def slab(**sections):
    return build_scene({**tomllib.loads(SLAB), **sections}, Path("."))


def rows_of(history):
    return {name: history.group(name) for name in ("forces", "cuts", "cuts damping")}


@pytest.mark.ranks
def test_forces_and_cuts_are_written_with_their_units(comm, tmp_path):
    with prepare(slab(), comm) as assembly:
        analysis = analyse(assembly, Request("transient"))
        write_run(assembly, analysis, tmp_path, plots=False)
    if comm.rank:
        return
    with (tmp_path / "forces.csv").open(encoding="utf-8") as file:
        forces = list(csv.DictReader(file))
    with (tmp_path / "cuts.csv").open(encoding="utf-8") as file:
        cuts = list(csv.DictReader(file))
    assert {"t", "MID.M11 [N m/m]", "MID.V1 [N/m]", "MID.S11.top [Pa]", "MID.mises.bottom [Pa]", "MID.angle.M [rad]"} <= set(forces[0])
    assert "MID.N11 [N/m]" not in forces[0]  # a plate that is only bent has none
    assert {"HALF.FZ [N]", "HALF.MY [N m]", "HALF.N [N]", "HALF.V [N]", "HALF.FZ damping [N]", "HALF.MY damping [N m]"} <= set(cuts[0])
    row = forces[17]
    # 6 M / t^2 at the face that the normal points to.
    assert float(row["MID.S11.top [Pa]"]) == pytest.approx(6 * float(row["MID.M11 [N m/m]"]) / 0.2**2)
    s11, s22, s12 = (float(row[f"MID.S{ij}.top [Pa]"]) for ij in ("11", "22", "12"))
    assert float(row["MID.mises.top [Pa]"]) == pytest.approx(np.sqrt(s11**2 - s11 * s22 + s22**2 + 3 * s12**2))
    assert float(cuts[17]["HALF.V [N]"]) == pytest.approx(abs(float(cuts[17]["HALF.FZ [N]"])))
    with h5py.File(tmp_path / "results.h5") as file:
        units = {key: file[key].attrs["unit"] for key in ("forces/moment", "forces/stress", "forces/shear", "forces/angle", "cuts/force")}
        assert units == {"forces/moment": "N m/m", "forces/stress": "Pa", "forces/shear": "N/m", "forces/angle": "rad", "cuts/force": "N"}
        names = list(file["forces/moment"].attrs["names"])
        assert file["forces/moment"][17, names.index("MID.M11")] == float(row["MID.M11 [N m/m]"])
    read = read_results(tmp_path)
    assert "cuts/damping moment" in read.series
    pairs = {(pair.path, pair.name): pair for pair in compare(read, read, ("A", "B")).pairs}
    assert pairs["forces/moment", "MID.M11"].largest == 0.0 and ("cuts/force", "HALF.V") in pairs
    assert not any(path == "forces/angle" for path, _ in pairs)  # a direction jumps by half a turn


def test_pressure_under_a_raft_on_a_bed_is_its_weight(comm):
    """Spread over the area, springs carry 2500 kg/m3 x 9.81 m/s2 x 0.2 m at every node."""
    bed = {"name": "BED", "group": "DAL1", "per": "area", "stiffness": {"Z": 1e6}, "contact": {"Z": 1e10}, "unilateral": "Z"}
    with prepare(slab(supports=[bed]), comm) as assembly:
        results = collect(assembly, analyse(assembly, Request("static")), None, {}, "")
    pressure = results.series["contacts/pressure/BED"]
    assert pressure.unit == "Pa" and len(pressure.names) > 12
    assert pressure.values == pytest.approx(np.full((1, len(pressure.names)), 2500 * 9.81 * 0.2), rel=1e-9)


@pytest.mark.parametrize("method", ["static", "transient", "modal"])
def test_methods_agree_on_forces(comm, method):
    """Half the weight stands on either side; six modes with static answers of a plate of 20 Hz and more give moments to 2 %."""
    with prepare(slab(), comm) as assembly:
        exact = rows_of(analyse(assembly, Request("transient")).final)
        found = rows_of(analyse(assembly, Request(method)).final)
    limit = {"static": 1e-9, "transient": 0.0, "modal": 0.02}[method]
    for name in ("forces", "cuts"):
        assert np.max(np.abs(found[name] - exact[name][: len(found[name])])) <= limit * np.max(np.abs(exact[name])), name


def test_published_passes_and_the_basis_have_forces(comm):
    with prepare(slab(), comm) as assembly:
        exact = rows_of(analyse(assembly, Request("transient")).final)
        passes = rows_of(analyse(assembly, Request("transient", 1)).final)
        reduced = rows_of(analyse(assembly, Request("transient", basis=1e-6)).final)
    for name, values in exact.items():
        assert np.max(np.abs(reduced[name] - values)) < 1e-4 * np.max(np.abs(values)), name
        assert passes[name].shape == values.shape and np.max(np.abs(passes[name])) > 0


@pytest.mark.ranks(2, 3)
@pytest.mark.parametrize("method", ["static", "transient"])
def test_ranks_agree(comm, method):
    """A raft with a wall and a lid that fold, shared out over all ranks and on each alone."""
    corners = {"RAFT": [[0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0]], "WALL": [[0, 1, 0], [4, 1, 0], [4, 1, 2], [0, 1, 2]]}
    table = tomllib.loads(SLAB)
    bed = {"name": "BED", "grid": {"from": [0, 0], "to": [4, 3], "count": [3, 3]}, "unilateral": "Z",
           "stiffness": {"X": 1e7, "Y": 1e7, "Z": 1e7}, "contact": {"X": 1e11, "Y": 1e11, "Z": 1e11}}
    table |= {
        "mesh": {"size": 1.0, "plates": [{"name": name, "corners": at} for name, at in corners.items()]}, "supports": [bed],
        "probes": [{"name": "A", "point": [2.0, 1.0, 0.0], "forces": True, "part": "WALL"},
                   {"name": "B", "point": [1.7, 2.2], "forces": True}],
        "cuts": [{"name": "FOOT", "group": "WALL.1", "side": "WALL", "point": [2, 1, 0]},
                 {"name": "UP", "plane": {"point": [0, 0, 1], "normal": [0.0, 0.1, -1.0]}, "point": [1.0, 0.0, 0.0]}],
        "transient": {"step": 0.01, "duration": 0.2},
    }
    found = []
    for world in (comm, MPI.COMM_SELF):
        with prepare(build_scene(table, Path(".")), world) as assembly:
            history = analyse(assembly, Request(method)).final
            found.append((rows_of(history), assembly.plate.forces.normals))
    (together, normals), (alone, own) = found
    for name, values in alone.items():
        apart = np.max(np.abs(together[name] - values))
        size = np.max(np.abs(alone[name.removesuffix(" damping")]))  # damping stands beside the elastic forces
        assert apart <= 1e-11 * size, (name, apart, size)
    for name, normal in own.items():
        assert normals[name] == pytest.approx(normal, abs=1e-12)


def test_the_method_without_steps_has_forces(comm):
    """It holds the limit of short steps: the march comes nearer with the square of its step."""
    with prepare(slab(), comm) as assembly:
        exact = rows_of(analyse(assembly, Request("exact")).final)
    errors = []
    for step, every in ((0.01, 1), (0.0025, 4)):
        with prepare(slab(transient={"step": step, "duration": 0.4, "every": every}), comm) as assembly:
            found = rows_of(analyse(assembly, Request("transient")).final)
        errors.append({name: np.max(np.abs(found[name] - exact[name])) / np.max(np.abs(exact[name])) for name in exact})
    for name in exact:
        assert errors[1][name] < 0.15 * errors[0][name] and errors[1][name] < 0.05, (name, errors)


@pytest.mark.complex
def test_sweeps_have_forces(comm):
    """The Laplace sweep is the march; the first pass of the Fourier sweep is the linear march where both converge."""
    with prepare(slab(), comm) as assembly:
        exact = rows_of(analyse(assembly, Request("transient")).final)
        swept = rows_of(analyse(assembly, Request("time-frequency")).final)
        periodic = analyse(assembly, Request("time-frequency", 1)).final
    for name, values in exact.items():
        # The circle of the transform leaves eps^(2/3) of the largest value, stiff contacts of 1e12 N/m beside it.
        assert np.max(np.abs(swept[name] - values)) < 1e-7 * np.max(np.abs(values)), name
    # Before the shaking begins the periodic answer is the state of rest.
    assert periodic.group("cuts")[0] == pytest.approx(exact["cuts"][0], abs=1e-2 * np.max(np.abs(exact["cuts"])))


@pytest.mark.complex
def test_stress_of_a_plate_that_a_pressure_shakes(comm, tmp_path):
    """The thin square plate of the NAFEMS tests 13 near its first frequency, against Kirchhoff's series with Rayleigh damping.

    The recovered moment of 8 x 8 cells is off by 0.2 %, transverse shear counts by (thickness / side)^2.
    """
    side, young, poisson, t, density, alpha, beta, frequency = 10.0, 2e11, 0.3, 0.05, 8000.0, 1.339e-3, 0.299, 2.375
    scene = {
        "mesh": {"width": side, "height": side, "nx": 8, "ny": 8, "degree": 2}, "kinematics": {"kind": "bending"},
        "plate": {"young": young, "poisson": poisson, "density": density, "thickness": t, "alpha": alpha, "beta": beta},
        "probes": [{"name": "MID", "point": [side / 2, side / 2], "forces": True}],
        "conditions": [{"group": name, "edge": "hard"} for name in ("DGAU", "DDRO", "DBAS", "DHAU")],
        "load": [{"kind": "pressure", "name": "Q", "value": 100.0, "signal": "step", "amplitude": 1.0}],
        "harmonic": {"frequencies": [frequency]},
    }
    with prepare(build_scene(scene, Path(".")), comm) as assembly:
        respond(assembly, tmp_path, plots=False)
    with (tmp_path / "forces.csv").open(encoding="utf-8") as file:
        row = next(csv.DictReader(file))
    found = complex(*(float(row[f"Q: MID.S11.top {part} [Pa]"]) for part in ("re", "im")))
    m, n = np.arange(1, 100, 2)[:, None], np.arange(1, 100, 2)[None, :]
    bending, omega = young * t**3 / 12 / (1 - poisson**2), 2 * np.pi * frequency
    stiffness = bending * (np.pi / side) ** 4 * (m**2 + n**2) ** 2
    dynamic = stiffness * (1 + 1j * omega * alpha) + density * t * (1j * omega * beta - omega**2)
    shape = np.sin(m * np.pi / 2) * np.sin(n * np.pi / 2)
    deflection = 1600.0 / np.pi**2 / (m * n) / dynamic * shape
    moment = bending * np.sum(deflection * (np.pi / side) ** 2 * (m**2 + poisson * n**2))
    assert abs(found) == pytest.approx(6 * abs(moment) / t**2, rel=0.005)
    # A first frequency that is off by 2e-4 turns the phase by that over the damping of 2 %.
    assert np.angle(found / moment) == pytest.approx(0.0, abs=2e-4 / 0.02)


@pytest.mark.complex
def test_a_harmonic_run_writes_amplitudes(comm, tmp_path):
    """At 1e-3 Hz the answer to gravity along Z of 1 m/s2 is static; with i omega alpha beside it from the damping stresses."""
    table = tomllib.loads(SLAB)
    frequency = 1e-3
    table["harmonic"] = {"frequencies": [frequency]}
    with prepare(build_scene(table, Path(".")), comm) as assembly:
        respond(assembly, tmp_path, plots=False)
    with (tmp_path / "forces.csv").open(encoding="utf-8") as file:
        forces = next(csv.DictReader(file))
    with (tmp_path / "cuts.csv").open(encoding="utf-8") as file:
        cuts = next(csv.DictReader(file))
    moment, stress = (float(forces[f"ground motion: MID.{name} re [{unit}]"]) for name, unit in (("M11", "N m/m"), ("S11.top", "Pa")))
    assert stress == pytest.approx(6 * moment / 0.2**2)
    # Half of the slab on the corners at its end: weight times a quarter of the length about the middle, 4 m x 3 m x 0.2 m x 2500 kg/m3;
    # the cut lies between columns of cells, whose nodes on the line belong to the side.
    elastic = float(cuts["ground motion: HALF.MY re [N m]"])
    assert abs(elastic) == pytest.approx(6000.0 * 4.0 / 8, rel=0.01)
    assert float(cuts["ground motion: HALF.MY damping im [N m]"]) == pytest.approx(2 * np.pi * frequency * 2e-3 * elastic, rel=1e-4)


def test_a_scene_that_asks_for_no_forces_has_no_rows_for_them(comm):
    table = tomllib.loads(SLAB)
    del table["cuts"]
    table["probes"][0]["forces"] = False
    with prepare(build_scene(table, Path(".")), comm) as assembly:
        assert not {"forces", "cuts", "cuts damping"} & {group.name for group in assembly.operators.outputs.groups}
        assert assembly.operators.outputs.per_velocity is None


@pytest.mark.parametrize(("section", "value", "words"), [
    ("probes", [{"name": "P", "point": [1.0, 1.0], "part": "DAL1"}], r"probes\[P\].part: expected forces = true"),
    ("probes", [{"name": "P", "point": [1.0, 1.0], "forces": "yes"}], r"probes\[P\].forces: expected true or false"),
    ("parts", [{"group": "DAL1"}], r"parts\[1\].young: missing"),
    ("parts", [{"group": "DAL1", "axes": {"x": [1, 0], "edge": "DBAS"}}], r"parts\[1\].axes: expected one of x, edge, cylinder"),
    ("parts", [{"group": "DAL1", "axes": {}}], r"parts\[1\].axes: expected one of x, edge, cylinder"),
    ("parts", [{"group": "DAL1", "axes": {"x": [0, 0, 0]}}], r"parts\[1\].axes.x: expected a direction"),
    ("parts", [{"group": "DAL1", "axes": {"cylinder": {"point": [0, 0], "axis": [0, 0]}}}], r"parts\[1\].axes.cylinder.axis: expected"),
    ("parts", [{"group": "DAL1", "axes": {"cylinder": {"point": [0, 0]}}}], r"parts\[1\].axes.cylinder.axis: missing"),
    ("parts", [{"group": "DAL1", "axes": {"y": [0, 1]}}], r"parts\[1\].axes.y: unknown key"),
    ("parts", [{"group": "DAL1", "young": 1e10, "axes": {"x": [0, 1]}}], r"parts\[1\].poisson: missing"),
    ("cuts", [{"name": "A", "side": "DAL1", "group": "DBAS", "point": [0, 0]}] * 2, "cuts: expected different names"),
])
def test_bad_entries_are_refused_by_their_key(section, value, words):
    with pytest.raises(ModelError, match=words):
        slab(**{section: value})


@pytest.mark.parametrize(("axes", "words"), [
    ({"x": [0.0, 0.0, 1.0]}, r"probes\[MID\].axes: the direction of axis 1 is the normal"),
    ({"edge": "DNOT"}, r"plate.axes.edge: no edge group 'DNOT'"),
    ({"cylinder": {"point": [2.0, 1.5], "axis": [0.0, 0.0, 1.0]}}, r"probes\[MID\].axes: a point lies on the axis"),
])
def test_axes_that_fit_no_plate_are_refused(comm, axes, words):
    table = tomllib.loads(SLAB)
    table["plate"]["axes"] = axes
    with pytest.raises(ModelError, match=words), prepare(build_scene(table, Path(".")), comm):
        pass
