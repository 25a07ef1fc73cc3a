"""Scenes on meshes of every arrangement: what is joined, what nothing holds, and what a mesh file may look like."""

import copy

import numpy as np
import pytest

from tests.mesh_files import grid, msh2, quads
from uplift.drivers.analysis.analyse import analyse
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.analysis.check import check_scene
from uplift.drivers.scene.request import Request
from uplift.drivers.scene.scene import build_scene
from uplift.meshes.checked import ModelError

CONCRETE = {"young": 3e10, "poisson": 0.2, "density": 2500.0, "thickness": 0.5}
BED = {"name": "SOIL", "per": "area", "stiffness": {"X": 4e7, "Y": 4e7, "Z": 4e7}, "contact": {"X": 1e12, "Y": 1e12, "Z": 1e12},
       "unilateral": "Z"}
RAFT = {"name": "RAFT", "corners": [[0, 0, 0], [8, 0, 0], [8, 6, 0], [0, 6, 0]]}
TRANSIENT = {"step": 0.01, "duration": 0.1}


def wall(x0, x1, y, foot=0.0, top=4.0, name="WALL"):
    return {"name": name, "corners": [[x0, y, foot], [x1, y, foot], [x1, y, top], [x0, y, top]]}


def scene_of(mesh, folder, **more):
    table = {"mesh": mesh, "plate": CONCRETE, "gravity": {"acceleration": 9.81}, "supports": [BED | {"group": "RAFT"}],
             "probes": [{"name": "TOP", "point": [4, 3, 4]}], "output": {"uplift": "none"}}
    return build_scene(copy.deepcopy(table | more), folder)


def at_rest(scene, comm):
    """Displacements of the probes and resultants at rest, by name."""
    with prepare(scene, comm) as assembly:
        final = analyse(assembly, Request("static")).final
        operators = assembly.operators
        return dict(zip(operators.probes.names, final.probes[0], strict=True)) | dict(
            zip(operators.reactions.names, final.reactions[0], strict=True))


def box_file(folder):
    """A raft of 8 m x 6 m and a wall of 4 m x 4 m on its middle line, in cells of 1 m, numbered by hand."""
    points, cells = grid(8, 6)
    height, up = grid(4, 4)
    foot = [3 * 9 + x for x in range(2, 7)]
    number = foot + [len(points) + i for i in range(len(height) - 5)]
    above = np.column_stack([height[5:, 0] + 2.0, np.full(len(height) - 5, 3.0), height[5:, 1]])
    elements = quads(cells) + quads(np.array(number)[up], 2, 2)
    names = ((2, 1, "RAFT"), (2, 2, "WALL"))
    (folder / "box.msh").write_text(msh2(np.concatenate([points, above]), elements, names), encoding="utf-8")
    return {"file": "box.msh"}


@pytest.mark.parametrize("size", [0.7, 1.3])
def test_a_wall_inside_a_raft_answers_as_on_a_mesh_made_by_hand(comm, tmp_path, size):
    folder = comm.bcast(tmp_path)
    by_hand = box_file(folder) if comm.rank == 0 else {"file": "box.msh"}
    comm.barrier()
    made = at_rest(scene_of({"size": size, "plates": [RAFT, wall(2, 6, 3)]}, folder), comm)
    expected = at_rest(scene_of(by_hand, folder), comm)
    # 64 m2 of 0.5 m: the weight is exact, the settlement differs by the error of either mesh.
    assert made["force Z"] == pytest.approx(64 * 0.5 * 2500 * 9.81, rel=1e-8)
    assert made["TOP.DZ"] == pytest.approx(expected["TOP.DZ"], rel=0.01)


@pytest.mark.parametrize(
    ("plate", "part"),
    [
        (wall(1.7, 5.9, 2.8, foot=1.0, top=5.0), "'WALL'"),
        ({"name": "B", "corners": [[8.001, 0, 0], [12, 0, 0], [12, 6, 0], [8.001, 6, 0]]}, "'B'"),
        # A corner of it touches the raft: it hangs on one node.
        ({"name": "FLAG", "corners": [[4, 3, 0], [6, 3, 3], [2, 3, 3]]}, "'FLAG'"),
    ],
)
def test_a_part_that_nothing_holds_is_refused_by_name(comm, tmp_path, plate, part):
    scene = scene_of({"size": 1.0, "plates": [RAFT, plate]}, tmp_path, transient=TRANSIENT | {"start": "rest"},
                     probes=[{"name": "A", "point": [4, 1, 0]}])
    with pytest.raises(ModelError, match=f"nothing holds the part {part}"):
        prepare(scene, comm)
    with pytest.raises(ModelError, match=f"nothing holds the part {part}"):
        check_scene(scene, comm, mesh=True)


def test_a_part_on_supports_of_its_own_is_held(comm, tmp_path):
    """Two slabs side by side, apart: each settles by its weight over its bed, whatever stands beside it."""
    other = {"name": "B", "corners": [[9, 0, 0], [12, 0, 0], [12, 6, 0], [9, 6, 0]]}
    supports = [BED | {"group": ["RAFT", "B"]}]
    found = at_rest(scene_of({"size": 1.0, "plates": [RAFT, other]}, tmp_path, supports=supports, probes=[
        {"name": "A", "point": [4, 3, 0]}, {"name": "B", "point": [10, 2, 0]}]), comm)
    settlement = -0.5 * 2500 * 9.81 * (1 / 4e7 + 1 / 1e12)
    assert [found["A.DZ"], found["B.DZ"]] == pytest.approx([settlement] * 2, rel=1e-6)


def test_a_part_that_is_free_in_one_direction_is_named_and_runs(comm, tmp_path, caplog):
    other = {"name": "B", "corners": [[9, 0, 0], [12, 0, 0], [12, 6, 0], [9, 6, 0]]}
    only_up = {"name": "UP", "group": "B", "per": "area", "stiffness": {"Z": 4e7}, "contact": {"Z": 1e12}, "unilateral": "Z"}
    shaking = {"direction": "X", "signal": "sine", "amplitude": 0.1, "frequency": 2.0, "end": 0.1}
    scene = scene_of({"size": 2.0, "plates": [RAFT, other]}, tmp_path, supports=[BED | {"group": "RAFT"}, only_up], load=[shaking],
                     kinematics={"kind": "shell"}, probes=[{"name": "A", "point": [4, 2, 0]}], transient=TRANSIENT | {"start": "rest"})
    with prepare(scene, comm) as assembly, caplog.at_level("WARNING"):
        free = {f"{motion} of 'B'" for motion in ("moving along X", "moving along Y", "rotation about Z")}
        assert set(assembly.plate.unrestrained) == free
        assert np.all(np.isfinite(analyse(assembly, Request("transient")).final.probes))
        assert "note: nothing holds the plate against" in caplog.text and "'B'" in caplog.text
        with pytest.raises(ModelError, match="'B'"):
            analyse(assembly, Request("static"))


def slab_file(folder, level=0.0, order=1):
    """A slab of 8 m x 4 m at a height, with a base line, four corners named PILES and one named TOP."""
    points, cells = grid(8, 4, at=(0.0, 0.0, level))
    elements = [*quads(cells), *((1, 2, 2, (x, x + 1)) for x in range(8)), *((15, 3, 3, (n,)) for n in (0, 8, 36, 44)), (15, 4, 4, (44,))]
    names = ((2, 1, "SLAB"), (1, 2, "BASE"), (0, 3, "PILES"), (0, 4, "TOP"))
    (folder / "slab.msh").write_text(msh2(points, elements, names), encoding="utf-8")
    return {"file": "slab.msh"}


PILE = {"name": "S", "stiffness": {"Z": 1e8}, "contact": {"Z": 1e12}, "unilateral": "Z"}
PROBE = {"name": "A", "point": [4, 2]}
WEIGHT = 8 * 4 * 0.5 * 2500 * 9.81


@pytest.mark.parametrize("where", [
    {"group": "PILES"}, {"points": ["PILES"]}, {"points": [[0, 0], "TOP", [8, 0], [0, 4]]}, {"group": ["PILES", "TOP"]},
])
def test_groups_of_points_and_names_of_points_hold_a_slab(comm, tmp_path, where):
    found = at_rest(scene_of(slab_file(tmp_path), tmp_path, supports=[PILE | where], probes=[{"name": "A", "point": "TOP"}]), comm)
    assert found["force Z"] == pytest.approx(WEIGHT, rel=1e-9)
    # Each of four piles carries a quarter.
    assert found["A.DZ"] == pytest.approx(-WEIGHT / 4 * (1 / 1e8 + 1 / 1e12), rel=1e-9)


def test_names_of_points_stand_for_forces_and_masses_too(comm, tmp_path):
    force = {"kind": "force", "name": "F", "points": ["PILES"], "force": {"Z": -1e5}}
    masses = [{"name": "M", "points": ["TOP"], "mass": 1e4}]
    scene = scene_of(slab_file(tmp_path), tmp_path, supports=[PILE | {"group": "PILES"}],
                     load=[force], masses=masses, probes=[{"name": "A", "point": [4, 2]}])
    assert at_rest(scene, comm)["force Z"] == pytest.approx(WEIGHT + 4e5 + 1e4 * 9.81, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"probes": [{"name": "A", "point": "PILES"}]}, "probes[A].point", "expected one point, the group 'PILES' holds 4"),
        ({"probes": [{"name": "A", "point": "NONE"}]}, "probes[A].point", "no point group 'NONE'"),
        ({"supports": [PILE | {"points": ["BASE"]}]}, "supports[S].points", "no point group 'BASE'"),
        ({"supports": [PILE | {"group": ["PILES", "BASE"]}]}, "supports[S].group", "of one dimension"),
        ({"supports": [PILE | {"group": []}]}, "supports[S].group", "at least one name"),
        ({"supports": [PILE | {"group": ["PILES", 3]}]}, "supports[S].group", "a text"),
        ({"parts": [CONCRETE | {"group": ["SLAB", "NO"]}]}, "parts[SLAB, NO]", "no surface group 'NO'"),
        ({"mesh": {"file": "slab.msh", "merge": 1}}, "mesh.merge", "true or false"),
        ({"mesh": {"file": "slab.msh", "cracks": "BASE"}}, "mesh.cracks", "an array"),
        ({"mesh": {"file": "slab.msh", "cracks": ["NO"]}}, "mesh.cracks", "no group 'NO'"),
    ],
)
def test_mistakes_in_names_are_refused_by_key(comm, tmp_path, change, key, words):
    mesh = slab_file(tmp_path)
    if "cracks" in change.get("mesh", {}):  # a group is looked for where nodes are doubled
        mesh = doubled_file(tmp_path)
    with pytest.raises(ModelError, match=words) as error, prepare(
        scene_of(**{"mesh": mesh, "folder": tmp_path, "supports": [PILE | {"group": "PILES"}], "probes": [PROBE]} | change), comm
    ):
        pass
    assert error.value.key == key


def doubled_file(folder):
    (left, a), (right, b) = grid(4, 4), grid(4, 4, at=(4.0, 0.0, 0.0))
    text = msh2(np.concatenate([left, right]), quads(a) + quads(b + len(left), 1, 2), ((2, 1, "SLAB"),))
    (folder / "slab.msh").write_text(text, encoding="utf-8")
    return {"file": "slab.msh"}


@pytest.mark.parametrize("kind", ["bending", "plane stress", "shell"])
def test_a_slab_at_any_height_answers_as_at_zero(comm, tmp_path, kind):
    stiff = {"stiffness": {"X": 1e8, "Y": 1e8, "Z": 1e8}, "contact": {"X": 1e12, "Y": 1e12, "Z": 1e12}}
    up = "Y" if kind == "plane stress" else "Z"
    answers = []
    for level in (0.0, 12.5, -3.0):
        support = {"name": "S", "group": "BASE" if up == "Y" else "SLAB", "unilateral": up} | stiff
        found = at_rest(scene_of(slab_file(tmp_path, level), tmp_path, supports=[support], kinematics={"kind": kind},
                                 probes=[{"name": "A", "point": [8, 4]}, {"name": "B", "point": [3.3, 1.2, level]}]), comm)
        answers.append([found["A.D" + up], found["B.D" + up]])
    assert answers[1] == pytest.approx(answers[0], rel=1e-9) and answers[2] == pytest.approx(answers[0], rel=1e-9)


def test_points_and_pictures_of_a_slab_stand_at_its_height(comm, tmp_path):
    from uplift.meshes.gather import gather_mesh

    with prepare(scene_of(slab_file(tmp_path, 12.5), tmp_path, supports=[PILE | {"group": "PILES"}],
                          probes=[{"name": "A", "point": [8, 4]}]), comm) as assembly:
        assert np.unique(assembly.operators.contacts.points[:, 2]).tolist() == [12.5]
        assert assembly.plate.model.probes[0].point == (8.0, 4.0, 12.5)
        assert np.unique(gather_mesh(assembly.tagged).points[:, 2]).tolist() == [12.5]


def test_a_slab_rocked_about_an_axis_at_its_height_is_not_shaken_sideways(comm, tmp_path):
    rocking = {"direction": {"RX": 1.0}, "signal": "sine", "amplitude": 0.1, "frequency": 2.0, "end": 0.1}
    plates = [{"name": "RAFT", "corners": [[x, y, 3.0] for x, y, _ in RAFT["corners"]]}]
    for height, kind in ((3.0, "bending"), (0.0, "shell")):
        scene = scene_of({"size": 2.0, "plates": plates}, tmp_path, probes=[{"name": "A", "point": [0, 0]}],
                         load=[rocking | {"center_of_rotation": [4.0, 3.0, height]}], transient=TRANSIENT)
        with prepare(scene, comm) as assembly:
            assert assembly.plate.kind == kind


@pytest.mark.parametrize("degree", [None, 1, 3])
def test_a_second_order_mesh_in_plane_stress_takes_its_own_degree(comm, tmp_path, degree):
    import gmsh

    from uplift.meshes.gmsh_session import gmsh_session

    slab_file(tmp_path)
    with gmsh_session():
        gmsh.open(str(tmp_path / "slab.msh"))
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(tmp_path / "second.msh"))
    mesh = {"file": "second.msh"} | ({} if degree is None else {"degree": degree})
    support = {"name": "S", "group": "BASE", "stiffness": {"X": 1e8, "Y": 1e8}, "contact": {"X": 1e12, "Y": 1e12}, "unilateral": "Y"}
    scene = scene_of(mesh, tmp_path, supports=[support], kinematics={"kind": "plane stress"}, probes=[{"name": "A", "point": [8, 4]}])
    if degree is not None:
        with pytest.raises(ModelError, match="expected 2, the order of the mesh file"):
            at_rest(scene, comm)
        return
    assert at_rest(scene, comm)["vertical reaction"] == pytest.approx(WEIGHT, rel=1e-9)


def test_more_ranks_than_cells_are_refused(comm, tmp_path):
    scene = scene_of({"width": 2.0, "height": 2.0, "nx": 1, "ny": 1}, tmp_path, supports=[PILE | {"points": ["P1", "P2", "P3"]}],
                     probes=[{"name": "A", "point": "P3"}])
    if comm.size == 1:
        assert at_rest(scene, comm)["force Z"] == pytest.approx(4 * 0.5 * 2500 * 9.81, rel=1e-9)
        return
    with pytest.raises(ModelError, match="ranks are too many for 1 cells"):
        prepare(scene, comm)


def test_the_mesh_that_is_exported_is_the_one_that_runs(comm, tmp_path):
    """A support off the nodes of cells of the first degree, on one of the second, which alone a regular mesh keeps."""
    import meshio

    from uplift.drivers.analysis.assembled_scene import source_of
    from uplift.meshes.export import write_mesh
    from uplift.meshes.gather import gather_mesh

    support = {key: value for key, value in BED.items() if key != "per"} | {"points": [[1, 1, 0], [7, 1, 0], [4, 3, 0]]}
    scene = scene_of({"size": 2.0, "plates": [RAFT]}, tmp_path, supports=[support], probes=[{"name": "A", "point": [4, 2, 0]}])
    cells = write_mesh(source_of(scene), tmp_path / "out.vtu")
    with prepare(scene, comm) as assembly:
        whole = gather_mesh(assembly.tagged)
    again = meshio.read(tmp_path / "out.vtu")
    assert len(whole.cells) == cells == 12
    assert np.array_equal(np.unique(again.points.round(9), axis=0), np.unique(whole.points.round(9), axis=0))


@pytest.mark.parametrize(
    ("change", "more"),
    [
        ({}, 0.0),
        ({"load": [{"kind": "pressure", "name": "q", "group": ["R1", "R2"], "value": -1000.0}]}, 16 * 1000.0),
        ({"load": [{"kind": "force", "name": "q", "group": ["B1", "B2"], "per": "length", "force": {"Z": -1000.0}}]}, 8 * 1000.0),
        ({"masses": [{"name": "m", "group": ["R1", "R2"], "per": "area", "mass": 100.0}]}, 16 * 100 * 9.81),
        ({"parts": [CONCRETE | {"group": ["R1", "R2"], "thickness": 1.0}]}, WEIGHT / 2),
        ({"springs": [{"name": "K", "group": ["B1", "B2"], "per": "length", "stiffness": {"Z": 1e9}}]}, 0.0),
        ({"output": {"uplift": "all", "uplift_group": ["R1", "R2"]}}, 0.0),
    ],
)
def test_several_groups_count_as_one_everywhere(comm, tmp_path, change, more):
    """A slab of 8 m x 4 m in three groups of cells, its base line in two; at rest the ground carries the weight and what is added to it."""
    points, cells = grid(8, 4)
    x = points[cells].mean(axis=1)[:, 0]
    elements = [*quads(cells[x < 2], 1, 1), *quads(cells[(x > 2) & (x < 4)], 2, 2), *quads(cells[x > 4], 3, 3),
                *((1, 4 + n // 4, 4 + n // 4, (n, n + 1)) for n in range(8))]
    names = ((2, 1, "R1"), (2, 2, "R2"), (2, 3, "R3"), (1, 4, "B1"), (1, 5, "B2"))
    (tmp_path / "parts.msh").write_text(msh2(points, elements, names), encoding="utf-8")
    bed = [PILE | {"group": ["R1", "R2", "R3"], "per": "area"}]
    scene = scene_of(**{"mesh": {"file": "parts.msh"}, "folder": tmp_path, "supports": bed, "probes": [PROBE]} | change)
    assert at_rest(scene, comm)["force Z"] == pytest.approx(WEIGHT + more, rel=1e-9)
