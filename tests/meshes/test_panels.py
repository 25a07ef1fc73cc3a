from contextlib import nullcontext

import numpy as np
import pytest

from uplift.meshes.checked import ModelError
from uplift.meshes.export import write_mesh
from uplift.meshes.gather import gather_mesh
from uplift.meshes.gmsh_session import gmsh_session
from uplift.meshes.imported import MeshFile
from uplift.meshes.panels import Panel, Panels
from uplift.meshes.panels_gmsh import check_cells, check_plates_joined
from uplift.meshes.tagged import build_mesh

SQUARE = ((0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (4.0, 4.0, 0.0), (0.0, 4.0, 0.0))
L_SHAPE = ((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (3.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 2.0, 0.0), (0.0, 2.0, 0.0))
HOLE = ((0.25, 0.25, 0.0), (0.75, 0.25, 0.0), (0.75, 0.75, 0.0), (0.25, 0.75, 0.0))


def as_it_is(flat, order, level):
    return 2 if flat else 3, order


def areas(whole):
    corners = whole.points[whole.corners]
    arms = corners[:, 1:] - corners[:, :1]
    return sum(0.5 * np.linalg.norm(np.cross(arms[:, i], arms[:, i + 1]), axis=1) for i in range(arms.shape[1] - 1))


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
@pytest.mark.ranks(2, 3)
def test_a_polygon_with_a_hole(comm, cell):
    panels = Panels((Panel("PLATE", L_SHAPE, holes=(HOLE,)),), 0.2, cell, nodes=((2.03, 0.41, 0.0), (1.23, 0.0, 0.0)))
    tagged = build_mesh(comm, panels, as_it_is)
    whole = gather_mesh(tagged)
    assert tagged.mesh.geometry.dim == 2
    if whole is not None:
        assert whole.corners.shape[1] == (4 if cell == "quadrilateral" else 3)
        assert areas(whole).sum() == pytest.approx(4.0 - 0.25, rel=1e-12)
        for node in panels.nodes:
            assert np.min(np.linalg.norm(whole.points - node, axis=1)) < 1e-9
    lengths = [comm.allreduce(len(tagged.sides(name))) for name in panels.edges]
    assert min(lengths) >= 4


@pytest.mark.ranks(2, 3)
def test_a_box_is_joined_along_its_edges(comm):
    up = [(x, y, 2.0) for x, y, _ in SQUARE]
    walls = tuple(Panel(f"W{i}", (SQUARE[i - 1], SQUARE[i], up[i], up[i - 1])) for i in range(4))
    tagged = build_mesh(comm, Panels((Panel("RAFT", SQUARE, edge_names=("S", "E", "N", "W")), *walls), 1.0), as_it_is)
    assert tagged.mesh.geometry.dim == 3
    # Nodes on common edges are one: 25 of the raft, and two more rings of 16.
    assert tagged.mesh.geometry.index_map().size_global == 25 + 2 * 16
    assert tagged.mesh.topology.index_map(2).size_global == 16 + 4 * 8
    # The southern edge is one of the raft and one of its wall, each of its four sides with two cells.
    assert comm.allreduce(len(tagged.sides("S"))) == comm.allreduce(len(tagged.sides("W1.1"))) == 8


@pytest.mark.ranks(2, 3)
def test_a_wall_inside_a_raft_cuts_it(comm):
    wall = Panel("WALL", ((1.0, 0.0, 0.0), (1.0, 4.0, 0.0), (1.0, 4.0, 2.0), (1.0, 0.0, 2.0)))
    tagged = build_mesh(comm, Panels((Panel("RAFT", SQUARE), wall), 1.0), as_it_is)
    assert tagged.mesh.geometry.index_map().size_global == 25 + 2 * 5
    assert len(tagged.groups["RAFT"][1]) == 2


@pytest.mark.ranks(2, 3)
def test_points_on_a_regular_grid_do_not_refine_it(comm):
    grid = tuple((float(x), float(y), 0.0) for x in range(5) for y in range(5))
    coarse = Panels((Panel("RAFT", SQUARE),), 2.0, degree=2, nodes=grid)
    assert build_mesh(comm, coarse, as_it_is).mesh.topology.index_map(2).size_global == 4
    # Off the grid they become nodes of a mesh of another pattern.
    odd = Panels((Panel("RAFT", SQUARE),), 2.0, degree=2, nodes=((1.3, 0.7, 0.0),))
    whole = gather_mesh(build_mesh(comm, odd, as_it_is))
    if whole is not None:
        assert np.min(np.linalg.norm(whole.points - odd.nodes[0], axis=1)) < 1e-12


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_cells_around_points_that_become_nodes_cover_the_plate_once(comm, cell):
    """Near an edge gmsh folds quadrilaterals around a node that it has to keep, unless it is told better: they then cover more."""
    rng = np.random.default_rng(1)
    for number in (1, 1, 1, 2, 2, 4, 9):
        nodes = tuple((x, y, 0.0) for x, y in rng.uniform(0.02, 3.98, (number, 2)).tolist())
        for size in (2.0, 1.0, 0.4):
            whole = gather_mesh(build_mesh(comm, Panels((Panel("P", SQUARE),), size, cell, nodes=nodes), as_it_is))
            if whole is not None:
                assert areas(whole).sum() == pytest.approx(16.0, rel=1e-12)
                assert max(np.min(np.linalg.norm(whole.points - node, axis=1)) for node in nodes) < 1e-9


@pytest.mark.ranks(2, 3)
def test_edges_of_one_name_are_one_group(comm):
    tagged = build_mesh(comm, Panels((Panel("P", SQUARE, edge_names=("RIM", "RIM", "N", "RIM")),), 1.0), as_it_is)
    assert [comm.allreduce(len(tagged.sides(name))) for name in ("RIM", "N")] == [12, 4]


@pytest.mark.ranks(2, 3)
def test_plates_on_each_other_are_warned_of(comm, caplog):
    other = tuple((x + 2.0, y, z) for x, y, z in SQUARE)
    panels = Panels((Panel("A", SQUARE), Panel("B", other)), 1.0)
    with caplog.at_level("WARNING"):
        tagged = build_mesh(comm, panels, as_it_is)
    assert tagged.mesh.topology.index_map(2).size_global == 24  # of 6 m x 4 m
    words = "doubt: the plates 'A' and 'B' lie on each other, in part or whole; what both cover is there once"
    assert [record.getMessage() for record in caplog.records] == [words] * (comm.rank == 0)


def test_outlines_may_turn_either_way(comm):
    """Plates half on each other, whose geometry kernel loses its way where a hole does not turn as its plate does."""
    notched = np.array([(0, 0, 0), (6, 0, 0), (6, 2, 0), (3, 2, 0), (3, 5, 0), (0, 5, 0)], dtype=float)
    opening = np.array([(1, 1, 0), (2, 1, 0), (2, 2, 0), (1, 2, 0)], dtype=float)
    beside = Panel("B", ((6.0, 0.0, 0.0), (8.0, 0.0, 0.0), (8.0, 2.0, 0.0), (6.0, 2.0, 0.0)))

    def panel(name, outline, hole):
        return Panel(name, tuple(map(tuple, outline.tolist())), (tuple(map(tuple, hole.tolist())),))

    for outline, hole in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
        shifted = panel("C", notched[::outline] + [0.5, 0, 0], opening[::hole] + [0.5, 0, 0])
        whole = gather_mesh(build_mesh(comm, Panels((panel("A", notched, opening), beside, shifted), 1.0), as_it_is))
        if whole is not None:  # 8 x 2 and 3.5 x 3 without the 0.5 x 1 that both holes share
            assert areas(whole).sum() == pytest.approx(26.0, rel=1e-12)


def test_surfaces_that_lie_on_each_other_unjoined_are_refused():
    for x, sound in ((4.0, True), (3.5, False)):
        with gmsh_session() as gmsh:
            for start in (0.0, x):
                gmsh.model.occ.addRectangle(start, 0.0, 0.0, 4.0, 4.0)
            gmsh.model.occ.synchronize()
            gmsh.model.mesh.generate(2)
            with nullcontext() if sound else pytest.raises(ModelError, match="gmsh cannot join them"):
                check_cells(gmsh.model, 1e-6)


def test_folded_cells_are_refused():
    with gmsh_session() as gmsh:
        gmsh.model.occ.addRectangle(0.0, 0.0, 0.0, 4.0, 4.0)
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(2)
        inner = gmsh.model.mesh.getNodes(2, includeBoundary=False)[0][0]
        gmsh.model.mesh.setNode(inner, [5.0, 5.0, 0.0], [])
        with pytest.raises(ModelError, match="folded"):
            check_cells(gmsh.model, 1e-6)


@pytest.mark.parametrize(
    ("plates", "size", "key", "words"),
    [
        ([("P", 0.0), ("Q", 1e9)], 1.0, "plates", "longer than 1000 m"),
        ([("P", 0.0)], 1e-6, "size", r"at most 1e\+08 cells"),
        ([("P.1", 0.0), ("P", 5.0)], 1.0, "plates[P].edges", "that no plate has, got 'P.1'"),
    ],
)
def test_plates_that_no_mesh_fits_are_refused(plates, size, key, words):
    with pytest.raises(ModelError, match=words) as error:
        Panels(tuple(Panel(name, tuple((x, y, z + height) for x, y, z in SQUARE)) for name, height in plates), size)
    assert error.value.key == key


def test_a_strip_narrower_than_its_cells_is_counted_along():
    strip = Panel("P", ((0.0, 0.0, 0.0), (1000.0, 0.0, 0.0), (1000.0, 0.1, 0.0), (0.0, 0.1, 0.0)))
    assert Panels((strip,), 1.0).cells == pytest.approx(1000.1)
    assert Panels((Panel("P", SQUARE),), 0.5).cells == pytest.approx(64)


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"corners": SQUARE[:2]}, "corners", "at least 3"),
        ({"corners": ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0))}, "corners", "on a line"),
        ({"corners": (*SQUARE[:3], (0.0, 4.0, 1.0))}, "corners", "in one plane"),
        ({"corners": (SQUARE[0], SQUARE[2], SQUARE[1], (0.0, 3.0, 0.0))}, "corners", "cross"),
        ({"edge_names": ("S", "E")}, "edges", "4 names"),
        ({"holes": ((SQUARE[0], SQUARE[1]),)}, "holes[1]", "at least 3"),
    ],
)
def test_impossible_panels_are_refused_by_key(change, key, words):
    with pytest.raises(ModelError, match=words) as error:
        Panel(**({"name": "P", "corners": SQUARE} | change))
    assert error.value.key == key


@pytest.mark.parametrize("suffix", [".msh", ".med"])
def test_a_written_mesh_is_read_again(comm, tmp_path, suffix):
    wall = Panel("WALL", ((1.0, 0.0, 0.0), (1.0, 4.0, 0.0), (1.0, 4.0, 2.0), (1.0, 0.0, 2.0)))
    panels = Panels((Panel("RAFT", SQUARE, edge_names=("S", "E", "N", "W")), wall), 1.0)
    path = tmp_path / f"joined plates{suffix}"
    assert write_mesh(panels, path) == 16 + 8
    tagged = build_mesh(comm, MeshFile(path), as_it_is)
    assert {name: d for name, (d, _) in tagged.groups.items()} == {
        "RAFT": 2, "WALL": 2, **dict.fromkeys(("S", "E", "N", "W", "WALL.1", "WALL.2", "WALL.3", "WALL.4"), 1)
    }
    assert (len(tagged.cells("RAFT")), len(tagged.cells("WALL")), len(tagged.facets("N"))) == (16, 8, 4)


def test_files_that_are_no_mesh_of_plates_are_refused(comm, tmp_path):
    with pytest.raises(ModelError, match=".msh or .med"):
        MeshFile(tmp_path / "plate.stl")
    with pytest.raises(ModelError, match="there is no file"):
        MeshFile(tmp_path / "plate.msh")
    for suffix, content in ((".msh", b"$MeshFormat\nnonsense"), (".med", b"nonsense"), (".msh", b"")):
        path = tmp_path / f"plate{suffix}"
        path.write_bytes(content)
        with pytest.raises(ModelError) as error:
            build_mesh(comm, MeshFile(path), as_it_is)
        assert error.value.key == "mesh.file"
    mixed = tmp_path / "mixed.msh"
    mixed.write_text(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 2 0 0\n$EndNodes\n"
        "$Elements\n2\n1 3 2 1 1 1 2 3 4\n2 2 2 1 1 2 5 3\n$EndElements\n"
    )
    with pytest.raises(ModelError, match="triangles alone or quadrilaterals alone"):
        build_mesh(comm, MeshFile(mixed), as_it_is)


def test_plates_that_gmsh_does_not_join_are_refused():
    """A wall on the middle line of a raft, which a regular mesh of the raft passes over."""
    with gmsh_session() as gmsh:
        occ, mesh = gmsh.model.occ, gmsh.model.mesh
        raft = occ.addRectangle(0.0, 0.0, 0.0, 8.0, 6.0)
        corners = [occ.addPoint(*at) for at in ((1.7, 2.8, 0.0), (5.9, 2.8, 0.0), (5.9, 2.8, 4.0), (1.7, 2.8, 4.0))]
        wall = occ.addPlaneSurface([occ.addCurveLoop([occ.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)])])
        (raft_pieces, wall_pieces) = occ.fragment([(2, raft)], [(2, wall)])[1]
        occ.synchronize()
        mesh.setTransfiniteSurface(raft_pieces[0][1])
        mesh.generate(2)
        with pytest.raises(ModelError, match=r"the plate 'RAFT' is not joined at .*, 2.8, 0\) m"):
            check_plates_joined(gmsh.model, {"RAFT": raft_pieces, "WALL": wall_pieces})


ARRANGEMENTS = {
    "inside": [((1.7, 2.8), (5.9, 2.8))], "slanting": [((1.7, 2.2), (5.9, 4.8))], "from the rim": [((0.0, 2.8), (5.9, 2.8))],
    "T": [((1.0, 2.8), (6.0, 2.8)), ((3.3, 2.8), (3.3, 5.0))], "crossing": [((1.0, 2.8), (6.0, 2.8)), ((3.3, 1.0), (3.3, 5.0))],
    "L": [((1.0, 2.8), (6.0, 2.8)), ((6.0, 2.8), (6.0, 5.0))],
}


@pytest.mark.parametrize("foot", [0.0, -1.0])
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
@pytest.mark.parametrize("lines", ARRANGEMENTS.values(), ids=ARRANGEMENTS)
def test_walls_share_the_nodes_of_the_raft_they_stand_on_or_pass_through(comm, lines, cell, foot):
    raft = Panel("RAFT", ((0.0, 0.0, 0.0), (8.0, 0.0, 0.0), (8.0, 6.0, 0.0), (0.0, 6.0, 0.0)))
    walls = [Panel(f"W{i}", ((*a, foot), (*b, foot), (*b, 2.0), (*a, 2.0))) for i, (a, b) in enumerate(lines)]
    node = (0.5 * (lines[0][0][0] + lines[0][1][0]), 0.5 * (lines[0][0][1] + lines[0][1][1]), 0.0)  # on the line that raft and wall share
    tagged = build_mesh(comm, Panels((raft, *walls), 0.9, cell, nodes=(node, (1.234, 1.345, 0.0))), as_it_is)
    assert tagged.parts == ()
    whole = gather_mesh(tagged)
    if whole is not None:
        # Where nodes are shared there is one at each place, and each side of a wall on the raft is one of the raft as well.
        assert len(np.unique(np.round(whole.points, 6), axis=0)) == len(whole.points)
        high = np.abs(whole.points[whole.corners][..., 2]).max(axis=1) > 1e-9
        of_raft, of_walls = ({tuple(sorted(side)) for side in sides.tolist()} for sides in (sides_on(whole, ~high), sides_on(whole, high)))
        assert of_walls and of_walls <= of_raft
        assert np.min(np.linalg.norm(whole.points - node, axis=1)) < 1e-9


def sides_on(whole, chosen):
    """Sides (n, 2) in the plane Z = 0 of the chosen cells."""
    corners = whole.corners[chosen]
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    return sides[np.all(np.abs(whole.points[sides][..., 2]) < 1e-9, axis=1)]


def test_parts_of_a_mesh_are_named(comm):
    upper = Panel("UPPER", tuple((x, y, z + 3.0) for x, y, z in SQUARE))
    parts = build_mesh(comm, Panels((Panel("LOWER", SQUARE), upper), 1.0), as_it_is).parts
    assert sorted(part.name for part in parts) == ["'LOWER'", "'UPPER'"]
