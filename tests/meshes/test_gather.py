from dataclasses import replace

import numpy as np
import pytest

from uplift.drivers.analysis.assembled_scene import prepare
from uplift.meshes.gather import gather_mesh, gather_nodal

pytestmark = pytest.mark.both


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.ranks(2, 3)
def test_coordinates_come_back_at_their_nodes(sdls119a, comm, cell, degree):
    scene = replace(sdls119a, plate=replace(sdls119a.plate, cell=cell, degree=degree))
    with prepare(scene, comm) as assembly:
        space = assembly.plate.space
        mesh, values = gather_mesh(assembly.tagged), gather_nodal(assembly.tagged, space, space.tabulate_dof_coordinates())
    if comm.rank == 0:
        assert len(values) == len(mesh.points) == (4 * degree + 1) * (8 * degree + 1)
        assert np.max(np.abs(values - mesh.points)) < 1e-14 * 8
