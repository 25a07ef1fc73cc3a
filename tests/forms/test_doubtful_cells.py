"""Pressure along the normals of cells, parts that overlap, and the lifted share of a plate that cannot lift off."""


import numpy as np
import pytest
from mpi4py import MPI

from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.scene.scene import build_scene


def two_cells(folder, first, second):
    """A mesh of two cells; group BOTH."""
    nodes = [f"{k + 1} {k % 3} {k // 3} 0" for k in range(6)]
    cells = [f"{k} 3 2 1 1 {around}" for k, around in enumerate((first, second), start=1)]
    text = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "1", '2 1 "BOTH"', "$EndPhysicalNames", "$Nodes", "6", *nodes,
            "$EndNodes", "$Elements", "2", *cells, "$EndElements", ""]
    (folder / "mesh.msh").write_text("\n".join(text), encoding="utf-8")


def scene(folder, **sections):
    table = {
        "mesh": {"file": "mesh.msh"},
        "plate": {"young": 1e9, "poisson": 0.0, "density": 1000.0, "thickness": 0.1},
        "springs": [{"name": "S", "group": "BOTH", "stiffness": {axis: 1e5 for axis in ("X", "Y", "Z", "RX", "RY", "RZ")}}],
        "probes": [{"name": "A", "point": [0.0, 0.0]}],
    }
    return prepare(build_scene(table | sections, folder), MPI.COMM_SELF)


def said(caplog):
    return [record.finding.key for record in caplog.records if hasattr(record, "finding")]


def turned(around):
    return " ".join(reversed(around.split()))


@pytest.mark.parametrize("kind", ["bending", "shell"])
@pytest.mark.parametrize(("first", "second", "force"), [(False, False, 2e3), (True, True, -2e3), (False, True, 0.0), (True, False, 0.0)])
def test_pressure_acts_along_the_normal_of_each_cell(tmp_path, caplog, kind, first, second, force):
    """1 kPa on two cells of 1 m2: a cell whose nodes go round clockwise is pressed down; neighbours that disagree are said."""
    two_cells(tmp_path, turned("1 2 5 4") if first else "1 2 5 4", turned("2 3 6 5") if second else "2 3 6 5")
    pressure = {"kind": "pressure", "name": "P", "group": "BOTH", "value": 1e3}
    with scene(tmp_path, kinematics={"kind": kind}, load=[pressure]) as made:
        along = made.plate.translations["Z"].array_r / (1000.0 * 0.1)
        lift = np.real(made.operators.loads[0].vector.array_r)[np.abs(along) > 0].sum()
    assert lift == pytest.approx(force, abs=1e-9)
    assert ("normals" in said(caplog)) == (first != second)


def test_parts_that_overlap_are_said(tmp_path, caplog):
    two_cells(tmp_path, "1 2 5 4", "2 3 6 5")
    part = {"group": "BOTH", "young": 1e9, "poisson": 0.0, "density": 2000.0, "thickness": 0.1}
    with scene(tmp_path, kinematics={"kind": "bending"}, parts=[part]):
        assert "parts" not in said(caplog)
    with scene(tmp_path, kinematics={"kind": "bending"}, parts=[part, part | {"density": 3000.0}]) as made:
        assert made.plate.total_mass == pytest.approx(2 * 0.1 * 3000.0)
    assert said(caplog).count("parts") == 1
    assert "share 2 cells" in caplog.text


def test_a_plate_that_stands_on_no_contact_has_no_lifted_share(tmp_path):
    two_cells(tmp_path, "1 2 5 4", "2 3 6 5")
    contact = {"name": "C", "points": [[0.0, 0.0]], "stiffness": {"Z": 1e5}, "contact": {"Z": 1e9}, "unilateral": "Z"}
    with scene(tmp_path, kinematics={"kind": "bending"}) as made:
        assert not made.plate.lifted_area.known
    with scene(tmp_path, kinematics={"kind": "bending"}, supports=[contact]) as made:
        assert made.plate.lifted_area.known
        assert made.plate.lifted_area.weights.sum() == pytest.approx(1.0)
