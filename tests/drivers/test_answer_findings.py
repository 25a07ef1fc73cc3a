"""What the histories of a run show is said: on histories made by hand, and once by a run."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from uplift.drivers.analysis.answer_findings import at_the_end, in_flight, of_energy, of_passes
from uplift.drivers.results.hdf5 import read_results
from uplift.meshes.findings import KINDS, SEVERITIES, table
from uplift.solvers.contact.published_passes import Passes
from uplift.solvers.history import Ledger

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "drivers" / "scenes" / "sdls119a.toml"


@pytest.mark.parametrize(
    ("passes", "severity", "words"),
    [
        (Passes(number=2, pull=[0.5, 0.26]), "doubt", "2 published pass.* pull with 26 %"),
        (Passes(number=2, pull=[0.5, 1e-4]), "", ""),
        (Passes(number=9, pull=[0.5], ended="diverged"), "grave", "diverge"),
        (Passes(number=9, pull=[0.5], ended="not converged"), "grave", "not converged"),
        (Passes(number=9, pull=[1e-9], ended="converged"), "", ""),
    ],
)
def test_passes(passes, severity, words):
    found = list(of_passes(passes))
    assert [one.severity for one in found] == [severity] * bool(severity)
    if found:
        assert re.search(words, found[0].text)


def test_growth_to_the_end():
    grown = np.linspace(0, 1, 100) ** 2
    assert "longer duration" in next(at_the_end(grown)).text
    assert not list(at_the_end(grown[::-1])) and not list(at_the_end(grown[:10])) and not list(at_the_end(np.zeros(100)))


def test_flight():
    gap = np.zeros((50, 3))
    gap[30] = 1e-3
    gap[40, :2] = 1.0
    (found,) = in_flight(0.1 * np.arange(50), gap)
    assert "at 1 archived instant(s), first at t = 3 s" in found.text


@pytest.mark.parametrize(("lost", "words"), [(0.5, "takes away 5.0% of"), (-0.5, "makes 5.0% of"), (-30.0, "makes 3 times"), (0.1, "")])
def test_energy_of_the_scheme(lost, words):
    """Loads put in 10 J, of which 9 J move the plate and `lost` J are neither there nor damped."""
    rise = np.linspace(0, 1, 11)
    ledger = Ledger(9.0 * rise, 0 * rise, 0 * rise, (1.0 - lost) * rise, 10.0 * rise)
    for impacts in (0, 2):
        found = list(of_energy(ledger, impacts))
        assert [one.severity for one in found] == (["grave" if lost < -10 else "doubt"] if words else [])
        if found:
            assert words in found[0].text and ("at 2 impacts" in found[0].text) == bool(impacts and lost < 0)


def run(out, *more):
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX", "PRTE"))}
    command = [sys.executable, "-m", "drivers", "run", str(SCENE), "--no-plots", "--out", str(out), *more]
    return subprocess.run(command, cwd=ROOT, env=clean, capture_output=True, text=True, timeout=240)


def test_one_list_everywhere(tmp_path):
    done = run(tmp_path / "out", "--iterations", "2", "--quiet")
    said = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["findings"]
    assert done.returncode == 0 and "tension left" in [one["key"] for one in said]
    assert read_results(tmp_path / "out").facts["findings"] == said
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for one in said:
        assert f"{one['severity']}: {one['text']}" in done.stderr.splitlines() and one["text"][1:] in page


def test_strict_ends_with_exit_code_1_where_a_finding_is_grave(tmp_path):
    assert run(tmp_path / "doubt", "--iterations", "2", "--strict").returncode == 0
    patched = (
        "import sys; from uplift.drivers.analysis import answer_findings as a; from uplift.meshes.findings import finding; "
        "a.at_the_end = lambda size: iter([finding('passes without end', 'endless')]); "
        "from uplift.drivers.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    for more, code in (([], 0), (["--strict"], 1)):
        out = tmp_path / f"grave {code}"
        clean = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX", "PRTE"))}
        command = [sys.executable, "-c", patched, "run", str(SCENE), "--no-plots", "--out", str(out), *more]
        done = subprocess.run(command, cwd=ROOT, env=clean, capture_output=True, text=True, timeout=240)
        assert done.returncode == code and (out / "results.h5").is_file(), done.stderr
        assert ("1 grave finding, and --strict is given: endless" in done.stderr) == bool(code)


def test_the_guide_lists_every_finding():
    assert table() in (ROOT / "docs" / "guide.md").read_text(encoding="utf-8")
    assert {kind.severity for kind in KINDS.values()} <= set(SEVERITIES)
