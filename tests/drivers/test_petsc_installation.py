"""Real or complex PETSc in stand-ins for the layouts that are known: what is found, and what a process replaces itself by."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from uplift.drivers import petsc_installation, process
from uplift.drivers.petsc_installation import Installation, installation
from uplift.meshes.checked import ModelError

ROOT = Path(__file__).parents[2]
PYTHON = "python{}.{}".format(*sys.version_info[:2])


class Replaced(BaseException):
    """The process would have been replaced, by `python` with `environment`."""

    def __init__(self, python, environment):
        self.python, self.environment = python, environment


@pytest.fixture
def machine(monkeypatch, tmp_path):
    """A machine without any PETSc, and a function that puts modules where an interpreter would find them."""
    origins = {}
    monkeypatch.setattr(petsc_installation, "_origin", lambda module: origins.get(module, ""))
    monkeypatch.setattr(petsc_installation, "DEBIAN", tmp_path / "usr" / "lib")
    monkeypatch.setattr(petsc_installation, "CONTAINER", tmp_path / "usr" / "local")
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "env"))
    for name in ("PETSC_DIR", "SLEPC_DIR", "PETSC_ARCH", "PYTHONPATH", "LD_LIBRARY_PATH", "UPLIFT_REAL_PYTHON", "UPLIFT_COMPLEX_PYTHON"):
        monkeypatch.delenv(name, raising=False)

    def replaced(python, arguments, environment):
        assert arguments == [python, *sys.orig_argv[1:]]
        raise Replaced(python, environment)

    def place(module, folder):
        (folder / module).mkdir(parents=True, exist_ok=True)
        (folder / module / "__init__.py").touch()
        origins[module] = str(folder / module / "__init__.py")

    monkeypatch.setattr(os, "execvpe", replaced)
    return tmp_path, place


def debian(machine, monkeypatch, petsc, slepc=None, builds=("real", "complex")):
    """Lay out Debian's packages, of which an interpreter would import the builds `petsc` and `slepc` of the two libraries."""
    root, place = machine
    for library, module, chosen in (("petsc", "petsc4py", petsc), ("slepc", "slepc4py", slepc or petsc)):
        for scalars in builds:
            home = root / "usr" / "lib" / f"{library}dir" / f"{library}3.18" / f"x86_64-linux-gnu-{scalars}"
            home.mkdir(parents=True)
            (home.parents[1] / f"{library}-{scalars}").symlink_to(home)
        place(module, root / "usr" / "lib" / f"{library}dir" / f"{library}-{chosen}" / "lib" / "python3" / "dist-packages")


@pytest.mark.parametrize("here", ["real", "complex"])
def test_debian_has_both_builds_side_by_side(here, machine, monkeypatch):
    debian(machine, monkeypatch, here)
    other = "complex" if here == "real" else "real"
    assert installation().scalars == here
    process.choose_scalars(here)
    with pytest.raises(Replaced) as replaced:
        process.choose_scalars(other)
    assert replaced.value.python == sys.executable
    for name, library in (("PETSC_DIR", "petsc"), ("SLEPC_DIR", "slepc")):
        assert replaced.value.environment[name] == str(machine[0] / "usr" / "lib" / f"{library}dir" / f"{library}-{other}")


@pytest.mark.parametrize("wanted", ["real", "complex"])
def test_debian_with_petsc_and_slepc_of_different_builds_is_put_right(wanted, machine, monkeypatch):
    debian(machine, monkeypatch, "complex", "real")
    with pytest.raises(Replaced) as replaced:
        process.choose_scalars(wanted)
    assert {replaced.value.environment[name].rpartition("-")[2] for name in ("PETSC_DIR", "SLEPC_DIR")} == {wanted}


def test_debian_without_the_complex_packages_names_the_one_to_install(machine, monkeypatch):
    debian(machine, monkeypatch, "real", builds=("real",))
    with pytest.raises(ModelError, match="expected the complex build.*apt install python3-dolfinx-complex.*UPLIFT_COMPLEX_PYTHON"):
        process.choose_scalars("complex")


@pytest.mark.parametrize("here", ["real", "complex"])
def test_container_has_both_builds_side_by_side(here, machine, monkeypatch):
    """As dolfinx-real-mode and dolfinx-complex-mode of the image set it."""
    root, place = machine
    other = "complex" if here == "real" else "real"
    folders = {scalars: root / "usr" / "local" / f"dolfinx-{scalars}" for scalars in (here, other)}
    packages = {scalars: folder / "lib" / PYTHON / "dist-packages" for scalars, folder in folders.items()}
    for scalars in (other, here):
        place("dolfinx", packages[scalars])
    place("petsc4py", root / "usr" / "local" / "petsc" / "lib")
    monkeypatch.setenv("PETSC_ARCH", {"real": "linux-gnu-real64-32", "complex": "linux-gnu-complex128-32"}[here])
    monkeypatch.setenv("PYTHONPATH", f"{packages[here]}:/my/own")
    monkeypatch.setenv("LD_LIBRARY_PATH", f"{folders[here] / 'lib'}:/my/lib:")
    process.choose_scalars(here)
    with pytest.raises(Replaced) as replaced:
        process.choose_scalars(other)
    environment = replaced.value.environment
    assert replaced.value.python == sys.executable
    assert environment["PETSC_ARCH"] == {"real": "linux-gnu-real64-32", "complex": "linux-gnu-complex128-32"}[other]
    assert environment["PYTHONPATH"] == f"{packages[other]}:/my/own"
    assert environment["LD_LIBRARY_PATH"] == f"{folders[other] / 'lib'}:/my/lib"


def wheel(machine, scalars):
    root, place = machine
    packages = root / "env" / "lib" / PYTHON / "site-packages"
    place("dolfinx_solver", packages)
    (packages / f"dolfinx_solver_{scalars}-0.11.0.post0.dist-info").mkdir()


def conda(machine, build):
    record = machine[0] / "env" / "conda-meta" / f"petsc-3.21.5-{build}.json"
    record.parent.mkdir(parents=True)
    record.touch()
    (record.parent / "petsc4py-3.21.5-np20py312h1234567_0.json").touch()


LAYOUTS = {
    "wheel": (wheel, "complex", "real", "uplift-fem\\[fenicsx-complex\\]"),
    "conda": (conda, "complex_h89735a0_1", "real_h8cb40c4_101", "conda create -c conda-forge fenics-dolfinx 'petsc=\\*=complex\\*'"),
    "conda with CUDA": (conda, "cuda11_complex_h8aa722a_0", "cuda11_real_h8aa722a_0", "conda create"),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_an_environment_with_one_build_runs_real_methods_in_complex_numbers(layout, machine, caplog):
    lay_out, complex_build, _, _ = LAYOUTS[layout]
    lay_out(machine, complex_build)
    assert installation().scalars == "complex"
    process.choose_scalars("complex")
    assert not caplog.records
    process.choose_scalars("real")
    (record,) = caplog.records
    assert record.finding.key == "scalars" and record.finding.severity == "note"
    assert "UPLIFT_REAL_PYTHON" in record.finding.text


@pytest.mark.parametrize("layout", LAYOUTS)
def test_an_environment_with_the_real_build_alone_says_what_complex_methods_need(layout, machine):
    lay_out, _, real_build, advice = LAYOUTS[layout]
    lay_out(machine, real_build)
    assert installation().scalars == "real"
    process.choose_scalars("real")
    with pytest.raises(ModelError, match=f"^PETSc: expected the complex build.*{advice}.*UPLIFT_COMPLEX_PYTHON"):
        process.choose_scalars("complex")


def test_an_installation_that_is_not_known_is_left_alone(machine):
    assert installation() is None
    process.choose_scalars("real")
    process.choose_scalars("complex")


def interpreter(folder, scalars):
    """Write a program that answers, for an interpreter, which PETSc it has."""
    path = folder / f"python-{scalars or 'broken'}"
    path.write_text(f"#!/bin/sh\necho {scalars}\n" if scalars else "#!/bin/sh\nexit 1\n")
    path.chmod(0o755)
    return str(path)


@pytest.mark.parametrize(("here", "wanted"), [("real", "complex"), ("complex", "real")])
def test_an_interpreter_that_the_user_names_takes_over(here, wanted, machine, monkeypatch):
    wheel(machine, here)
    python = interpreter(machine[0], wanted)
    monkeypatch.setenv(f"UPLIFT_{wanted.upper()}_PYTHON", python)
    process.choose_scalars(here)
    with pytest.raises(Replaced) as replaced:
        process.choose_scalars(wanted)
    assert replaced.value.python == python
    assert f"UPLIFT_{wanted.upper()}_PYTHON" not in replaced.value.environment


@pytest.mark.parametrize(
    ("named", "message"),
    [("real", "expected an interpreter with the complex build"), ("", "cannot import uplift"), (None, "does not start")],
)
def test_a_named_interpreter_that_cannot_take_over_is_refused(named, message, machine, monkeypatch):
    wheel(machine, "real")
    monkeypatch.setenv("UPLIFT_COMPLEX_PYTHON", str(machine[0] / "nowhere") if named is None else interpreter(machine[0], named))
    with pytest.raises(ModelError, match=f"^UPLIFT_COMPLEX_PYTHON: .*{message}"):
        process.choose_scalars("complex")


def test_the_question_to_a_named_interpreter_is_answered_by_this_one(monkeypatch):
    """By the real program, not by a stand-in: it names the PETSc that this process has."""
    from petsc4py import PETSc

    here = "complex" if issubclass(PETSc.ScalarType, complex) else "real"
    monkeypatch.chdir(ROOT)
    process._see_named("UPLIFT_PYTHON", sys.executable, here)
    assert isinstance(installation(), Installation) and installation().scalars == here
    with pytest.raises(ModelError, match="has the other one"):
        process._see_named("UPLIFT_PYTHON", sys.executable, "complex" if here == "real" else "real")


@pytest.mark.parametrize("module", ["dolfinx", "petsc4py", "slepc4py"])
def test_the_wheels_load_mpi_before_what_links_to_it_and_not_sooner(module, tmp_path):
    for name, text in (("dolfinx_solver", "print('mpi')"), (module, f"print('{module}')")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(text)
    program = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import uplift; print('uplift'); import {module}, {module}"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert (done.stdout.split(), done.stderr) == (["uplift", "mpi", module], "")


def test_ranks_are_started_by_the_mpi_of_the_same_environment(monkeypatch):
    assert process.launcher(1) == []
    monkeypatch.setattr(process, "find_spec", lambda name: None)
    assert process.launcher(2)[-3:] == ["--oversubscribe", "-n", "2"]
    monkeypatch.setattr(process, "find_spec", lambda name: name == "dolfinx_solver")
    assert process.launcher(3) == [str(Path(sys.executable).parent / "mpiexec"), "-n", "3"]
