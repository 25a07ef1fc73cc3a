"""Joints stay joined, whichever ranks the plates along them go to."""

import numpy as np
import pytest

from uplift.meshes.panels import Panel, Panels
from uplift.meshes.partition import keep_joints_whole, ranks_at_vertices
from uplift.meshes.tagged import build_mesh

# Two cells side by side with a third standing on their common edge (1, 4), and a second such row above.
ROWS = np.array([(0, 1, 3, 4), (1, 2, 4, 5), (1, 9, 4, 10), (3, 4, 6, 7), (4, 5, 7, 8), (4, 10, 7, 11)])


@pytest.mark.parametrize("owners", [[0, 0, 1, 0, 0, 1], [0, 1, 1, 0, 1, 1], [1, 0, 0, 1, 0, 0]])
def test_a_joint_cut_along_its_length_goes_to_one_rank(owners):
    kept = keep_joints_whole(ROWS, np.array(owners))
    assert len(set(kept)) == 1 and kept[0] == np.bincount(owners).argmax()


@pytest.mark.parametrize("seed", range(20))
def test_each_rank_at_a_shared_vertex_holds_a_lone_side_there(seed):
    owners = keep_joints_whole(ROWS, np.random.default_rng(seed).integers(0, 3, len(ROWS)))
    for vertex in range(12):
        ranks = {owner for cell, owner in zip(ROWS, owners, strict=True) if vertex in cell}
        for rank in ranks if len(ranks) > 1 else ():
            others = [
                other
                for cell, owner in zip(ROWS, owners, strict=True)
                for i, j in ((0, 1), (0, 2), (1, 3), (2, 3))
                if owner == rank and vertex in (cell[i], cell[j])
                for other in (cell[i] + cell[j] - vertex,)
            ]
            assert min(others.count(other) for other in others) == 1


def test_what_meets_two_by_two_stays_where_it_was():
    flat = ROWS[[0, 1, 3, 4]]
    for owners in ([0, 0, 1, 1], [0, 1, 1, 0], [2, 1, 0, 1]):
        assert keep_joints_whole(flat, np.array(owners)).tolist() == owners
    # Three cells on three ranks: each sees a side of its own.
    assert keep_joints_whole(ROWS[:3], np.array([0, 1, 2])).tolist() == [0, 1, 2]


def test_plates_that_touch_in_one_node_stay_joined():
    fan = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 1, 4), (0, 5, 6)])
    assert len(set(keep_joints_whole(fan, np.array([0, 0, 0, 0, 1])))) == 1


def test_the_ranks_at_the_vertices_of_each_cell():
    owners = np.array([2, 0, 1, 0, 0, 2])
    ranks, starts = ranks_at_vertices(ROWS, owners)
    for cell, owner, i, j in zip(ROWS, owners, starts[:-1], starts[1:], strict=True):
        assert ranks[i] == owner
        assert sorted(ranks[i:j]) == sorted({o for other, o in zip(ROWS, owners, strict=True) if set(other) & set(cell)})


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
@pytest.mark.parametrize("stations", [(1.0,), (2.0,), (1.0, 2.0, 3.0), (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)])
@pytest.mark.ranks(2, 3)
def test_walls_across_a_raft_share_its_nodes(comm, stations, cell):
    raft = Panel("RAFT", ((0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (4.0, 4.0, 0.0), (0.0, 4.0, 0.0)))
    walls = tuple(
        Panel(f"WALL{i}", ((x, 0.0, 0.0), (x, 4.0, 0.0), (x, 4.0, 1.0), (x, 0.0, 1.0))) for i, x in enumerate(stations)
    )
    tagged = build_mesh(comm, Panels((raft, *walls), 0.5, cell), lambda flat, order, level: (3, 1))
    nodes = tagged.mesh.geometry.x[: tagged.mesh.geometry.index_map().size_local]
    nodes = np.concatenate(comm.allgather(nodes))
    assert len(np.unique(np.round(nodes, 9), axis=0)) == len(nodes) == tagged.mesh.geometry.index_map().size_global
    vertices = tagged.mesh.topology.index_map(0).size_global
    assert vertices == len(nodes)
