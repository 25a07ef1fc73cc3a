"""The package as an installer puts it in place: the command `uplift`, called from a folder that is no checkout."""

import importlib.util
import shutil
import sys
import tomllib
from pathlib import Path

import pytest

from tests.process import ROOT, finish, launch

pytestmark = pytest.mark.check

ROOMS = ("meshes", "forms", "solvers", "drivers")
NEEDED = ("ensurepip", "setuptools", "wheel")


def run(*command, cwd):
    """Run a command that shall not find the checkout."""
    return finish(launch([*map(str, command)], cwd=cwd, PYTHONPATH=""))


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    """The folder of programs of a virtual environment with the package installed, built without a network."""
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        pytest.skip(f"a package is built and installed with {', '.join(missing)}, which this Python does not have")
    folder = tmp_path_factory.mktemp("installed")
    for room in ROOMS:
        shutil.copytree(ROOT / room, folder / "source" / room, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "uplift.py", "LICENSE", "README.md"):
        shutil.copy(ROOT / name, folder / "source")
    done = run(sys.executable, "-m", "venv", "--system-site-packages", folder / "venv", cwd=folder)
    assert done.returncode == 0, done.stderr
    programs = folder / "venv" / "bin"
    options = ("--no-deps", "--no-build-isolation", "--no-index", "--quiet")
    done = run(programs / "python", "-m", "pip", "install", *options, folder / "source", cwd=folder)
    assert done.returncode == 0, done.stderr
    return programs


def test_a_scene_of_ones_own_from_an_empty_folder(programs, tmp_path):
    uplift = programs / "uplift"
    assert run(uplift, "--help", cwd=tmp_path).stdout.startswith("usage: uplift [-h] COMMAND")
    assert run(uplift, "new", "demo", cwd=tmp_path).stdout.endswith("next: uplift check demo.toml\n")
    done = run(uplift, "check", "demo.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for method, more in (("transient", "energy.csv"), ("time-frequency", None)):  # the latter starts itself again with complex PETSc
        done = run(uplift, "run", "demo.toml", "--method", method, "--no-plots", "--quiet", cwd=tmp_path)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
        names = ["contacts.csv", "deformed.med", "deformed.vtu", "film.xdmf", "history.csv", "reactions.csv", "report.html", "results.h5"]
        out = tmp_path / "results" / "demo" / method
        assert sorted(path.name for path in out.iterdir()) == sorted([*names, "summary.json", *([more] if more else [])])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["demo.toml", "results"]


@pytest.mark.parametrize("command", ["benchmarks", "stability", "survey", "cost", "scale", "pareto"])
def test_evidence_belongs_to_a_checkout(programs, tmp_path, command):
    (tmp_path / "docs").mkdir()
    done = run(programs / "uplift", command, "--quick", cwd=tmp_path)
    words = f"the evidence is not installed; in a checkout of the source run: python3 -m drivers {command} --quick"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"uplift: {words}\n")
    assert not list((tmp_path / "docs").iterdir())


def test_published_values_are_compared_where_it_is_installed(programs, tmp_path):
    done = run(programs / "uplift", "verify", "--no-plots", cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_the_import_alone_loads_nothing_heavy(programs, tmp_path):
    script = "import sys, uplift; print([m for m in ('numpy', 'scipy', 'mpi4py', 'petsc4py', 'dolfinx', 'gmsh') if m in sys.modules])"
    done = run(programs / "python", "-c", script, cwd=tmp_path)
    assert done.stdout == "[]\n", done.stderr


def test_every_name_of_the_face_is_installed(programs, tmp_path):
    done = run(programs / "python", "-c", "import uplift; print(all(getattr(uplift, name) for name in uplift.__all__))", cwd=tmp_path)
    assert done.stdout == "True\n", done.stderr


def test_every_package_but_the_evidence_is_installed():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    folders = {path.parent.relative_to(ROOT) for room in ROOMS for path in (ROOT / room).rglob("__init__.py")}
    evidence = Path("drivers/evidence")
    wanted = {".".join(("uplift", *folder.parts)) for folder in folders if evidence not in folder.parents}
    assert sorted(settings["packages"]) == sorted(wanted)
