import meshio
import numpy as np
import pytest
from mpi4py import MPI

from uplift.meshes.checked import ModelError
from uplift.meshes.export import write_mesh
from uplift.meshes.gather import gather_mesh
from uplift.meshes.plate import EDGES, Plate
from uplift.meshes.tagged import build_mesh


def in_plane(flat, order, level):
    assert flat
    return 2, order


def shoelace(corners):
    x, y = corners[..., 0], corners[..., 1]
    return 0.5 * np.sum(x * np.roll(y, -1, axis=-1) - y * np.roll(x, -1, axis=-1), axis=-1)


@pytest.mark.both
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.ranks(2, 3)
def test_structured_plate_has_its_cells_groups_and_area(comm, cell, degree):
    plate = Plate(3.0, 5.0, 3, 7, cell, degree)
    tagged = build_mesh(comm, plate, lambda flat, order, level: (2, degree))
    per_square = 1 if cell == "quadrilateral" else 2
    assert tagged.mesh.topology.index_map(2).size_global == 21 * per_square
    assert tagged.mesh.geometry.index_map().size_global == (3 * degree + 1) * (7 * degree + 1)
    facets = tagged.mesh.topology.index_map(1)
    owned = {edge: int(np.sum(tagged.facets(edge) < facets.size_local)) for edge in EDGES}
    assert [comm.allreduce(owned[edge]) for edge in EDGES] == [3, 7, 3, 7]
    assert tagged.groups["DAL1"][0] == 2
    assert {n: tuple(p[0]) for n, p in tagged.points.items()} == plate.corners
    whole = gather_mesh(tagged)
    if comm.rank == 0:
        area = shoelace(whole.points[whole.corners][..., :2])
        assert np.all(np.abs(area) > 0.1)
        assert abs(np.sum(np.abs(area)) - 15.0) < 1e-12
    else:
        assert whole is None


@pytest.mark.ranks
def test_unknown_groups_are_named(comm):
    tagged = build_mesh(comm, Plate(1.0, 1.0, 2, 2), in_plane)
    with pytest.raises(ModelError, match="no edge group 'DBASE'.*DBAS"):
        tagged.facets("DBASE")
    with pytest.raises(ModelError, match="no point group 'P9'.*P1"):
        tagged.point("P9")


@pytest.mark.parametrize("suffix", [".msh", ".vtu", ".xdmf", ".med"])
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_written_mesh_is_read_back_with_its_groups(tmp_path, suffix, cell, capsys):
    path = tmp_path / ("plate" + suffix)
    write_mesh(Plate(4.0, 8.0, 4, 8, cell), path)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    mesh = meshio.read(path)
    surface = "quad" if cell == "quadrilateral" else "triangle"
    assert sum(len(b.data) for b in mesh.cells if b.type == surface) == (32 if surface == "quad" else 64)
    assert len(mesh.points) == 45
    names = {"DAL1", "DBAS", "DDRO", "DHAU", "DGAU", "P1", "P2", "P3", "P4"}
    if suffix == ".msh":
        assert set(mesh.field_data) == names
    elif suffix == ".med":
        assert {n for tags in mesh.cell_tags.values() for n in tags} == names
    else:
        assert len(mesh.cell_data["group"]) == len(mesh.cells)


def test_mesh_file_of_unknown_format_is_refused(tmp_path):
    with pytest.raises(ModelError, match=".msh, .vtu, .xdmf, .med"):
        write_mesh(Plate(4.0, 8.0, 4, 8), tmp_path / "plate.stl")
    with pytest.raises(ModelError, match="nine-node"):
        write_mesh(Plate(4.0, 8.0, 4, 8, degree=2), tmp_path / "plate.med")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"width": -4.0}, "width"), ({"nx": 0}, "nx"), ({"cell": "hexagon"}, "cell"), ({"degree": 4}, "degree"),
        ({"height": np.inf}, "height"),
    ],
)
def test_impossible_plates_are_refused_by_key(values, key):
    with pytest.raises(ModelError) as error:
        Plate(**({"width": 4.0, "height": 8.0, "nx": 4, "ny": 8} | values))
    assert error.value.key == key


@pytest.mark.ranks(2, 3)
def test_group_names_are_the_same_on_all_ranks(comm):
    tagged = build_mesh(comm, Plate(1.0, 2.0, 2, 3), in_plane)
    everywhere = MPI.COMM_WORLD.allgather(sorted(tagged.groups.items()))
    assert all(groups == everywhere[0] for groups in everywhere)
