"""Resultants of cuts: equilibrium of what lies on one side, by every method, and closed forms."""

from pathlib import Path

import numpy as np
import pytest

from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.analysis.basis import basis_of
from uplift.drivers.results.internal_forces import columns_of
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene
from uplift.forms.contact.rigid_motions import rigid_value
from uplift.forms.contact.supports import AXES
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import geometry_cells
from uplift.solvers.bases.project import project
from uplift.solvers.frequency_domain.laplace import laplace_run
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import stepper_of, transient
from uplift.solvers.time_domain.scheme import Scheme

CONCRETE = {"young": 3e10, "poisson": 0.2, "density": 2500.0}
POINT = np.array([1.0, 2.0, 0.5])


def building(seed=3):
    """A raft with two walls that cross and a roof, on a bed that cannot pull, of sizes drawn at random and two damping ratios."""
    rng = np.random.default_rng(seed)
    a, b, h = rng.uniform(5, 7), rng.uniform(4, 5), rng.uniform(2.5, 3.5)
    x, y = rng.uniform(0.3, 0.6) * a, rng.uniform(0.3, 0.6) * b
    plates = {"RAFT": [[0, 0, 0], [a, 0, 0], [a, b, 0], [0, b, 0]], "ROOF": [[0, 0, h], [a, 0, h], [a, b, h], [0, b, h]],
              "WALL": [[0, y, 0], [a, y, 0], [a, y, h], [0, y, h]], "CROSS": [[x, 0, 0], [x, b, 0], [x, b, h], [x, 0, h]]}
    shakes = [{"direction": axis, "signal": "ricker", "amplitude": float(rng.uniform(2, 5)), "frequency": 4.0, "center": 0.1}
              for axis in ("X", "Y", "Z")]
    return {
        "mesh": {"size": 2.2, "plates": [{"name": name, "corners": corners} for name, corners in plates.items()]},
        "plate": {**CONCRETE, "thickness": 0.3, "alpha": 2e-3, "beta": 0.7},
        "parts": [{"group": "RAFT", **CONCRETE, "thickness": 0.8, "alpha": 5e-3, "beta": 0.2}],
        "gravity": {"acceleration": 9.81},
        "load": [*shakes, {"kind": "force", "name": "CRANE", "points": [[a, b, h]], "force": {"Y": 3e4}, "signal": "step", "amplitude": 1.0,
                           "rise": 0.05}],
        "masses": [{"name": "PLANT", "points": [[0, 0, h]], "mass": 5000.0}],
        "supports": [{"name": "BED", "grid": {"from": [0, 0], "to": [a, b], "count": [3, 3]}, "unilateral": "Z",
                      "stiffness": {"X": 2e7, "Y": 2e7, "Z": 2e7}, "contact": {"X": 1e12, "Y": 1e12, "Z": 1e12}}],
        "probes": [{"name": "TOP", "point": [a, b, h]}],
        "cuts": [{"name": "STOREY", "plane": {"point": [0, 0, 0.4 * h], "normal": [0.0, 0.0, -1.0]}, "point": POINT.tolist()},
                 {"name": "FOOT", "group": "WALL.1", "side": "WALL", "point": POINT.tolist()}],
        "transient": {"step": 0.01, "duration": 0.3, "start": "static"},
    }


def side_motions(assembly):
    """The six rigid motions (6, n_local) of all nodes above the cut STOREY and on it, written down from the coordinates of the nodes."""
    plate = assembly.plate
    space, numbering = plate.space, plate.numbering
    cells = assembly.tagged.mesh.topology.index_map(2).size_local
    cut = assembly.scene.model.cuts[0].plane
    at = space.tabulate_dof_coordinates()
    geometry, ends = assembly.tagged.mesh.geometry, geometry_cells(assembly.tagged.mesh)
    nodes = set()
    for cell in range(cells):
        corners = geometry.x[ends[cell]]
        if (corners.mean(axis=0) - cut.point) @ cut.normal < 0:
            nodes |= set(space.dofmap.cell_dofs(cell).tolist())
    motions = np.zeros((6, numbering.n_local))
    block = len(plate.components)
    for node in nodes:
        for column, name in enumerate(plate.components):
            row = numbering.local_row[block * node + column]
            for motion in range(6):
                motions[motion, row] = rigid_value(at[node], AXES.index(name[1:]), motion, POINT)
    return motions


class Kept:
    """Steps as another stepper does and keeps displacement, velocity and acceleration of all instants."""

    def __init__(self, stepper):
        self._stepper, self.states = stepper, []

    def __getattr__(self, name):
        return getattr(self._stepper, name)

    def _noted(self, instants):
        states = (instants.displacement, instants.velocity, instants.acceleration)
        self.states += [tuple(np.array(values[k]) for values in states) for k in range(len(instants.displacement))]
        return instants

    def begin(self, start, drive):
        return self._noted(self._stepper.begin(start, drive))

    def advance(self, drive, first, last):
        return self._noted(self._stepper.advance(drive, first, last))


def demand(assembly, states, times):
    """What equilibrium asks of the cut at each instant (nt, 6): inertia and mass damping of the side less its loads."""
    operators, materials = assembly.operators, assembly.scene.model
    motions = side_motions(assembly)
    beta = materials.material.beta  # above the cut every cell is of the plate; point masses are not damped
    plant = next(at for at in materials.masses)
    work = operators.new_vector()
    found = np.zeros((len(times), 6))
    values = np.stack([load.history(times) for load in operators.loads], axis=1)
    for n, (_, v, a) in enumerate(states):
        work.array[:] = a + beta * v
        forces = operators.new_vector()
        operators.mass.mult(work, forces)
        total = np.real(forces.array_r).copy()
        for value, load in zip(values[n], operators.loads, strict=True):
            total -= value * np.real(load.vector.array_r)
        found[n] = motions @ total
        found[n] -= beta * point_mass(assembly, plant, v)
        forces.destroy()
    work.destroy()
    return found


def point_mass(assembly, masses, v):
    """Impulse (6,) of the point masses above the cut."""
    plate = assembly.plate
    total = np.zeros(6)
    at = plate.space.tabulate_dof_coordinates()
    for point in masses.points:
        node = int(np.argmin(np.linalg.norm(at - np.array(point), axis=1)))
        for column, name in enumerate(plate.components):
            axis = AXES.index(name[1:])
            if axis < 3:
                row = plate.numbering.local_row[len(plate.components) * node + column]
                total += [masses.mass * v[row] * rigid_value(at[node], axis, motion, POINT) for motion in range(6)]
    return total


def closes(found, needed):
    """Relative to the largest force or moment: round-off of a stiffness that carries the whole weight."""
    for part in (slice(0, 3), slice(3, 6)):
        assert found[:, part] == pytest.approx(needed[:, part], abs=1e-9 * np.max(np.abs(needed[:, part])))


@pytest.mark.parametrize("scheme", [Scheme(), Scheme(0.3025, 0.6)])
def test_what_stands_on_a_cut_is_in_equilibrium_at_every_instant(comm, scheme):
    with prepare(build_scene(building(), Path(".")), comm) as assembly:
        operators = assembly.operators
        with static_state(operators, exact_uplift=True) as start, stepper_of(operators, scheme, 0.01, exact_uplift=True) as stepper:
            kept = Kept(stepper)
            history = transient(kept, start, 30)
        needed = demand(assembly, kept.states, history.times)
        found = history.group("cuts") + history.group("cuts damping")
        assert np.max(history.release) > 0  # it lifts off
        assert np.max(np.abs(history.group("cuts damping")[:, :3])) > 1e-3 * np.max(np.abs(needed[:, :3]))
        closes(found[:, :6], needed)


def test_cuts_in_a_basis_are_those_of_its_displacements(comm):
    """The forces are those of the displacements that the basis has; they balance its inertia as far as it goes, here to 1e-6."""
    with prepare(build_scene(building(), Path(".")), comm) as assembly:
        operators = assembly.operators
        basis, _ = basis_of(assembly, 1e-8, None)
        with project(operators, basis) as reduced:
            with static_state(reduced, exact_uplift=True) as start, stepper_of(reduced, Scheme(), 0.01, exact_uplift=True) as stepper:
                kept = Kept(stepper)
                history = transient(kept, start, 30)
            with static_state(reduced, exact_uplift=True) as start:
                swept = laplace_run(reduced, Scheme(), 0.01, 30, start).history
            outputs = operators.outputs
            whole = [tuple(reduced.reconstruct(part) for part in state) for state in kept.states]
        expected = np.array([outputs["cuts"].local @ u for u, _, _ in whole])
        damped = np.array([outputs["cuts damping"].per_velocity @ v for _, v, _ in whole])
        closes(history.group("cuts")[:, :6], expected[:, :6])
        closes(history.group("cuts damping")[:, :6], damped[:, :6])
        # What wraps around the circle and the round-off that its scaling enlarges are eps^(2/3), and moduli of 1e13 stand beside it.
        size = np.max(np.abs(expected[:, :3]))
        assert swept.group("cuts")[:, :3] == pytest.approx(history.group("cuts")[:, :3], abs=1e-7 * size)
        assert swept.group("cuts damping")[:, :3] == pytest.approx(history.group("cuts damping")[:, :3], abs=1e-7 * size)
        needed = demand(assembly, whole, history.times)
        found = (history.group("cuts") + history.group("cuts damping"))[:, :6]
        assert found[:, :3] == pytest.approx(needed[:, :3], abs=1e-5 * np.max(np.abs(needed[:, :3])))


def results(comm, **scene):
    with prepare(build_scene(scene, Path(".")), comm) as assembly:
        history = analyse(assembly, Request("static")).final
        return {column.name: float(column.values[0]) for column in columns_of(assembly.plate.forces, history)["cuts"]}


WALL = {"mesh": {"width": 4.0, "height": 6.0, "nx": 4, "ny": 6}, "plate": {**CONCRETE, "thickness": 0.2},
        "conditions": [{"group": "DBAS", "zero": ["DX", "DY"]}], "probes": [{"name": "P", "point": [0.0, 6.0]}]}


@pytest.mark.parametrize("degree", [1, 2])
def test_shear_wall_by_hand(comm, degree):
    """10 kN/m sideways and 30 kN/m down along the top of a wall of 4 m: at any height the same shear, a moment of H times the lever."""
    load = [{"kind": "force", "group": "DHAU", "per": "length", "force": {"X": 1e4, "Y": -3e4}}]
    cuts = [{"name": "C", "plane": {"point": [0.0, 2.0], "normal": [0.0, -1.0]}, "point": [2.0, 2.0]},
            {"name": "D", "plane": {"point": [0.0, 4.0], "normal": [0.0, 1.0]}, "point": [2.0, 4.0]}]
    found = results(comm, **{**WALL, "mesh": {**WALL["mesh"], "degree": degree}}, load=load, cuts=cuts)
    # C: what holds the part above; D: what acts upon the part below.
    upper = {"FX": -4e4, "FY": 12e4, "FZ": 0.0, "MX": 0.0, "MY": 0.0, "MZ": 4e4 * 4.0, "N": -12e4, "V": 4e4}
    lower = {"FX": 4e4, "FY": -12e4, "FZ": 0.0, "MX": 0.0, "MY": 0.0, "MZ": -4e4 * 2.0, "N": -12e4, "V": 4e4}
    for cut, expected in (("C", upper), ("D", lower)):
        for name, value in expected.items():
            assert found[f"{cut}.{name}"] == pytest.approx(value, abs=1e-9 * 16e4), (cut, name)


def test_weight_on_the_line_belongs_to_the_side(comm):
    """With cells of 1 m a cut at 2 m carries the weight from 1.5 m upwards: half of the row below hangs on the nodes of the line."""
    cuts = [{"name": "C", "plane": {"point": [0.0, 2.0], "normal": [0.0, -1.0]}, "point": [2.0, 2.0]}]
    found = results(comm, **{**WALL, "mesh": {**WALL["mesh"], "degree": 1}}, gravity={"acceleration": 10.0}, cuts=cuts)
    assert found["C.FY"] == pytest.approx(2500.0 * 10.0 * 0.2 * 4.0 * 4.5, rel=1e-9)


@pytest.mark.ranks
def test_cuts_with_nothing_on_one_side_are_refused(comm):
    for cut, words in (
        ({"group": "DBAS", "side": "DAL1"}, r"cuts\[C\].side: expected cells on both sides"),
        ({"plane": {"point": [0.0, 9.0], "normal": [0.0, 1.0]}}, r"cuts\[C\].plane: expected cells on both sides"),
        ({"group": "DAL1", "side": "DAL1"}, r"cuts\[C\].group: expected an edge group"),
        ({"group": "DBAS", "side": "DGAU"}, r"cuts\[C\].side: no surface group 'DGAU'"),
        ({"group": "NOWHERE", "side": "DAL1"}, r"cuts\[C\].group: no group 'NOWHERE'"),
    ):
        with pytest.raises(ModelError, match=words):
            results(comm, **WALL, cuts=[{"name": "C", "point": [0.0, 0.0], **cut}])


@pytest.mark.parametrize(("cut", "words"), [
    ({"group": "DBAS"}, r"cuts\[C\].side: missing"),
    ({}, r"cuts\[C\].group: expected either an edge group or a plane"),
    ({"plane": {"point": [0, 0], "normal": [0, 0, 0]}}, r"cuts\[C\].plane.normal: expected a direction"),
    ({"plane": {"point": [0, 0], "normal": [0, 1]}, "group": "DBAS"}, r"cuts\[C\].group: expected either"),
])
def test_bad_cuts_are_refused_by_their_key(cut, words):
    with pytest.raises(ModelError, match=words):
        build_scene({**WALL, "cuts": [{"name": "C", "point": [0.0, 0.0], **cut}]}, Path("."))
