"""Envelopes over time of the section forces all over a plate."""

import tomllib
from contextlib import nullcontext
from pathlib import Path

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from tests.drivers.test_internal_forces import SLAB
from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.analysis.basis import basis_of
from uplift.drivers.analysis.envelopes import Envelopes
from uplift.drivers.analysis.snapshots import Snapshots
from uplift.drivers.report.files import write_run
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene
from uplift.solvers.bases.project import project
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.state import Instants


def slab(**sections):
    return build_scene({**tomllib.loads(SLAB), **sections}, Path("."))


@pytest.mark.ranks
@pytest.mark.parametrize("request_", [Request("transient"), Request("modal"), Request("transient", 1), Request("static"), Request("exact")])
def test_envelopes_are_the_extremes_of_all_instants(comm, request_):
    """Against the section forces at every instant from the film of displacements, each place by itself."""
    with prepare(slab(output={"envelopes": True}), comm) as assembly:
        shown = {}

        class Film(Snapshots):
            def start(self, instants, *, costly=False):
                super().start(instants, costly=costly)
                self.rows = np.arange(instants)

            def watch(self, row, values):
                shown[row] = np.array(values)

        analysis = analyse(assembly, request_, Film(assembly))
        field = assembly.plate.forces.field
        seen = np.array([field.rows @ field.known(shown[row]) for row in sorted(shown)])
        times = analysis.final.times
        assert len(seen) == len(times)
        parts = comm.gather((field.places, seen.reshape(len(times), len(field.places), -1)))
        found = analysis.envelopes
    if comm.rank:
        assert found is None
        return
    for places, values in parts:
        at = [int(np.argmin(np.linalg.norm(found.places - place, axis=1))) for place in places]
        assert found.places[at] == pytest.approx(places, abs=1e-12)
        size = np.max(np.abs(values), axis=(0, 1))
        # In a basis a block of products rounds otherwise than one by one.
        assert np.all(np.abs(found.least[at] - values.min(axis=0)) <= 1e-11 * size)
        assert np.all(np.abs(found.largest[at] - values.max(axis=0)) <= 1e-11 * size)
        rows = np.searchsorted(times, found.t_largest[at] - 1e-9)
        reached = np.take_along_axis(values, rows[None], axis=0)[0]
        assert np.all(np.abs(reached - values.max(axis=0)) <= 1e-11 * size)


@pytest.mark.ranks
def test_envelopes_are_written_with_places_and_units(comm, tmp_path):
    with prepare(slab(output={"envelopes": True}), comm) as assembly:
        write_run(assembly, analyse(assembly, Request("transient")), tmp_path, plots=False)
    if comm.rank:
        return
    with h5py.File(tmp_path / "results.h5") as file:
        assert set(file["envelopes"]) == {"places", "M11", "M22", "M12", "V1", "V2"}
        assert file["envelopes/M11/max"].attrs["unit"] == "N m/m" and file["envelopes/V1/t_min"].attrs["unit"] == "s"
        assert file["envelopes/places"].shape == (4 * 3 * 4, 3)
        middle = np.argmin(np.linalg.norm(file["envelopes/places"][()] - [2.0, 1.5, 0.0], axis=1))
        names = list(file["forces/moment"].attrs["names"])
        # The nearest Gauss point, half a cell away, beside the probe in the middle.
        probe = file["forces/moment"][:, names.index("MID.M11")]
        assert file["envelopes/M11/min"][middle] == pytest.approx(probe.min(), rel=0.1)
        assert file["envelopes/M11/t_min"][middle] == file["times"][np.argmin(probe)]


@pytest.mark.complex
def test_envelopes_of_the_sweep_are_those_of_the_march(comm):
    with prepare(slab(output={"envelopes": True}), comm) as assembly:
        exact = analyse(assembly, Request("transient")).envelopes
        swept = analyse(assembly, Request("time-frequency")).envelopes
    assert swept.largest == pytest.approx(exact.largest, abs=1e-7 * np.max(np.abs(exact.largest)))
    assert swept.least == pytest.approx(exact.least, abs=1e-7 * np.max(np.abs(exact.least)))


@pytest.mark.ranks
@pytest.mark.parametrize("reduced", [False, True])
def test_envelopes_go_on_from_what_a_checkpoint_keeps(comm, reduced):
    with prepare(slab(output={"envelopes": True}), comm) as assembly:
        operators = assembly.operators
        with project(operators, basis_of(assembly, 1e-6, None)[0]) if reduced else nullcontext(operators) as model:
            field, times = assembly.plate.forces.field, np.arange(3.0)
            rng = np.random.default_rng(1 if reduced else comm.rank)
            states = rng.normal(size=(3, model.n_local))

            def shown(envelopes, rows):
                for row in rows:
                    nothing = np.zeros((1, 0))
                    envelopes.observe(Instants(row, states[row : row + 1], nothing, nothing, nothing, nothing))
                return envelopes

            whole = shown(Envelopes(field, model, times, 1), range(3)).finished()
            begun = shown(Envelopes(field, model, times, 1), range(2))
            resumed = Envelopes(field, model, times, 1)
            resumed.restore(begun.kept())
            again = shown(resumed, [2]).finished()
    if comm.rank:
        return
    for name in ("least", "largest", "t_least", "t_largest"):
        assert np.array_equal(getattr(whole, name), getattr(again, name))


@pytest.mark.ranks
def test_envelopes_go_on_on_another_number_of_ranks(comm):
    """What all ranks keep, one rank goes on with."""
    kept = []
    for world in (comm, MPI.COMM_SELF):
        with prepare(slab(output={"envelopes": True}), world) as assembly, static_state(assembly.operators) as state:
            begun = Envelopes(assembly.plate.forces.field, assembly.operators, np.arange(2.0), 1)
            begun.take(1, np.real(state.displacement.array_r))
            kept.append(begun.kept())
            resumed = Envelopes(assembly.plate.forces.field, assembly.operators, np.arange(2.0), 1)
            resumed.restore(kept[0])
            found = resumed.finished()
    assert found is not None and np.all(found.t_largest == 1.0)
    size = np.max(np.abs(kept[1].same["extremes"][:2]))
    assert kept[0].same["extremes"] == pytest.approx(kept[1].same["extremes"], abs=1e-11 * size)
