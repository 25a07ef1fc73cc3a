"""Bases in files: written whole, read back for the same model only."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.small import marched
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.forms.parameters import GroundMotion
from uplift.meshes.checked import ModelError
from uplift.solvers.bases.krylov import krylov_basis
from uplift.solvers.bases.project import project
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.basis_file import read_basis, write_basis
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.scheme import Scheme

ROOT = Path(__file__).parents[2]
SETTINGS = KrylovSettings(tolerance=1e-3)


def with_model(scene, **changes):
    return replace(scene, model=replace(scene.model, **changes))


def with_support(scene, **changes):
    return with_model(scene, supports=(replace(scene.model.supports[0], **changes),))


@pytest.fixture
def stored(sdls119a, comm, tmp_path):
    path = comm.bcast(tmp_path, root=0) / "basis.h5"
    with prepare(sdls119a, comm) as assembly:
        basis = krylov_basis(assembly.operators, SETTINGS)
        write_basis(path, assembly.operators, basis, SETTINGS)
    return path, basis


@pytest.mark.both
@pytest.mark.ranks
def test_what_is_written_is_read(sdls119a, comm, stored):
    path, basis = stored
    with prepare(sdls119a, comm) as assembly:
        again, settings = read_basis(path, assembly.operators)
    assert settings == SETTINGS
    assert np.array_equal(again.vectors, basis.vectors)
    assert np.array_equal(again.projected.stiffness, basis.projected.stiffness)
    assert again.growth.estimate == basis.growth.estimate
    if comm.rank == 0:
        assert [p.name for p in path.parent.iterdir()] == ["basis.h5"]


@pytest.mark.parametrize("change", [{"gap": 0.002}, {"preload": 1e4}])
def test_another_gap_or_preload_uses_the_same_basis(sdls119a, comm, stored, change):
    """The answers in the basis that was made without them are those of a basis made with them."""
    reached = []
    with prepare(with_support(sdls119a, **change), comm) as assembly:
        for basis in (read_basis(stored[0], assembly.operators)[0], krylov_basis(assembly.operators, KrylovSettings(tolerance=1e-6))):
            model = project(assembly.operators, basis)
            start = static_state(model, exact_uplift=True)
            reached.append(marched(model, Scheme(), 0.01, 300, start, exact_uplift=True).probes)
    assert np.max(np.abs(reached[0] - reached[1])) < 1e-4 * np.max(np.abs(reached[1]))


@pytest.mark.ranks
def test_another_model_is_refused(sdls119a, comm, stored):
    material = sdls119a.model.material
    stiffer = with_model(sdls119a, material=replace(material, young=1.5e8))
    softer = with_support(sdls119a, stiffness=(1e15, 2e8))
    finer = replace(sdls119a, plate=replace(sdls119a.plate, nx=8))
    for scene, words in ((stiffer, "stiffness, mass, damping or contacts differ"), (softer, "another model"), (finer, "dofs instead of")):
        with prepare(scene, comm) as assembly, pytest.raises(ModelError, match=f"basis.h5: .*{words}") as caught:
            read_basis(stored[0], assembly.operators)
        assert "\n" not in str(caught.value)


@pytest.mark.ranks
def test_loads_of_another_direction_are_refused(sdls119a, comm, stored):
    upwards = GroundMotion((0.0, 1.0), sdls119a.model.motions[0].signal)
    scene = with_model(sdls119a, motions=(upwards,), gravity=0.0)
    sideways_too = with_model(sdls119a, gravity=0.0)
    with prepare(sideways_too, comm) as assembly:
        read_basis(stored[0], assembly.operators)
    with prepare(scene, comm) as assembly:  # gravity was in it: the same vector but for its size
        read_basis(stored[0], assembly.operators)
        load = assembly.operators.loads[0]
        load.vector.array[:] *= np.linspace(0.0, 1.0, assembly.operators.n_local)
        with pytest.raises(ModelError, match="static answer to the load 'ground motion' is not in the basis"):
            read_basis(stored[0], assembly.operators)


def test_damaged_and_foreign_files_are_refused(sdls119a, comm, stored, tmp_path):
    path = stored[0]
    whole = path.read_bytes()
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["x"] = np.zeros(3)
    (tmp_path / "text.h5").write_text("no basis", encoding="utf-8")
    for part in (10, len(whole) // 2, len(whole) - 100):
        (tmp_path / f"{part}.h5").write_bytes(whole[:part])
    with prepare(sdls119a, comm) as assembly:
        damaged = ["text", "10", str(len(whole) // 2), str(len(whole) - 100)]
        expected = [("foreign.h5", "not a file of a basis"), ("missing.h5", "there is no such file")]
        for name, words in expected + [(f"{name}.h5", "not a whole file of a basis") for name in damaged]:
            with pytest.raises(ModelError, match=f"{name}: {words}") as caught:
                read_basis(tmp_path / name, assembly.operators)
            assert "\n" not in str(caught.value)


def test_a_file_that_cannot_be_written_leaves_nothing(sdls119a, comm, stored, tmp_path):
    (tmp_path / "in the way").write_text("", encoding="utf-8")
    with prepare(sdls119a, comm) as assembly, pytest.raises(ModelError, match="cannot be written"):
        write_basis(tmp_path / "in the way" / "b.h5", assembly.operators, stored[1], SETTINGS)
    target = tmp_path / "folder.h5"
    target.mkdir()
    (target / "x").write_text("", encoding="utf-8")
    with prepare(sdls119a, comm) as assembly, pytest.raises(ModelError, match="cannot be written"):
        write_basis(target, assembly.operators, stored[1], SETTINGS)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["basis.h5", "folder.h5", "in the way"]


def test_a_changed_byte_is_found(sdls119a, comm, stored, tmp_path):
    whole = stored[0].read_bytes()
    with h5py.File(stored[0], "r") as file:
        begin, length = file["vectors"].id.get_offset(), file["vectors"].id.get_storage_size()
    rng = np.random.default_rng(1)
    with prepare(sdls119a, comm) as assembly:
        for at in [begin, begin + length // 2, begin + length - 1, *rng.integers(0, len(whole), 20)]:
            changed = bytearray(whole)
            changed[at] ^= 0xFF
            (tmp_path / "changed.h5").write_bytes(changed)
            try:
                again, _ = read_basis(tmp_path / "changed.h5", assembly.operators)
            except ModelError as error:
                assert "\n" not in str(error)
            else:  # a byte that means nothing
                assert not begin <= at < begin + length and np.array_equal(again.vectors, stored[1].vectors)


@pytest.mark.parametrize("way", ["huge", "text", "group", "settings", "link", "external"])
def test_foreign_contents_end_in_one_line(sdls119a, comm, stored, tmp_path, way):
    with h5py.File(stored[0], "r+") as file:
        n = file["vectors"].shape[1]
        if way == "settings":
            file.attrs["settings"] = '{"tolerance": "x"}'
        else:
            del file["vectors"]
        if way == "huge":
            file.create_dataset("vectors", (90, n), maxshape=(None, None), chunks=(1, 16), dtype=float)
        elif way == "text":
            file["vectors"] = "text"
        elif way == "group":
            file.create_group("vectors/x")
        elif way == "link":
            file["vectors"] = h5py.ExternalLink("/dev/zero", "vectors")
        elif way == "external":
            file.create_dataset("vectors", (50, n), dtype=float, external=[("/dev/zero", 0, 400 * n)])
    with prepare(sdls119a, comm) as assembly, pytest.raises(ModelError, match="basis.h5: (not a whole file of a basis|damaged)") as caught:
        read_basis(stored[0], assembly.operators)
    assert "\n" not in str(caught.value)


FULL_DISK = """
import resource, sys
from pathlib import Path
from mpi4py import MPI
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.scene.scene import read_scene
from uplift.drivers.scene.shipped import shipped
from uplift.meshes.checked import ModelError
from uplift.solvers.bases.krylov import krylov_basis
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.basis_file import write_basis
settings = KrylovSettings(tolerance=1e-3)
with prepare(read_scene(shipped()["sdls119a"]), MPI.COMM_SELF) as assembly:
    basis = krylov_basis(assembly.operators, settings)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), int(sys.argv[2])))
    try:
        write_basis(Path(sys.argv[1]), assembly.operators, basis, settings)
    except ModelError as error:
        print(error)
"""


@pytest.mark.parametrize("room", [0, 100, 3000, 10_000, 20_000])
def test_a_basis_for_which_there_is_no_room_leaves_nothing(tmp_path, room):
    """A limit of the size of files stands for a full disk."""
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX", "PRTE"))} | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", FULL_DISK, str(tmp_path / "b.h5"), str(room)], env=clean, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "cannot be written: File too large" in done.stdout and len(done.stdout.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
