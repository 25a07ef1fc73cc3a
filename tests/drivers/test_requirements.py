"""What the machine has to bring: where it is missing, one line names it."""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from uplift.drivers import process
from uplift.meshes import compat
from uplift.meshes.checked import ModelError
from uplift.meshes.gmsh_session import gmsh_session

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "drivers" / "scenes" / "sdls119a.toml"

MISSING = {
    "library": ("raise OSError('libGLU.so.1: cannot open shared object file: No such file or directory')", "libGLU.so.1.*libglu1-mesa"),
    "package": ("raise ModuleNotFoundError(\"No module named 'gmsh'\", name='gmsh')", "is not installed.*python3-gmsh.*pip install gmsh"),
}


@pytest.mark.parametrize("what", MISSING)
def test_gmsh_that_cannot_be_loaded_is_named(what, tmp_path, monkeypatch):
    text, message = MISSING[what]
    (tmp_path / "gmsh.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "gmsh", raising=False)
    with pytest.raises(ModelError, match=f"^gmsh: .*{message}"), gmsh_session():
        pass


def test_a_run_without_a_system_library_of_gmsh_ends_in_one_line(tmp_path):
    (tmp_path / "gmsh.py").write_text(MISSING["library"][0])
    program = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); from uplift.drivers.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", program, "run", str(SCENE), "--out", str(tmp_path / "out"), "--quiet"]
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX", "PRTE"))}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2 and "libGLU.so.1" in line and "apt install" in line


@pytest.mark.parametrize("error", [OSError("read-only"), RuntimeError("failed on rank 0"), LookupError("CompileError: 'gcc'")])
def test_a_compiler_that_is_missing_is_named(error, comm, monkeypatch):
    """The libraries raise one or another error; with a compiler there it is theirs, without one it is the compiler's."""
    def fails(form, folder=None):
        raise error

    monkeypatch.setattr(compat, "compile_form", fails)
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(type(error)):
        process.form_compiler(comm)(None)
    monkeypatch.setenv("CC", "nowhere-cc -O2")
    with pytest.raises(ModelError, match="^C compiler: nowhere-cc is not there.*apt install gcc"):
        process.form_compiler(comm)(None)
    monkeypatch.delenv("CC")
    monkeypatch.setattr(sysconfig, "get_config_var", lambda name: {"CC": "elsewhere-cc -pthread"}[name])
    with pytest.raises(ModelError, match="elsewhere-cc"):
        process.form_compiler(comm)(None)
