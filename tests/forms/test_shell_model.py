"""What stands on a shell and acts on it, against closed forms and against the same thing said in another way."""

from pathlib import Path

import numpy as np
import pytest

from tests.small import to_dense
from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene
from uplift.meshes.checked import ModelError

CLAMPED = {"group": "DGAU", "edge": "clamped"}
STRIP = {"width": 10.0, "height": 1.0, "nx": 40, "ny": 1}
STEEL = {"young": 2e11, "poisson": 0.0, "density": 8000.0, "thickness": 0.1}
TIP = {"name": "TIP", "point": [10.0, 0.5], "rotations": True}


def scene(mesh=STRIP, plate=STEEL, **sections):
    return build_scene({"mesh": mesh, "plate": plate, "probes": [TIP], **sections}, Path("."))


def static(comm, **sections):
    with prepare(scene(**sections), comm) as assembly:
        history = analyse(assembly, Request("static")).final
        operators = assembly.operators
        return dict(zip(operators.probes.names, history.probes[0], strict=True)), history, operators.reactions.names


BENDING = 2e11 * 0.1**3 / 12
SHEAR = 5 / 6 * 2e11 / 2 * 0.1
SPREAD = 100 * 1e4 / (8 * BENDING) + 100 * 50 / SHEAR
ON_TIP = {"kind": "force", "group": "DDRO", "per": "length"}


@pytest.mark.both
@pytest.mark.parametrize(
    ("load", "deflection", "slope"),
    [
        pytest.param({**ON_TIP, "force": {"Z": 1e3}}, 1e3 * 1e3 / (3 * BENDING) + 1e4 / SHEAR, 1e3 * 100 / (2 * BENDING),
                     marks=pytest.mark.ranks),
        ({**ON_TIP, "force": {"RY": 1e3}}, -1e3 * 100 / (2 * BENDING), -1e3 * 10 / BENDING),
        ({"kind": "force", "group": "DAL1", "per": "area", "force": {"Z": 100.0}}, SPREAD, 100 * 1e3 / (6 * BENDING)),
        ({"kind": "pressure", "value": 100.0}, SPREAD, 100 * 1e3 / (6 * BENDING)),
    ],
)
def test_cantilever_under_each_kind_of_load(comm, load, deflection, slope):
    """Timoshenko's cantilever; without Poisson's ratio a strip is a beam. The slope of the end is -DRY.

    The part of the shear that is integrated in full costs 2e-6 on this mesh.
    """
    found, _, _ = static(comm, conditions=[CLAMPED], load=[load])
    assert found["TIP.DZ"] == pytest.approx(deflection, rel=5e-6)
    assert -found["TIP.DRY"] == pytest.approx(slope, rel=5e-6)


@pytest.mark.both
@pytest.mark.ranks
def test_gravity_in_three_directions_on_a_wall(comm):
    """A square wall on stiff springs at its foot: each direction of gravity is carried by the springs, with its moment."""
    corners = [[0, 0, 0], [4, 0, 0], [4, 0, 2], [0, 0, 2]]
    wall = {"size": 1.0, "plates": [{"name": "WALL", "corners": corners, "edges": ["FOOT", "E", "TOP", "W"]}]}
    weight = 9.81 * 8000 * 0.1 * 8
    springs = {"name": "S", "edge": "FOOT", "count": 5, "stiffness": {"X": 1e9, "Y": 1e9, "Z": 1e9, "RX": 1e9}}
    for direction, force, moment in (("-X", (-1, 0, 0), (0, -1, 0)), ("-Y", (0, -1, 0), (1, 0, 0)), ("-Z", (0, 0, -1), (0, 0, 0))):
        _, history, names = static(
            comm, mesh=wall, springs=[springs], gravity={"acceleration": 9.81, "direction": direction},
            probes=[{"name": "TOP", "point": [4.0, 0.0, 2.0]}],
        )
        assert names == ("force X", "force Y", "force Z", "moment X", "moment Y", "moment Z")
        # The ground's force stands against the weight; about the middle of the foot the weight has an arm of 1 m.
        assert history.reactions[0] == pytest.approx(-weight * np.array([*force, *moment], dtype=float), abs=1e-6 * weight)


@pytest.mark.ranks
def test_springs_per_length_and_per_area_are_their_sum_over_nodes(comm):
    """A rigid plate on a Winkler bed, and on a line of springs along an edge, sinks by its weight over their sum."""
    plate, mesh = {**STEEL, "young": 2e15}, {"width": 3.0, "height": 2.0, "nx": 3, "ny": 2}
    weight = 9.81 * 8000 * 0.1 * 6
    bed = {"name": "B", "group": "DAL1", "per": "area", "stiffness": {"Z": 1e6}}
    found, _, _ = static(comm, mesh=mesh, plate=plate, springs=[bed], gravity={"acceleration": 9.81}, probes=[{**TIP, "point": [3.0, 2.0]}])
    assert found["TIP.DZ"] == pytest.approx(-weight / 6e6, rel=1e-6)
    lines = [{"name": n, "group": g, "per": "length", "stiffness": {"Z": 1e6}} for n, g in (("A", "DGAU"), ("C", "DDRO"))]
    found, _, _ = static(comm, mesh=mesh, plate=plate, springs=lines, gravity={"acceleration": 9.81}, probes=[{**TIP, "point": [3.0, 2.0]}])
    assert found["TIP.DZ"] == pytest.approx(-weight / 4e6, rel=1e-6)


@pytest.mark.parametrize(
    ("degree", "cell", "kind"),
    [(1, "quadrilateral", "plane stress"), (2, "triangle", "plane stress"), (3, "quadrilateral", "bending"),
     pytest.param(3, "triangle", "bending", marks=pytest.mark.ranks)],
)
def test_a_unilateral_bed_carries_the_weight_whatever_the_degree(comm, degree, cell, kind):
    """The shares of length or area of the nodes are positive where a contact stands, and their sum is whole."""
    up = "Y" if kind == "plane stress" else "Z"
    where = {"group": "DBAS", "per": "length"} if up == "Y" else {"group": "DAL1", "per": "area"}
    bed = {"name": "B", **where, "stiffness": {"X": 1e7, up: 1e7}, "contact": {"X": 1e12, up: 1e12}, "unilateral": up}
    mesh = {"width": 3.0, "height": 2.0, "nx": 3, "ny": 2, "degree": degree, "cell": cell}
    standing = scene(mesh, supports=[bed], gravity={"acceleration": 9.81}, probes=[{"name": "TIP", "point": [3.0, 2.0]}])
    with prepare(standing, comm) as assembly:
        assert assembly.plate.kind == kind
        history = analyse(assembly, Request("static")).final
        law = assembly.operators.contacts.law
        force = law.compression(law.tension(history.elongation), history.release)
        assert np.all(1 / law.flexibility > 0)
        assert np.sum(1 / law.flexibility) == pytest.approx(1e7 * (3.0 if up == "Y" else 6.0), rel=1e-4)
        assert force.sum() == pytest.approx(9.81 * 8000 * 0.1 * 6, rel=1e-9)


@pytest.mark.both
@pytest.mark.ranks
def test_parts_have_their_own_material_and_damping(comm):
    """Two halves of other density and damping: mass and C are the sums of theirs."""
    halves = {"size": 1.0, "plates": [
        {"name": "LEFT", "corners": [[0, 0], [2, 0], [2, 1], [0, 1]]}, {"name": "RIGHT", "corners": [[2, 0], [4, 0], [4, 1], [2, 1]]},
    ]}
    left, right = {**STEEL, "alpha": 1e-3, "beta": 0.1}, {**STEEL, "density": 2500.0, "young": 3e10, "alpha": 2e-3, "beta": 0.3}
    load = [{"direction": "Z", "signal": "step"}]

    def matrices(plate, parts=()):
        with prepare(scene(halves, plate, parts=list(parts), load=load, probes=[{"name": "P", "point": [4.0, 1.0]}]), comm) as assembly:
            operators = assembly.operators
            return assembly.plate.total_mass, *(to_dense(m) for m in (operators.stiffness, operators.mass, operators.damping))

    total, _, _, damping = matrices(left, [{"group": "RIGHT", **right}])
    assert total == pytest.approx(0.1 * 2 * (8000 + 2500), rel=1e-12)
    light = 1e-9
    nothing = {**right, "young": right["young"] * light, "density": right["density"] * light}
    _, k_left, m_left, _ = matrices(left, [{"group": "RIGHT", **nothing}])
    no_left = {**left, "young": left["young"] * light, "density": left["density"] * light}
    _, k_right, m_right, _ = matrices(no_left, [{"group": "RIGHT", **right}])
    expected = 1e-3 * k_left + 0.1 * m_left + 2e-3 * k_right + 0.3 * m_right
    assert np.max(np.abs(damping - expected)) < 1e-7 * np.max(np.abs(expected))


@pytest.mark.ranks
def test_point_masses_move_with_the_plate(comm):
    """A light rigid plate with a mass in its middle on four springs is an oscillator; the ground's motion pushes the mass."""
    masses = [{"name": "M", "points": [[1.0, 1.0]], "mass": 1000.0}]
    mesh, plate = {"width": 2.0, "height": 2.0, "nx": 2, "ny": 2}, {**STEEL, "young": 2e15, "density": 1e-3}
    springs = [{"name": "S", "points": ["P1", "P2", "P3", "P4"], "stiffness": {"Z": 1e5}}]
    load = [{"direction": "Z", "signal": "step", "amplitude": 2.0}]
    made = scene(mesh, plate, masses=masses, springs=springs, load=load, probes=[{"name": "P", "point": [1.0, 1.0]}],
                 transient={"step": 2.5e-4, "duration": 0.5, "start": "rest"})
    with prepare(made, comm) as assembly:
        assert assembly.plate.total_mass == pytest.approx(1000.0, rel=1e-5)
        history = analyse(assembly, Request("transient")).final
    omega = np.sqrt(4e5 / 1000.0)
    assert history.probes[:, 0] == pytest.approx(-2.0 / omega**2 * (1 - np.cos(omega * history.times)), abs=2e-4 * 2 / omega**2)


@pytest.mark.ranks
def test_rocking_of_the_ground_is_a_field_of_accelerations(comm):
    """Angular acceleration about an axis gives each mass its arm's acceleration; about X the loads balance about X alone."""
    about_x = {"direction": "RX", "signal": "step", "center_of_rotation": [0.0, 0.5, 0.0]}
    with prepare(scene(load=[about_x], conditions=[CLAMPED]), comm) as assembly:
        twist = assembly.operators.loads[0].vector
        weight = assembly.plate.translations["Z"]
        assert abs(twist.dot(weight)) < 1e-9 * twist.norm() * weight.norm()
    springs = [{"name": "S", "group": "DAL1", "stiffness": {"Z": 1.0}}]
    with prepare(scene(load=[{"direction": "RY", "signal": "step"}], springs=springs), comm) as assembly:
        # -M theta'' x: the force at distance x from the axis along Y points upwards (RY moves points at x > 0 down).
        total = comm.allreduce(float(np.sum(np.real(assembly.operators.loads[0].vector.array_r))))
        assert total == pytest.approx(8000 * 0.1 * 10.0 * 5.0, rel=1e-9)


@pytest.mark.parametrize(
    ("sections", "key", "words"),
    [
        ({"conditions": [{"group": "NOWHERE", "zero": ["DZ"]}]}, "conditions[NOWHERE]", "no group 'NOWHERE'.*DAL1"),
        ({"conditions": [{"group": "DAL1", "edge": "hard"}]}, "conditions[DAL1].edge", "no edge"),
        ({"load": [{"kind": "force", "name": "F", "points": [[5.05, 0.33]], "force": {"Z": 1.0}}]}, "load[F].points", "stands on no node"),
        ({"load": [{"kind": "force", "name": "F", "group": "DAL1", "per": "length", "force": {"Z": 1.0}}]}, "load[F].per", "no edge"),
        ({"load": [{"kind": "pressure", "name": "F", "group": "DBAS", "value": 1.0}]}, "load[F].group", "no surface group"),
        ({"parts": [{"group": "X", **STEEL}]}, "parts[X]", "no surface group"),
    ],
)
@pytest.mark.ranks
def test_what_does_not_fit_the_mesh_is_named_by_key(comm, sections, key, words):
    sections = {"load": [{"kind": "pressure", "value": 1.0}], **sections}
    with pytest.raises(ModelError, match=words) as error:
        prepare(scene(**sections), comm)
    assert error.value.key == key


@pytest.mark.parametrize(
    ("sections", "unrestrained"),
    [
        ({}, ("moving along Z", "rotation about X", "rotation about Y")),
        ({"conditions": [{"group": "DGAU", "edge": "soft"}]}, ("rotation about Y",)),
        ({"conditions": [CLAMPED]}, ()),
        ({"springs": [{"name": "S", "points": ["P1"], "stiffness": {"Z": 1.0, "RX": 1.0, "RY": 1.0}}]}, ()),
    ],
)
@pytest.mark.ranks
def test_rigid_motions_that_nothing_resists(comm, sections, unrestrained):
    with prepare(scene(load=[{"kind": "pressure", "value": 1.0}], **sections), comm) as assembly:
        assert set(assembly.plate.unrestrained) == set(unrestrained)


@pytest.mark.ranks
def test_a_contact_cannot_open_where_the_plate_is_held(comm):
    bed = {"name": "B", "edge": "DGAU", "count": 2, "stiffness": {"Z": 1e7}, "contact": {"Z": 1e12}, "unilateral": "Z"}
    with pytest.raises(ModelError, match="a condition holds the plate"):
        prepare(scene(conditions=[CLAMPED], supports=[bed], gravity={"acceleration": 9.81}), comm)


@pytest.mark.complex
@pytest.mark.ranks
def test_harmonic_answers_against_dense_algebra(comm, tmp_path):
    """A damped strip, complex answers from the file against a dense solve of the gathered matrices."""
    import csv

    from uplift.drivers.studies.harmonic_files import respond

    made = scene({**STRIP, "nx": 4}, {**STEEL, "alpha": 1e-3, "beta": 0.5}, conditions=[CLAMPED],
                 load=[{"direction": "Z", "signal": "step"}, {"kind": "pressure", "name": "P", "value": 10.0}],
                 harmonic={"frequencies": [0.0, 0.4, 7.0]})
    with prepare(made, comm) as assembly:
        respond(assembly, tmp_path, plots=False)
        k, m, c = (to_dense(x) for x in (assembly.operators.stiffness, assembly.operators.mass, assembly.operators.damping))
        vectors = [np.concatenate(comm.allgather(load.vector.array_r)) for load in assembly.operators.loads]
        row = np.concatenate(comm.allgather(assembly.operators.probes.local.toarray()), axis=1)[0]
    if comm.rank == 0:
        lines = list(csv.DictReader((tmp_path / "response.csv").read_text(encoding="utf-8").splitlines()))
        for line in lines:
            w = 2 * np.pi * float(line["frequency [Hz]"])
            for name, vector in zip(("ground motion", "P"), vectors, strict=True):
                expected = row @ np.linalg.solve(k + 1j * w * c - w**2 * m, vector)
                found = float(line[f"{name}: TIP.DZ re [m]"]) + 1j * float(line[f"{name}: TIP.DZ im [m]"])
                assert found == pytest.approx(expected, rel=1e-9)

