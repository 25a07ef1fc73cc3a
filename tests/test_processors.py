"""The numerics with the kernels that OpenBLAS has for other processors, which add and multiply in other orders."""

import re
from pathlib import Path

import pytest

from tests.process import ROOT, finish, on_workers, start

CORES = {
    "Prescott": {"pni"}, "Haswell": {"avx2", "fma"}, "Zen": {"avx2", "fma"},
    "SkylakeX": {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"},
}
"""Names that OPENBLAS_CORETYPE takes, and what a processor must have, in the words of /proc/cpuinfo, to run their kernels."""

NUMERICS = ["tests/solvers", "tests/forms", "tests/drivers/test_stability.py", "tests/drivers/test_scenes.py"]

flags = re.search(r"^flags\s*: (.*)$", Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE)


def core_of(*arguments, **environment):
    """Run Python, and return how it ended and the kernels that OpenBLAS says it has chosen."""
    done = finish(start(*arguments, seconds=1000, OPENBLAS_VERBOSE="2", **environment))
    return done, set(re.findall(r"^Core: (\w+)$", done.stderr, re.MULTILINE))


@pytest.mark.check
@pytest.mark.parametrize("core", [name for name, needed in CORES.items() if flags and needed <= set(flags[1].split())])
def test_numerics_as_on_another_processor(core, tmp_path):
    _, own = core_of("-c", "import numpy")
    if core in own:
        pytest.skip(f"{core} is this processor's own, with which the other tests run")
    options = ["-q", "--color=no", "-p", "no:cacheprovider", f"--basetemp={tmp_path / 'child'}", "-m", "not check", *on_workers()]
    done, used = core_of("-m", "pytest", *options, *(ROOT / path for path in NUMERICS), OPENBLAS_CORETYPE=core)
    assert used == {core}
    assert done.returncode == 0, done.stdout[-6000:]
