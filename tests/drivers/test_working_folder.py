"""Nothing in the current folder changes or runs anything, and nobody else fills the form cache."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from uplift.drivers.analysis.form_cache import see_trusted
from uplift.meshes.checked import ModelError

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "drivers" / "scenes" / "sdls119a.toml"


def test_option_files_of_the_current_folder_are_not_read(tmp_path):
    here = tmp_path / "here"
    here.mkdir()
    stolen = {"cache_dir": str(tmp_path / "stolen"), "cffi_extra_compile_args": ["-no-such-option"], "scalar_type": "float"}
    for name in ("dolfinx_jit_parameters", "dolfinx_jit_options", "ffcx_parameters", "ffcx_options"):
        (here / f"{name}.json").write_text(json.dumps(stolen), encoding="utf-8")
    for name in (".petscrc", "petscrc"):
        (here / name).write_text(f"-info {tmp_path / 'told'}\n", encoding="utf-8")
    (here / "matplotlibrc").write_text("text.usetex: True\n", encoding="utf-8")
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX", "PRTE"))} | {"PYTHONPATH": str(ROOT)}
    clean["XDG_CACHE_HOME"] = str(tmp_path / "cache")  # an empty one, so that forms are compiled
    command = [sys.executable, "-m", "drivers", "run", str(SCENE), "--method", "static", "--out", str(tmp_path / "out"), "--quiet"]
    done = subprocess.run(command, cwd=here, env=clean, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0 and "drawn" not in done.stderr, done.stderr
    assert (tmp_path / "out" / "deformed.png").is_file() and list((tmp_path / "cache" / "fenics").glob("*.so"))
    assert not (tmp_path / "stolen").exists() and not list(tmp_path.glob("told*"))


@pytest.mark.parametrize(("mode", "words"), [(0o777, "can be written"), (0o1777, "can be written"), (0o755, ""), (0o775, "")])
def test_a_cache_that_others_can_write_is_refused(tmp_path, mode, words):
    folder = tmp_path / "fenics"
    folder.mkdir()
    os.chown(folder, os.geteuid(), os.getegid())
    folder.chmod(mode)
    if words:
        with pytest.raises(ModelError, match=f"{words} by others, and what lies there is run"):
            see_trusted(folder)
    else:
        see_trusted(folder)


def test_a_library_that_others_can_write_is_refused(tmp_path):
    see_trusted(tmp_path / "none")
    (tmp_path / "libffcx_a.so").write_text("", encoding="utf-8")
    see_trusted(tmp_path)
    (tmp_path / "libffcx_a.so").chmod(0o666)
    with pytest.raises(ModelError, match="libffcx_a.so can be written by others"):
        see_trusted(tmp_path)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_a_cache_of_another_user_is_refused(tmp_path):
    (tmp_path / "fenics").mkdir(mode=0o755)
    os.chown(tmp_path / "fenics", 12345, 12345)
    with pytest.raises(ModelError, match="belongs to the user 12345"):
        see_trusted(tmp_path / "fenics")
