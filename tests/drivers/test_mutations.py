"""Scenes, records, meshes, bases and results with mistakes made at random: each ends in a result or in one line, in little memory.

There are 30 of each, and 300 in the longer tier, or as many as the environment variable UPLIFT_MUTATIONS says.
"""

import json
import os
import resource
import signal
import subprocess
import sys
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

import gmsh
import numpy as np
import pytest

from tests.drivers.test_schema import RECTANGLE
from tests.mutations import damaged, generator, mutated
from tests.plate_mutations import KILOBYTES
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.analysis.memory import expected_bytes
from uplift.drivers.report.page import report
from uplift.drivers.results.hdf5 import damage_named, read_results
from uplift.drivers.scene.analysis import METHODS
from uplift.drivers.scene.cautions import scene_cautions
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import read_scene
from uplift.drivers.scene.shipped import shipped
from uplift.drivers.studies.comparison import compare
from uplift.forms.loads.records import RecordChoice, read_record
from uplift.meshes.checked import ModelError
from uplift.solvers.bases.krylov import krylov_basis
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.basis_file import read_basis, write_basis

ROOT = Path(__file__).parents[2]
ALONE = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX", "PRTE"))}
MANY = int(os.environ.get("UPLIFT_MUTATIONS", "300"))
SECONDS = 10
"""s of processor time that a file may take; HDF5 reads in a child that ends itself."""

some_and_many = pytest.mark.parametrize("number_of_files", [30, pytest.param(MANY, marks=pytest.mark.check)])

INPUTS = """
[[springs]]
name = "S"
file = "points.csv"
stiffness = { Z = 1.0 }
[[load]]
direction = "Z"
signal = "csv"
file = "record.csv"
[[load]]
direction = { RX = 1.0, RY = 2.0 }
signal = "noise"
seed = 3
high = 10.0
end = 3.0
[[load]]
direction = "Z"
signal = "sweep"
first = 1.0
last = 3.0
end = 3.0
[[probes]]
name = "P"
point = "P1"
[transient]
step = 0.01
duration = 3.0
"""
CSV = {"points.csv": b"x,y,z,share\n0,0,0,1\n4,4,0,2\n", "record.csv": b"t,a\n0,0\n0.01,1\n0.02,0.5\n3,0\n"}

CHILD = """
import signal, sys
from pathlib import Path
from mpi4py import MPI
from uplift.meshes.checked import ModelError
from uplift.meshes.imported import MeshFile
from uplift.meshes.tagged import build_mesh
for name in sys.argv[1:]:
    signal.alarm(60)
    try:
        tagged = build_mesh(MPI.COMM_SELF, MeshFile(Path(name)), lambda flat, order, level: (2 if flat else 3, order))
        print("result", tagged.mesh.topology.index_map(2).size_global, flush=True)
    except ModelError as error:
        print("error", str(error), flush=True)
"""


def slow(number, frame):
    raise AssertionError(f"not done in {SECONDS} s of processor time")


def read_all(path):
    """All that is done with a scene before it is meshed."""
    scene = read_scene(path)
    scene_cautions(scene)
    for method in METHODS:
        request = Request(method)
        try:
            request.check(scene)
        except ModelError:
            continue
        assert expected_bytes(scene, request, 1, None) > 0


@contextmanager
def in_time():
    """Fail if the block, one file, takes too long."""
    before = signal.signal(signal.SIGPROF, slow)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def outcomes(make, read, number_of_files):
    """Read so many files with mistakes, which `make` writes by number and returns; count how they end, and hold the memory down."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    ended = {"result": 0, "error": 0}
    for number in range(number_of_files):
        path = make(number)
        try:
            with in_time():
                read(path)
            ended["result"] += 1
        except ModelError as error:
            assert str(error) and len(str(error).splitlines()) == 1, number
            ended["error"] += 1
        except Exception as error:
            raise AssertionError(f"mutation {number}") from error
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak < 500_000  # kB
    return ended


@some_and_many
def test_scenes_and_tables(tmp_path, number_of_files):
    texts = [path.read_bytes() for path in shipped().values()] + [(RECTANGLE + INPUTS).encode()]

    def make(number):
        rng = generator("scene", number)
        files = CSV | {"scene.toml": rng.choice(texts)}
        name = "scene.toml"
        if rng.random() < 0.25:
            files["scene.toml"] = texts[-1]
            name = rng.choice(list(CSV))
        files[name] = mutated(files[name], rng)
        for file, data in files.items():
            (tmp_path / file).write_bytes(data)
        return tmp_path / "scene.toml"

    ended = outcomes(make, read_all, number_of_files)
    assert min(ended.values()) > 0.1 * number_of_files, ended


def record_texts():
    """One record as different programs write it."""
    rows = [(0.01 * i, value) for i, value in enumerate([0.5, -1.25, 3.0, 0.0] * 10)]
    semicolons = "".join(f"{t:.2f};{v:.3f}\n" for t, v in rows).replace(".", ",")
    blanks = "".join(f"{t:10.2f}{v:15.5e}\n" for t, v in rows)
    return [
        ("Time [s],Acceleration [g]\n" + "".join(f"{t:.2f},{v:.3f}\n" for t, v in rows)).encode(),
        ("Zeit [s];a [m/s²]\n" + semicolons).encode("latin-1"), ("Zeit [s];a [m/s²]\n" + semicolons).encode("utf-16"),
        ("% t a\n" + blanks.replace("e", "D")).encode(), ("Kobe 1995\nTime (s)  Acc (cm/s2)\n" + blanks).encode(),
        ('"t";"ax";"ay"\n' + "".join(f'"{t:.2f}";"{v:.3f}";"{v:.3f}"\n' for t, v in rows)).encode(),
    ]


@some_and_many
def test_records(tmp_path, number_of_files):
    texts = record_texts()

    def make(number):
        rng = generator("record", number)
        (tmp_path / "record.txt").write_bytes(mutated(rng.choice(texts), rng))
        return tmp_path / "record.txt"

    def read(path):
        for column in ("ax", 2, None):
            with suppress(ModelError) if column is not None else nullcontext():
                table = read_record(path, RecordChoice(column=column))
                assert np.all(np.isfinite(table.values)) and np.all(np.diff(table.times) > 0)

    ended = outcomes(make, read, number_of_files)
    assert min(ended.values()) > 0.1 * number_of_files, ended


@some_and_many
def test_results(tmp_path, number_of_files):
    """Read, made a page of, and compared with the whole file."""
    whole = tmp_path / "whole"
    command = [sys.executable, "-m", "drivers", "run", str(shipped()["sdls119a"]), "--no-plots", "--quiet", "--out", str(whole)]
    done = subprocess.run(command, cwd=ROOT, env=ALONE, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    original, data = read_results(whole), (whole / "results.h5").read_bytes()

    def make(number):
        (tmp_path / "results.h5").write_bytes(damaged(data, generator("results", number)))
        return tmp_path / "results.h5"

    def read(path):
        results = read_results(path)
        with damage_named(path):
            report(results)
            compare(results, original, ("a", "b"))

    ended = outcomes(make, read, number_of_files)
    assert ended["error"] > 0.1 * number_of_files, ended


@some_and_many
def test_bases(tmp_path, sdls119a, comm, number_of_files):
    settings = KrylovSettings(tolerance=1e-2)
    with prepare(sdls119a, comm) as assembly:
        basis = krylov_basis(assembly.operators, settings)
        write_basis(tmp_path / "whole.h5", assembly.operators, basis, settings)
        data = (tmp_path / "whole.h5").read_bytes()

        def make(number):
            (tmp_path / "basis.h5").write_bytes(damaged(data, generator("basis", number)))
            return tmp_path / "basis.h5"

        def read(path):
            again, _ = read_basis(path, assembly.operators)
            assert np.array_equal(again.vectors, basis.vectors)  # else the digest has missed it

        ended = outcomes(make, read, number_of_files)
    assert ended["error"] > 0.1 * number_of_files, ended


def meshes(folder):
    """The mesh of the reference case in the formats that are read: .msh 2 and 4, in text and binary, and .med."""
    from uplift.meshes.export import write_mesh

    plate = read_scene(shipped()["sdls119a"]).plate
    for name in ("four.msh", "five.med"):
        write_mesh(plate, folder / name)
    gmsh.initialize([], False)
    gmsh.option.setNumber("General.Terminal", 0)
    for name, version, binary in (("two.msh", 2.2, 0), ("binary.msh", 4.1, 1)):
        gmsh.open(str(folder / "four.msh"))
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(folder / name))
    gmsh.finalize()
    return [folder / name for name in ("two.msh", "four.msh", "binary.msh", "five.med")]


@some_and_many
def test_meshes(tmp_path, number_of_files):
    (tmp_path / "whole").mkdir()
    whole = meshes(tmp_path / "whole")
    files = list(whole)
    for number in range(number_of_files):
        rng = generator("mesh", number)
        source = rng.choice(whole)
        files.append(tmp_path / f"{number} é{source.suffix}")
        files[-1].write_bytes(mutated(source.read_bytes(), rng))
    environment = ALONE | {"PYTHONPATH": str(ROOT)}
    command, limit = [sys.executable, "-c", CHILD, *map(str, files)], 60 + 10 * len(files)
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=limit)
    lines = done.stdout.splitlines()
    assert done.returncode == 0 and len(lines) == len(files), (files[len(lines)], done.stderr[-500:])
    assert lines[:4] == ["result 32"] * 4
    assert {line.split()[0] for line in lines[4:]} == {"result", "error"}


@some_and_many
def test_joined_plates(number_of_files):
    numbers = [str(number) for number in range(number_of_files)]
    environment = ALONE | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "tests.plate_mutations", *numbers]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60 + 10 * len(numbers))
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0 and len(lines) == len(numbers), (f"mutation {len(lines)}", done.stderr[-1000:])
    for line in lines:
        assert line["kB"] < KILOBYTES and (line.get("result") or len(line["error"].splitlines()) == 1), line
    assert 0.1 * len(lines) < sum("error" in line for line in lines) < 0.9 * len(lines)


def test_folder_is_kept_from_a_second_run(tmp_path):
    from uplift.drivers.results.folder import claimed_folder

    with claimed_folder(tmp_path / "a b é", overwrite=False):
        with pytest.raises(ModelError, match="another run is writing"), claimed_folder(tmp_path / "a b é", overwrite=True):
            pass
        (tmp_path / "a b é" / "summary.json").write_text("{}", encoding="utf-8")
    with pytest.raises(ModelError, match="holds the results of a run"), claimed_folder(tmp_path / "a b é", overwrite=False):
        pass
    with claimed_folder(tmp_path / "a b é", overwrite=True):
        pass
    assert [p.name for p in (tmp_path / "a b é").iterdir()] == ["summary.json"]


def test_second_run_is_refused_unless_it_may_overwrite(tmp_path):
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX", "PRTE"))}
    codes, errors = [], []
    for more in ([], [], ["--overwrite"]):
        command = [sys.executable, "-m", "drivers", "run", str(shipped()["sdls119a"]), "--method", "static", "--no-plots", "--quiet"]
        done = subprocess.run([*command, "--out", str(tmp_path / "out"), *more], cwd=ROOT, env=environment, capture_output=True, text=True)
        codes.append(done.returncode)
        errors.append(done.stderr)
    assert codes == [0, 2, 0], errors
    assert errors[1].count("\n") == 1 and "--overwrite" in errors[1]


def test_a_reader_that_leaves_ends_quietly(tmp_path):
    command = f"{sys.executable} -m drivers schema | head -n 1; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", command], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("# Scene files\n0\n", "")
