"""Scene, CSV and mesh files with mistakes made at random: each ends in a result or in one line, soon and in little memory.

There are 30 such files, and 300 in the longer tier, or as many as the environment variable UPLIFT_MUTATIONS says; a sixth of them are
meshes. A tenth as many tables of joined plates are meshed, assembled and brought to rest.
"""

import json
import os
import resource
import signal

import gmsh
import pytest

from tests.drivers.test_schema import RECTANGLE
from tests.mutations import generator, mutated
from tests.plate_mutations import KILOBYTES
from tests.process import drivers, finish, start
from uplift.drivers.analysis.memory import expected_bytes
from uplift.drivers.scene.analysis import METHODS
from uplift.drivers.scene.cautions import scene_cautions
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import read_scene
from uplift.drivers.scene.shipped import shipped
from uplift.meshes.checked import ModelError

MANY = int(os.environ.get("UPLIFT_MUTATIONS", "300"))
SECONDS = 10
"""s of processor time that a file may take."""

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
    signal.setitimer(signal.ITIMER_PROF, 60)
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


@some_and_many
def test_scenes_and_tables(tmp_path, number_of_files):
    texts = [path.read_bytes() for path in shipped().values()] + [(RECTANGLE + INPUTS).encode()]
    before = signal.signal(signal.SIGPROF, slow)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    ended = {"result": 0, "error": 0}
    try:
        for number in range(number_of_files - number_of_files // 6):
            rng = generator("scene", number)
            files = CSV | {"scene.toml": rng.choice(texts)}
            if rng.random() < 0.25:
                files["scene.toml"] = texts[-1]
                name = rng.choice(list(CSV))
            else:
                name = "scene.toml"
            files[name] = mutated(files[name], rng)
            for file, data in files.items():
                (tmp_path / file).write_bytes(data)
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            try:
                read_all(tmp_path / "scene.toml")
                ended["result"] += 1
            except ModelError as error:
                assert str(error) and len(str(error).splitlines()) == 1, number
                ended["error"] += 1
            except Exception as error:
                raise AssertionError(f"mutation {number}") from error
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0)
    finally:
        signal.signal(signal.SIGPROF, before)
    assert min(ended.values()) > 0.1 * number_of_files, ended
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak < 500_000  # kB


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
    for number in range(number_of_files // 6):
        rng = generator("mesh", number)
        source = rng.choice(whole)
        files.append(tmp_path / f"{number} é{source.suffix}")
        files[-1].write_bytes(mutated(source.read_bytes(), rng))
    done = finish(start("-c", CHILD, *files, seconds=60 + 10 * len(files)))
    lines = done.stdout.splitlines()
    assert done.returncode == 0 and len(lines) == len(files), (files[len(lines)], done.stderr[-500:])
    assert lines[:4] == ["result 32"] * 4
    ends = {line.split()[0] for line in lines[4:]}
    assert ends == {"result", "error"} if number_of_files > 30 else ends == {"error"}  # the first five are all beyond repair


@some_and_many
def test_joined_plates(number_of_files):
    numbers = range(number_of_files // 10)
    done = finish(start("-m", "tests.plate_mutations", *numbers, seconds=60 + 10 * len(numbers)))
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
    codes, errors = [], []
    for more in ([], [], ["--overwrite"]):
        done = drivers("run", shipped()["sdls119a"], "--method", "static", "--no-plots", "--quiet", "--out", tmp_path / "out", *more)
        codes.append(done.returncode)
        errors.append(done.stderr)
    assert codes == [0, 2, 0], errors
    assert errors[1].count("\n") == 1 and "--overwrite" in errors[1]


def test_a_reader_that_leaves_ends_quietly(tmp_path):
    child = start("-m", "drivers", "schema")
    child.stdout.close()
    done = finish(child)
    assert (done.returncode, done.stderr) == (0, "")
