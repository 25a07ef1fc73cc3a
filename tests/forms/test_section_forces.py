"""Section forces at points: patch tests, closed forms, the order of the recovery, and what follows from them."""

from pathlib import Path

import numpy as np
import pytest

from tests.strip import distorted
from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.evidence.benchmarks.meshes import write_cylinder, write_disc
from uplift.drivers.results.internal_forces import columns_of
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene
from uplift.forms.recovery.fit import weights_at
from uplift.forms.recovery.stresses import derived, principal, wood_armer
from uplift.meshes.checked import ModelError

POISSON, THICKNESS = 0.3, 0.1
PLATE = {"young": 1e7, "poisson": POISSON, "density": 1.0, "thickness": THICKNESS}
RIM = ("DGAU", "DDRO", "DBAS", "DHAU")


def forces(comm, folder=Path("."), **scene):
    """The internal forces of the static answer, by name."""
    with prepare(build_scene({"plate": PLATE, **scene}, folder), comm) as assembly:
        history = analyse(assembly, Request("static")).final
        return {column.name: float(column.values[0]) for column in columns_of(assembly.plate.forces, history)["forces"]}


def probe(name, *point, **more):
    return {"name": name, "point": list(point), "forces": True, **more}


CELLS = [("quadrilateral", 1), ("quadrilateral", 2), ("quadrilateral", 3), ("triangle", 3)]
PLACES = [probe("A", 0.0, 0.0), probe("B", 1.3, 0.7), probe("C", 2.0, 0.4), probe("D", 0.9, 0.55)]


@pytest.mark.parametrize(("cell", "degree"), CELLS)
def test_constant_moment_is_exact_on_distorted_cells(comm, tmp_path, cell, degree):
    """M11 = m, M22 = 0 in a strip that is free to curve sideways, turned about its end by a moment m."""
    m = 3.0
    held = [{"group": "LEFT", "zero": ["DRY"]}, {"group": "CORNER", "zero": ["DZ", "DRX"]}]
    load = [{"kind": "force", "group": "RIGHT", "per": "length", "force": {"RY": m}}]
    mesh = {"file": distorted(comm, tmp_path, cell), "degree": degree}
    found = forces(comm, tmp_path, mesh=mesh, kinematics={"kind": "bending"}, conditions=held, load=load, probes=PLACES)
    for place in "ABCD":
        got = [found[f"{place}.{name}"] for name in ("M11", "M22", "M12", "V1", "V2")]
        # Round-off of a bending stiffness beside the shear stiffness, which is (length / thickness)^2 times as large.
        assert got == pytest.approx([m, 0, 0, 0, 0], abs=1e-8 * m)
        assert found[f"{place}.S11.top"] == pytest.approx(6 * m / THICKNESS**2, rel=1e-8)
        assert found[f"{place}.mises.bottom"] == pytest.approx(6 * m / THICKNESS**2, rel=1e-8)


@pytest.mark.parametrize(("cell", "degree"), CELLS)
def test_constant_shear_is_exact_on_distorted_cells(comm, tmp_path, cell, degree):
    """Without rotations a deflection that is linear in x has the shear force 5/6 G t times its slope and no moment."""
    pull = 7.0
    held = [{"group": "STRIP", "zero": ["DRX", "DRY"]}, {"group": "LEFT", "zero": ["DZ"]}]
    load = [{"kind": "force", "group": "RIGHT", "per": "length", "force": {"Z": pull}}]
    mesh = {"file": distorted(comm, tmp_path, cell), "degree": degree}
    found = forces(comm, tmp_path, mesh=mesh, kinematics={"kind": "bending"}, conditions=held, load=load, probes=PLACES)
    for place in "ABCD":
        got = [found[f"{place}.{name}"] for name in ("V1", "V2", "M11", "M22", "M12")]
        assert got == pytest.approx([pull, 0, 0, 0, 0], abs=1e-9 * pull)


@pytest.mark.parametrize(("cell", "degree"), [("quadrilateral", 1), ("quadrilateral", 2), ("triangle", 1), ("triangle", 2)])
def test_constant_membrane_force_is_exact_in_plane_stress(comm, tmp_path, cell, degree):
    held = [{"group": "LEFT", "zero": ["DX"]}, {"group": "CORNER", "zero": ["DY"]}]
    load = [{"kind": "force", "group": "RIGHT", "per": "length", "force": {"X": 5.0}}]
    mesh = {"file": distorted(comm, tmp_path, cell), "degree": degree}
    turned = {**PLATE, "axes": {"x": [1.0, 1.0]}}
    found = forces(
        comm, tmp_path, mesh=mesh, plate=turned, kinematics={"kind": "plane stress"}, conditions=held, load=load, probes=PLACES
    )
    for place in "ABCD":
        # Axes turned by 45 degrees: N11 = N22 = n / 2, N12 = -n / 2.
        assert [found[f"{place}.{name}"] for name in ("N11", "N22", "N12")] == pytest.approx([2.5, 2.5, -2.5], rel=1e-9)
        assert (found[f"{place}.N1"], found[f"{place}.N2"]) == pytest.approx((5.0, 0.0), abs=1e-8)
        assert found[f"{place}.angle.N"] == pytest.approx(-np.pi / 4)
        assert "V1" not in found and found[f"{place}.mises.middle"] == pytest.approx(5.0 / THICKNESS)


def navier(x, y):
    """M11, M12 and V1 of a square plate of 1 m, simply supported, under 1 Pa along its normal: Mindlin's are Kirchhoff's.

    Source: Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells, section 30; signs of the project.
    """
    m, n = np.arange(1, 800, 2)[:, None], np.arange(1, 800, 2)[None, :]
    a = 16 / (np.pi**6 * m * n * (m**2 + n**2) ** 2)
    sx, sy, cx, cy = np.sin(m * np.pi * x), np.sin(n * np.pi * y), np.cos(m * np.pi * x), np.cos(n * np.pi * y)
    return {
        "M11": np.sum(a * np.pi**2 * (m**2 + POISSON * n**2) * sx * sy),
        "M12": -(1 - POISSON) * np.sum(a * np.pi**2 * m * n * cx * cy),
        "V1": np.sum(a * np.pi**3 * m * (m**2 + n**2) * cx * sy),
    }


@pytest.mark.parametrize(("cell", "degree", "least"), [("quadrilateral", 1, 1.7), ("quadrilateral", 2, 3.3), ("triangle", 3, 3.3)])
def test_order_of_the_recovery(comm, cell, degree, least):
    """At nodes within: two for degree 1 and four above, from the two finer of three meshes; slopes scatter by some tenths."""
    errors = []
    for n in (8, 16):
        mesh = {"width": 1.0, "height": 1.0, "nx": n, "ny": n, "degree": degree, "cell": cell}
        held = [{"group": name, "edge": "hard"} for name in RIM]
        found = forces(comm, mesh=mesh, kinematics={"kind": "bending"}, conditions=held, load=[{"kind": "pressure", "value": 1.0}],
                       probes=[probe("P", 0.25, 0.25)])
        errors.append([abs(found[f"P.{name}"] - exact) for name, exact in navier(0.25, 0.25).items()])
    slopes = np.log2(np.array(errors[0]) / np.array(errors[1]))
    assert np.all(slopes > least) and np.all(slopes < least + 1.5), slopes


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_clamped_and_supported_disc(comm, tmp_path, cell):
    """Under 1 Pa with radius 1 m: clamped (1 + nu) / 16 in the middle and 1 / 8 at the edge, supported (3 + nu) / 16.

    The rim is a polygon of 63 sides or more, whose inscribed circle is smaller by 0.12 %, which counts twice in moments.
    """
    size = 0.1
    if comm.rank == 0:
        write_disc(tmp_path / "disc.msh", 1.0, size, cell)
    folder = comm.bcast(tmp_path)
    round_axes = {**PLATE, "axes": {"cylinder": {"point": [0.0, 0.0], "axis": [0.0, 0.0, 1.0]}}}
    common = {"mesh": {"file": "disc.msh"}, "plate": round_axes, "kinematics": {"kind": "bending"},
              "load": [{"kind": "pressure", "value": 1.0}], "probes": [probe("RIM", 1.0, 0.0), probe("NEAR", 0.02, 0.01)]}
    clamped = forces(comm, folder, conditions=[{"group": "RIM", "zero": ["DZ", "DRX", "DRY"]}], **common)
    supported = forces(comm, folder, conditions=[{"group": "RIM", "zero": ["DZ"]}], **common)
    assert clamped["NEAR.M11"] == pytest.approx((1 + POISSON) / 16, rel=5e-3)
    assert clamped["NEAR.M22"] == pytest.approx((1 + POISSON) / 16, rel=5e-3)
    assert clamped["RIM.M11"] == pytest.approx(-1 / 8, rel=5e-3)
    assert clamped["RIM.M22"] == pytest.approx(-POISSON / 8, rel=1e-2)
    # 6 M / t^2 in both directions.
    assert supported["NEAR.mises.top"] == pytest.approx(6 * (3 + POISSON) / 16 / THICKNESS**2, rel=5e-3)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_cantilever_wall_by_hand(comm, degree):
    """A wall 10 m wide and 1 m high, clamped at the left, under line loads at the right edge: forces in the middle of its length.

    N11 = px, N12 = 3/2 py at mid-depth (parabola; 1 at degree 1, whose mean it is), M11 = -pz (l - x), V1 = pz.
    """
    px, py, pz = 500.0, 200.0, 1000.0
    mesh = {"width": 10.0, "height": 1.0, "nx": 20, "ny": 2, "degree": degree}
    found = forces(
        comm, mesh=mesh, plate={**PLATE, "poisson": 0.0}, kinematics={"kind": "shell"}, probes=[probe("M", 5.0, 0.5)],
        conditions=[{"group": "DGAU", "edge": "clamped"}],
        load=[{"kind": "force", "group": "DDRO", "per": "length", "force": {"X": px, "Y": py, "Z": pz}}],
    )
    expected = {"N11": px, "N12": py if degree == 1 else 1.5 * py, "M11": -5.0 * pz, "V1": pz}
    for name, value in (dict.fromkeys(("N22", "M22", "M12", "V2"), 0.0) | expected).items():
        # Round-off of a thin plate with 20 cells along it.
        assert found[f"M.{name}"] == pytest.approx(value, abs=1e-6 * 5 * pz), name
    assert found["M.S11.top"] == pytest.approx(px / THICKNESS - 6 * 5 * pz / THICKNESS**2, rel=1e-6)
    assert found["M.S11.bottom"] == pytest.approx(px / THICKNESS + 6 * 5 * pz / THICKNESS**2, rel=1e-6)


def test_roof_of_scordelis_and_lo(comm, tmp_path):
    """In axes around the cylinder N11 runs along the roof: tension at its free edge, and a moment across at its crown.

    Statics: the moment of N11 in the middle section about the axis of the cylinder, by Simpson's rule over seven points, is that of
    the weight w of half an arc on a simple beam, w l^2 / 8; along the arc N11 is a cosine series of few terms, which the rule gives to 1 %.
    """
    radius, length, angle, weight = 25.0, 50.0, np.radians(40.0), 90.0
    if comm.rank == 0:
        write_cylinder(tmp_path / "roof.msh", radius, 40.0, length / 2, 12)
    folder = comm.bcast(tmp_path)
    at = np.linspace(0.0, angle, 7)
    probes = [probe(f"P{k}", radius * np.sin(a), 0.0, radius * np.cos(a)) for k, a in enumerate(at)]
    found = forces(
        comm, folder, mesh={"file": "roof.msh", "degree": 2}, probes=probes, gravity={"acceleration": 10.0, "direction": "-Z"},
        plate={"young": 4.32e8, "poisson": 0.0, "density": 36.0, "thickness": 0.25,
               "axes": {"cylinder": {"point": [0.0, 0.0, 0.0], "axis": [0.0, 1.0, 0.0]}}},
        conditions=[{"group": "CROWN", "zero": ["DX", "DRY", "DRZ"]}, {"group": "MIDDLE", "zero": ["DY", "DRX", "DRZ"]},
                    {"group": "END", "zero": ["DX", "DZ"]}],
    )
    simpson = np.array([1, 4, 2, 4, 2, 4, 1]) / 3 * (angle / 6) * radius
    along = np.array([found[f"P{k}.N11"] for k in range(7)])
    assert abs(simpson @ along) < 0.01 * simpson @ np.abs(along)
    assert -simpson @ (along * radius * np.cos(at)) == pytest.approx(weight * radius * angle * length**2 / 8, rel=0.01)
    assert along[-1] > 0 and found["P0.M22"] < 0


@pytest.mark.ranks
def test_axes_along_an_edge_and_of_a_part_without_a_material(comm):
    mesh = {"size": 1.0, "plates": [{"name": "A", "corners": [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], "edges": ["S", "E", "N", "W"]}]}
    common = {"mesh": mesh, "conditions": [{"group": "W", "edge": "clamped"}], "kinematics": {"kind": "shell"},
              "probes": [probe("P", 2.0, 2.0)], "load": [{"kind": "force", "group": "E", "per": "length", "force": {"X": 10.0}}]}
    usual = forces(comm, **common)
    turned = forces(comm, parts=[{"group": "A", "axes": {"edge": "E"}}], **common)
    assert usual["P.N11"] == pytest.approx(10.0, rel=0.05)  # the clamped edge disturbs it a little
    assert (turned["P.N22"], turned["P.N11"]) == pytest.approx((usual["P.N11"], usual["P.N22"]))


def test_forces_are_not_averaged_across_a_shallow_fold(comm):
    """A roof of two plates that fold by 12 degrees, pulled along one of them: at the ridge each has its own force."""
    rise = np.tan(np.radians(6.0)) * 2
    mesh = {"size": 1.0, "plates": [
        {"name": "LEFT", "corners": [[-2, 0, 0], [0, 0, rise], [0, 3, rise], [-2, 3, 0]]},
        {"name": "RIGHT", "corners": [[0, 0, rise], [2, 0, 0], [2, 3, 0], [0, 3, rise]]},
    ]}
    common = {"mesh": mesh, "conditions": [{"group": "LEFT.4", "edge": "clamped"}],
              "load": [{"kind": "force", "group": "RIGHT.2", "per": "length", "force": {"Y": 10.0}}]}
    with pytest.raises(ModelError, match=r"several plates \(LEFT, RIGHT\) meet"):
        forces(comm, probes=[probe("P", 0.0, 1.5, rise)], **common)
    found = forces(comm, probes=[probe("P", 0.0, 1.5, rise, part="LEFT"), probe("Q", 0.0, 1.5, rise, part=["LEFT"])], **common)
    assert found["P.N12"] == found["Q.N12"] and found["P.N12"] == pytest.approx(10.0, rel=0.6)  # a parabola across the width


@pytest.mark.parametrize("cells", [3, 4])
def test_a_coarse_curved_shell_is_one_plate(comm, tmp_path, cells):
    """A quarter of a cylinder of 3 or 4 cells, whose normals turn by 30 and 22.5 degrees, under tension along it."""
    if comm.rank == 0:
        write_cylinder(tmp_path / "quarter.msh", 10.0, 90.0, 20.0, cells)
    folder = comm.bcast(tmp_path)
    at = [10.0 * np.sin(np.pi / 2 / cells), 20.0 / cells, 10.0 * np.cos(np.pi / 2 / cells)]
    found = forces(
        comm, folder, mesh={"file": "quarter.msh", "degree": 2}, probes=[probe("P", *at)],
        plate={**PLATE, "poisson": 0.0, "axes": {"cylinder": {"point": [0.0, 0.0, 0.0], "axis": [0.0, 1.0, 0.0]}}},
        conditions=[{"group": "MIDDLE", "zero": ["DY"]}, {"group": "CROWN", "zero": ["DX", "DRY"]},
                    {"group": "SIDE", "zero": ["DZ", "DRY"]}],
        load=[{"kind": "force", "group": "END", "per": "length", "force": {"Y": 10.0}}],
    )
    assert [found[f"P.{name}"] for name in ("N11", "N22", "N12")] == pytest.approx([10.0, 0.0, 0.0], abs=1e-6)


@pytest.mark.ranks
def test_a_probe_where_plates_meet_names_its_part(comm):
    mesh = {"size": 1.0, "plates": [
        {"name": "FLOOR", "corners": [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]]},
        {"name": "WALL", "corners": [[0, 2, 0], [4, 2, 0], [4, 2, 3], [0, 2, 3]]},
    ]}
    common = {"mesh": mesh, "conditions": [{"group": "FLOOR.1", "edge": "clamped"}],
              "load": [{"kind": "force", "group": "WALL.3", "per": "length", "force": {"X": 10.0}}]}
    with pytest.raises(ModelError, match=r"probes\[P\].part: several plates \(FLOOR, WALL\) meet at \(2, 2\) m"):
        forces(comm, probes=[probe("P", 2.0, 2.0, 0.0)], **common)
    with pytest.raises(ModelError, match="jump at a joint"):
        forces(comm, probes=[probe("P", 2.0, 2.0, 0.0, part="FLOOR")], **common)
    with pytest.raises(ModelError, match="lies in no cell of WALL"):
        forces(comm, probes=[probe("P", 2.0, 1.0, 0.0, part="WALL")], **common)
    found = forces(comm, probes=[probe("P", 2.0, 2.0, 0.0, part="WALL")], **common)
    assert found["P.N12"] == pytest.approx(10.0, rel=0.5)  # of the mean over the foot, which its ends disturb


def test_weights_give_back_polynomials_and_know_no_curvature_across_two_rows():
    points = np.random.default_rng(4).uniform(size=(20, 2))
    x, y = points.T + np.array([[0.3], [0.6]])
    assert weights_at(points, 2, in_each=False) @ (1 + x * y - y**2) == pytest.approx(1 + 0.18 - 0.36)
    assert weights_at(points, 2, in_each=True) @ (x**2 * y**2) == pytest.approx(0.18**2)
    rows = np.array([(x, y) for x in range(4) for y in (-1.0, 1.0)])
    weights = weights_at(rows - [1.0, 0.0], 2, in_each=True)
    assert weights @ (rows[:, 0] ** 2 + 3 * rows[:, 1]) == pytest.approx(1.0)


def test_moments_of_reinforcement_by_hand():
    """Twist alone needs the same in all four layers, a moment along axis 1 alone one; else M12^2 / M of the idle direction is added."""
    names = ("WA1.top", "WA2.top", "WA1.bottom", "WA2.bottom")

    def found(*moment):
        return [float(wood_armer(np.array(moment))[name]) for name in names]

    assert found(0.0, 0.0, -5.0) == pytest.approx([5.0, 5.0, -5.0, -5.0])
    assert found(7.0, 0.0, 0.0) == pytest.approx([7.0, 0.0, 0.0, 0.0])
    assert found(6.0, -3.0, 1.0) == pytest.approx([6.0 + 1.0 / 3.0, 0.0, 0.0, -3.0 - 1.0 / 6.0])
    assert found(-4.0, -4.0, 1.0) == pytest.approx([0.0, 0.0, -5.0, -5.0])


def test_reinforcement_resists_the_moment_in_every_direction_and_no_more():
    """Johansen: m1 cos2 + m2 sin2 >= M_n at every angle at the top, <= at the bottom, and equal at some angle where bars are needed."""
    moments = np.random.default_rng(5).normal(size=(200, 3))
    angle = np.linspace(0.0, np.pi, 3601)[:, None]
    c, s = np.cos(angle), np.sin(angle)
    acting = moments[:, 0] * c**2 + moments[:, 1] * s**2 + 2 * moments[:, 2] * s * c
    design = wood_armer(moments)
    spare_top = design["WA1.top"] * c**2 + design["WA2.top"] * s**2 - acting
    spare_bottom = acting - design["WA1.bottom"] * c**2 - design["WA2.bottom"] * s**2
    for spare, bars in ((spare_top, design["WA1.top"] + design["WA2.top"]), (spare_bottom, design["WA1.bottom"] + design["WA2.bottom"])):
        assert np.min(spare) > -1e-12
        # Angles of half a twentieth of a degree: a minimum is met to the square of that.
        assert np.max(np.min(spare, axis=0)[np.abs(bars) > 0]) < 1e-5


def test_principal_values_and_their_direction():
    """A pull of 5 at 30 degrees from axis 1."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    larger, smaller, angle = principal(np.array([5 * c * c, 5 * s * s, 5 * c * s]))
    assert (larger, smaller, angle) == pytest.approx((5.0, 0.0, np.pi / 6))
    # Equal values but for round-off have no direction, and one across axis 1 is at +90 degrees whatever the sign of that.
    _, _, angle = principal(np.array([[1.0, 1.0, 1e-12], [0.0, 1.0, -1e-12]]))
    assert angle == pytest.approx([0.0, np.pi / 2])
    found = derived({"M11": np.array([6.0]), "M22": np.array([0.0]), "M12": np.array([0.0])}, 2.0)
    assert found["S11.top"][1] == pytest.approx([9.0]) and found["mises.middle"][1] == pytest.approx([0.0])
