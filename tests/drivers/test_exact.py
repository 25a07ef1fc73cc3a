"""The method exact as users run it, against the time stepping that it is the limit of."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.report.files import write_run
from uplift.drivers.scene.request import Request
from uplift.meshes.checked import ModelError


@pytest.fixture
def massless(sdls119a):
    return sdls119a.with_("supports.mass", 0.0).with_("transient.start", "static")


def relative(here, there):
    return np.max(np.abs(here - there)) / np.max(np.abs(there))


def test_time_stepping_converges_to_it_with_its_order(massless, comm):
    """The average acceleration is of second order: its distance falls to a quarter when the step is halved."""
    distances, shears = [], []
    for step, every in ((0.005, 4), (0.0025, 8)):
        scene = massless.with_("transient.step", step).with_("transient.every", every)
        with prepare(scene, comm) as assembly:
            exact, stepped = (analyse(assembly, Request(method)).final for method in ("exact", "transient"))
        distances.append(relative(stepped.probes, exact.probes))
        shears.append(relative(stepped.reactions[:, 0], exact.reactions[:, 0]))
    assert distances[1] == pytest.approx(distances[0] / 4, rel=0.3) and distances[0] < 0.01
    # The base shear goes through springs of 1e15 N/m, which hold damping and inertia of the plate as well as loads.
    # It jumps where contacts open and close, at which the stepping is of first order.
    assert shears[1] < 0.6 * shears[0] < 0.012


def test_in_a_basis_it_is_the_same(massless, comm):
    with prepare(massless, comm) as assembly:
        whole, reduced = (analyse(assembly, Request("exact", basis=basis)).final for basis in (None, 1e-9))
    assert relative(reduced.probes, whole.probes) < 1e-7
    assert relative(reduced.reactions, whole.reactions) < 1e-5


def test_events_and_extremes_are_written(massless, comm, tmp_path):
    with prepare(massless, comm) as assembly:
        analysis = analyse(assembly, Request("exact"))
        write_run(assembly, analysis, tmp_path, plots=False)
    with (tmp_path / "events.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["event"] for row in rows if row["contact"] == rows[0]["contact"]][:2] == ["opens", "closes"]
    assert all((float(row["speed [m/s]"]) > 0) == (row["event"] == "opens") for row in rows)
    facts = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["exact"]
    assert facts["events"] == len(rows) and facts["relative_error_in_time"] == 0
    between, probe = facts["extremes_between_instants"]["P3.DX"], analysis.final.probes[:, 0]
    assert between["min"] <= probe.min() and between["min"] == pytest.approx(probe.min(), rel=1e-2)


def test_what_it_cannot_do_is_refused(sdls119a):
    with pytest.raises(ModelError, match="joints without mass"):
        Request("exact").check(sdls119a)
    with pytest.raises(ModelError, match="knows no published passes"):
        Request("exact", 2).check(sdls119a)
    released = replace(sdls119a.with_("supports.mass", 0.0), fourier=None)
    Request("exact").check(released)
