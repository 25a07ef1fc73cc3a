import numpy as np
import pytest

from tests.conftest import COMPLEX
from uplift.solvers.memory import Size, available_bytes, march_bytes, peak_bytes, run_bytes, size_of

pytestmark = pytest.mark.both

# Entries of MUMPS' factor of plates of four-node cells (INFOG(29)), from 16 x 32 to 256 x 512 cells.
FACTORS = {4300: 204_987, 16780: 982_854, 66316: 4_977_475, 263692: 23_870_239}


@pytest.mark.parametrize("n", FACTORS)
def test_fill_of_a_plate(n):
    assert Size(n, 18 * n, False).factor / 13.5 == pytest.approx(FACTORS[n], rel=0.05)


@pytest.mark.ranks
def test_size_and_estimate_of_this_very_process(assembly, comm):
    size = size_of(assembly.operators.stiffness)
    assert size.n == 100 and size.is_complex == COMPLEX
    assert size.entries == sum(comm.allgather(int(assembly.operators.stiffness.getValuesCSR()[0][-1])))
    largest, whole = peak_bytes(comm)
    assert 5e7 < largest <= whole <= comm.size * largest
    assert run_bytes(size, march_bytes(size, 5, 1000), comm.size) < 1.1 * comm.size * 2e8


def machine(folder, available, groups=(), *, path="0::/a/b"):
    """A root directory with /proc and /sys of a machine; groups are (folder, file -> text)."""
    (folder / "proc" / "self").mkdir(parents=True)
    (folder / "proc" / "meminfo").write_text(f"MemTotal: 64 kB\nMemAvailable: {available} kB\n", encoding="ascii")
    (folder / "proc" / "self" / "cgroup").write_text(f"{path}\n", encoding="ascii")
    for name, files in groups:
        group = folder / "sys" / "fs" / "cgroup" / name
        group.mkdir(parents=True, exist_ok=True)
        for file, text in files.items():
            (group / file).write_text(f"{text}\n", encoding="ascii")
    return folder


def version_2(limit, used, cached=0):
    return {"memory.max": limit, "memory.current": used, "memory.stat": f"anon 7\ninactive_file {cached}"}


def test_available_memory_respects_control_groups(tmp_path):
    assert available_bytes(tmp_path / "nowhere") == np.inf
    assert available_bytes(machine(tmp_path / "1", 32)) == 32 * 1024
    inner = [("a/b", version_2("max", 5)), ("a", version_2(20_000, 5_000, 1_000))]
    assert available_bytes(machine(tmp_path / "2", 32, inner)) == 16_000
    assert available_bytes(machine(tmp_path / "3", 1, inner)) == 1024
    old = {"memory.limit_in_bytes": 9_000, "memory.usage_in_bytes": 2_000, "memory.stat": "inactive_file 1\ntotal_inactive_file 500"}
    assert available_bytes(machine(tmp_path / "4", 32, [("memory/c", old)], path="5:cpu,memory:/c")) == 7_500
    assert available_bytes() > 1e7


def test_a_run_that_cannot_fit_is_refused(sdls119a, comm):
    from dataclasses import replace

    from uplift.drivers.analysis.memory import check_memory, expected_size
    from uplift.drivers.scene.request import Request
    from uplift.meshes.checked import ModelError

    request = Request("transient")
    assert expected_size(sdls119a, is_complex=False).n == 100
    need = check_memory(sdls119a, request, comm, groups=None, limit=1e9)
    assert need < 3e8
    large = replace(sdls119a, plate=replace(sdls119a.plate, nx=4000, ny=8000))
    with pytest.raises(ModelError, match=r"--memory: the run will need some .* GiB on a machine that may give 0.931 GiB"):
        check_memory(large, request, comm, groups=None, limit=1e9)
    assert check_memory(large, request, comm, groups=None, limit=1e13) > 1e11
