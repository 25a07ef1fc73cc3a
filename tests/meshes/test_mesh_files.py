import h5py
import numpy as np
import pytest

from tests.mesh_files import grid, msh2, quads
from uplift.meshes.checked import ModelError
from uplift.meshes.imported import MeshFile, read_mesh_file
from uplift.meshes.parts import names_of_parts, part_of_cells

SLAB = (2, 1, "SLAB")


def read(tmp_path, points, elements, names=(SLAB,), **options):
    path = tmp_path / "mesh.msh"
    path.write_text(msh2(points, elements, names), encoding="utf-8")
    return read_mesh_file(MeshFile(path, **options))


def refused(tmp_path, words, points, elements, names=(SLAB,), **options):
    with pytest.raises(ModelError, match=words) as error:
        read(tmp_path, points, elements, names, **options)
    assert len(str(error.value).splitlines()) == 1


def two_halves(gap=0.0):
    """Two slabs of 2 m x 2 m side by side, each with nodes of its own along x = 2 m, `gap` m apart."""
    (left, a), (right, b) = grid(2, 2), grid(2, 2, at=(2.0 + gap, 0.0, 0.0))
    return np.concatenate([left, right]), quads(a, 1, 1) + quads(b + len(left), 2, 2)


HALVES = ((2, 1, "LEFT"), (2, 2, "RIGHT"), (1, 3, "JOINT"))


def test_nodes_at_one_place_are_named_and_can_be_merged(tmp_path):
    points, elements = two_halves()
    refused(tmp_path, r"3 pairs of nodes lie at one place .* \(2, 0, 0\) m \(cells of 'LEFT' and 'RIGHT'\); merge = true", points, elements,
            HALVES)
    whole = read(tmp_path, points, elements, HALVES, merge=True)
    assert len(whole.points) == 15 and part_of_cells(whole.corners).max() == 0
    assert [len(whole.cell_groups[name]) for name in ("LEFT", "RIGHT")] == [4, 4]


def test_a_crack_that_is_declared_stays_open(tmp_path):
    points, elements = two_halves()
    joint = [(1, 3, 3, (2, 5)), (1, 3, 3, (5, 8))]  # the right edge of the left half
    whole = read(tmp_path, points, elements + joint, HALVES, cracks=("JOINT",))
    assert len(whole.points) == 18 and names_of_parts(whole, part_of_cells(whole.corners)) == ["'LEFT'", "'RIGHT'"]
    refused(tmp_path, "no group 'NONE'", points, elements, HALVES, cracks=("NONE",))
    with pytest.raises(ModelError, match="not both"):
        MeshFile(tmp_path / "mesh.msh", merge=True, cracks=("JOINT",))


def test_a_slit_inside_a_plate_is_found(tmp_path):
    """Four cells around a node, two of which have a copy of it: the mesh hangs together all the same."""
    points, cells = grid(2, 2)
    cells = cells.copy()
    cells[2:][cells[2:] == 4] = 9
    refused(tmp_path, "1 pairs of nodes lie at one place", np.vstack([points, points[4]]), quads(cells))


def test_free_edges_that_nearly_touch_are_said(tmp_path, caplog):
    points, elements = two_halves(gap=0.001)
    with caplog.at_level("WARNING"):
        read(tmp_path, points, elements, HALVES)
    assert any("doubt: a free edge" in r.getMessage() and "0.001 m from a cell" in r.getMessage() for r in caplog.records)


def test_hanging_nodes_are_refused(tmp_path):
    """Cells of 1 m beside cells of 0.5 m: every other node of these lies on a side of those."""
    (coarse, a), (fine, b) = grid(1, 1), grid(2, 2, size=0.5, at=(1.0, 0.0, 0.0))
    same = {0: 1, 6: 3}  # the ends of the common edge
    number = [same.get(i, len(coarse) + i) for i in range(len(fine))]
    kept = [i for i in range(len(coarse) + len(fine)) if i not in (4, 10)]
    index = {old: new for new, old in enumerate(kept)}
    points = np.concatenate([coarse, fine])[kept]
    cells = [[index[n] for n in cell] for cell in [*a.tolist(), *(np.array(number)[b]).tolist()]]
    refused(tmp_path, r"a node at \(1, 0.5, 0\) m .* lies on a cell of 'SLAB' that does not have it", points, quads(cells))


def test_a_wall_that_stands_on_a_raft_without_its_nodes_is_refused(tmp_path):
    raft, a = grid(4, 4)
    wall = np.array([(0.5, 1.5, 0), (2.5, 1.5, 0), (2.5, 1.5, 2), (0.5, 1.5, 2)])
    points = np.concatenate([raft, wall])
    refused(tmp_path, r"\(0.5, 1.5, 0\) m \(cells of 'WALL'\) lies on a cell of 'SLAB'", points,
            quads(a) + [(3, 2, 2, range(25, 29))], (SLAB, (2, 2, "WALL")))


@pytest.mark.parametrize(
    ("cell", "moved", "words"),
    [
        ((0, 4, 1, 3), {}, "has sides that cross"),
        ((0, 1, 4, 3), {4: (0.3, 0.3, 0)}, "is not convex"),
        ((0, 1, 4, 3), {4: (0.5, 0.5, 0)}, "has three corners on a line"),
        ((0, 1, 4, 3), {4: (2, 0, 0), 3: (3, 0, 0)}, "has no area"),
        ((0, 1, 4, 4), {}, "has one node twice"),
    ],
)
def test_cells_that_no_element_can_live_on_are_refused(tmp_path, cell, moved, words):
    points = np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0)], dtype=float)
    for node, at in moved.items():
        points[node] = at
    refused(tmp_path, words, points, [(3, 1, 1, cell)])


def test_a_cell_that_turns_the_other_way_is_a_cell(tmp_path):
    points, cells = grid(2, 1)
    cells[1] = cells[1][::-1]
    assert len(read(tmp_path, points, quads(cells)).cells) == 2


def test_cells_on_each_other_and_nodes_far_outside_are_said(tmp_path, caplog):
    # Two triangles on one side of their common side, neither with a corner in the other.
    points = np.array([(0, 0, 0), (1, 0, 0), (0.2, 1, 0), (0.8, 1, 0)])
    with caplog.at_level("WARNING"):
        read(tmp_path, points, [(2, 1, 1, (0, 1, 2)), (2, 2, 2, (0, 1, 3))], (SLAB, (2, 2, "PATCH")))
    assert "doubt: cells of 'SLAB', 'PATCH' lie on each other around" in caplog.text
    (one, a), (other, b) = grid(1, 1), grid(1, 1, size=0.9, at=(0.05, 0.05, 0.0))
    refused(tmp_path, r"a node at \(0.05, 0.05, 0\) m .* lies on a cell of 'SLAB'", np.concatenate([one, other]), quads(a) + quads(b + 4))
    points, cells = grid(8, 4)
    points[0] = (-1e5, 0, 0)
    caplog.clear()
    with caplog.at_level("WARNING"):
        read(tmp_path, points, quads(cells))
    assert any("may lie far outside" in record.getMessage() for record in caplog.records)


def test_lines_that_are_no_side_are_refused(tmp_path):
    points, cells = grid(2, 2)
    refused(tmp_path, "1 lines of the group 'BASE' are no side of a cell, the first around .0.5, 0.5, 0. m", points,
            [*quads(cells), (1, 2, 2, (0, 1)), (1, 2, 2, (0, 4))], (SLAB, (1, 2, "BASE")))


def test_volume_cells_and_cells_of_eight_nodes_are_refused_by_name(tmp_path):
    points = np.array([(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=float)
    refused(tmp_path, "volume cells", points, [(5, 1, 1, range(8)), (3, 1, 2, range(4))])
    refused(tmp_path, "quadrilaterals of 8 nodes, which are not read", points, [(16, 1, 1, range(8))])


def test_a_cell_of_two_groups_stands_there_twice(tmp_path):
    points, cells = grid(4, 1)
    whole = read(tmp_path, points, quads(cells[2:], 1, 2) + quads(cells[:2], 2, 1) + quads(cells[:2], 1, 1), (SLAB, (2, 2, "LEFT")))
    middles = {name: whole.points[whole.cells[members]].mean(axis=1)[:, 0] for name, members in whole.cell_groups.items()}
    assert sorted(middles["SLAB"]) == [0.5, 1.5, 2.5, 3.5] and sorted(middles["LEFT"]) == [0.5, 1.5]
    refused(tmp_path, "1 cells are there twice", points, quads(cells) + quads(cells[:1]))


def test_a_line_of_two_groups_is_one_line(tmp_path):
    points, cells = grid(4, 1)
    lines = [(1, 2, 2, (x, x + 1)) for x in range(4)] + [(1, 3, 2, (x + 1, x)) for x in range(2)]
    whole = read(tmp_path, points, [*quads(cells), *lines], (SLAB, (1, 2, "BASE"), (1, 3, "HALF")))
    assert len(whole.lines) == 4 and {n: m.tolist() for n, m in whole.line_groups.items()} == {"BASE": [0, 1, 2, 3], "HALF": [0, 1]}


def test_groups_without_names_bear_their_numbers(tmp_path):
    points, cells = grid(2, 2)
    elements = [*quads(cells, 7), (1, 5, 2, (0, 1)), (15, 3, 3, (4,)), (15, 3, 3, (8,))]
    whole = read(tmp_path, points, elements, ((2, 7, ""), (0, 3, "PILES")))
    assert {n: m.tolist() for n, m in whole.cell_groups.items()} == {"7": [0, 1, 2, 3]}
    assert (whole.line_groups["5"].tolist(), whole.point_groups["PILES"].tolist()) == ([0], [4, 8])
    assert not read(tmp_path, points, quads(cells, 0), ()).cell_groups


def test_a_name_in_two_dimensions_is_that_of_the_higher(tmp_path, caplog):
    points, cells = grid(2, 2)
    with caplog.at_level("WARNING"):
        whole = read(tmp_path, points, [*quads(cells), (1, 2, 2, (0, 1))], (SLAB, (1, 2, "SLAB")))
    assert "SLAB" in whole.cell_groups and not whole.line_groups
    assert "note: the name 'SLAB' is one of surfaces and of lines" in caplog.text


def test_nodes_of_no_cell_are_left_out_and_said(tmp_path, caplog):
    points, cells = grid(2, 2)
    with caplog.at_level("WARNING"):
        whole = read(tmp_path, np.vstack([[(0.3, 0.3, 0)], points]), [*quads(cells + 1), (15, 2, 2, (0,))], (SLAB, (0, 2, "CENTRE")))
    assert len(whole.points) == 9 and not whole.point_groups and "1 nodes of no cell are left out" in caplog.text
    assert whole.points[whole.cells].mean(axis=1)[0].tolist() == [0.5, 0.5, 0.0]


@pytest.mark.parametrize("version", ["2.2", "4.1"])
@pytest.mark.parametrize("binary", [0, 1])
def test_the_formats_of_gmsh_agree(tmp_path, version, binary):
    import gmsh

    from uplift.meshes.gmsh_session import gmsh_session

    points, cells = grid(3, 2)
    elements = [*quads(cells), (1, 2, 2, (0, 1)), (1, 2, 2, (1, 2)), (15, 3, 3, (11,))]
    plain = read(tmp_path, points, elements, (SLAB, (1, 2, "BASE"), (0, 3, "TOP")))
    with gmsh_session():
        gmsh.open(str(tmp_path / "mesh.msh"))
        gmsh.option.setNumber("Mesh.MshFileVersion", float(version))
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(tmp_path / "again.msh"))
    again = read_mesh_file(MeshFile(tmp_path / "again.msh"))
    middles = [sorted(map(tuple, mesh.points[mesh.cells].mean(axis=1).tolist())) for mesh in (again, plain)]
    assert middles[0] == middles[1]
    for kind in ("cell_groups", "line_groups", "point_groups"):
        assert {n: len(m) for n, m in getattr(again, kind).items()} == {n: len(m) for n, m in getattr(plain, kind).items()}
    assert again.points[again.point_groups["TOP"]].tolist() == [[3.0, 2.0, 0.0]]


def write_med(path, points, cells, families, of_cells, of_nodes=None):
    """A MED file of quadrilaterals; families: number -> names of groups, None for one without GRO."""
    with h5py.File(path, "w") as file:
        step = file.create_group("ENS_MAA/mesh/-0000000000000000001-0000000000000000001")
        for name, values in (("NOE/COO", points.T.ravel()), ("NOE/FAM", of_nodes), ("MAI/QU4/NOD", cells.T.ravel() + 1),
                             ("MAI/QU4/FAM", of_cells)):
            if values is not None:
                step.create_dataset(name, data=values)
        step["NOE/COO"].attrs["NBR"] = len(points)
        for number, names in families.items():
            family = file.create_group(f"FAS/mesh/{'ELEME' if number < 0 else 'NOEUD'}/FAM_{number}")
            family.attrs["NUM"] = number
            if names is not None:
                texts = np.array([list(name.encode().ljust(80, b"\0")) for name in names], dtype="i1")
                family.create_dataset("GRO/NOM", data=texts)


def test_med_groups_of_nodes_and_families_without_groups(tmp_path):
    points, cells = grid(2, 2)
    of_nodes = np.zeros(9, dtype=int)
    of_nodes[[0, 2, 6, 8]] = 1
    write_med(tmp_path / "mesh.med", points, cells, {-1: ["SLAB", "LEFT"], -2: ["SLAB"], -3: None, 1: ["PILES"]},
              np.array([-1, -2, -1, -3]), of_nodes)
    whole = read_mesh_file(MeshFile(tmp_path / "mesh.med"))
    assert {n: len(m) for n, m in whole.cell_groups.items()} == {"SLAB": 3, "LEFT": 2}
    assert whole.point_groups["PILES"].tolist() == [0, 2, 6, 8] and len(whole.cells) == 4
    write_med(tmp_path / "bare.med", points, cells, {}, None)
    assert not read_mesh_file(MeshFile(tmp_path / "bare.med")).cell_groups


def test_a_file_that_claims_more_than_it_holds_ends_in_one_line(tmp_path):
    path = tmp_path / "mesh.med"
    points, cells = grid(2, 2)
    write_med(path, points, cells, {}, None)
    with h5py.File(path, "a") as file:
        nodes = file["ENS_MAA/mesh/-0000000000000000001-0000000000000000001/NOE"]
        del nodes["COO"]
        nodes.create_dataset("COO", shape=(3 * 10**12,), dtype="f8", chunks=(1000,))
        nodes["COO"].attrs["NBR"] = 10**12
    with pytest.raises(ModelError, match="announces more numbers than it holds"):
        read_mesh_file(MeshFile(path))
    text = msh2(points, quads(cells)).replace("$Nodes\n9", "$Nodes\n900000000000")
    (tmp_path / "mesh.msh").write_text(text, encoding="utf-8")
    with pytest.raises(ModelError, match="announces 900000000000 entries"):
        read_mesh_file(MeshFile(tmp_path / "mesh.msh"))


@pytest.mark.parametrize("before", ["", " ", "\n", "//$MeshFormat\n", "$Comments\n", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"])
def test_a_mesh_file_never_runs_a_program(tmp_path, before):
    """Scripts of gmsh, in the file, in what lies beside it and in the folder where the program is started."""
    call = f'SystemCall "touch {tmp_path}/ran";\n'
    path = tmp_path / "mesh.msh"
    path.write_text(before + call, encoding="utf-8")
    for name in ("mesh.msh.opt", "mesh.opt", ".gmshrc", ".gmsh-options"):
        (tmp_path / name).write_text(call, encoding="utf-8")
    with pytest.raises(ModelError) as error:
        read_mesh_file(MeshFile(path))
    assert error.value.key == "mesh.file" and not (tmp_path / "ran").exists()


@pytest.mark.parametrize("version", ["2.2", "4.1"])
def test_scripts_beside_a_mesh_and_in_its_comments_are_not_run(tmp_path, version):
    import gmsh

    from uplift.meshes.gmsh_session import gmsh_session

    points, cells = grid(2, 2)
    read(tmp_path, points, quads(cells))
    path = tmp_path / "again.msh"
    with gmsh_session():
        gmsh.open(str(tmp_path / "mesh.msh"))
        gmsh.option.setNumber("Mesh.MshFileVersion", float(version))
        gmsh.write(str(path))
    call = f'SystemCall "touch {tmp_path}/ran";\n'
    path.write_text(f"$Comments\n{call}$EndComments\n{path.read_text(encoding='utf-8')}", encoding="utf-8")
    (tmp_path / "again.msh.opt").write_text(call, encoding="utf-8")
    assert len(read_mesh_file(MeshFile(path)).cells) == 4 and not (tmp_path / "ran").exists()
