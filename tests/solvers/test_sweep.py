"""The sweep by groups of ranks against dense algebra on every rank, and its checkpoints."""

import numpy as np
import pytest

from tests.small import to_dense
from uplift.meshes.checked import ModelError
from uplift.solvers.frequency_domain.groups import Layout, choose_groups
from uplift.solvers.frequency_domain.harmonic import harmonic_sweep

OMEGA = 2 * np.pi * np.array([0.0, 1.8, 5.0, 11.0, 24.0])


def on_all_ranks(functionals, comm):
    return np.concatenate(comm.allgather(functionals.local.toarray()), axis=1)


def dense_answers(operators):
    """Answers (n_points, n, n_columns) by dense algebra, the whole of them on every rank."""
    comm = operators.comm
    columns = [np.concatenate(comm.allgather(load.vector.array)) for load in operators.loads]
    push = np.concatenate(comm.allgather(operators.contacts.push.toarray()))
    right = np.column_stack([*columns, push])
    stiffness, mass, damping = (to_dense(m) for m in (operators.stiffness, operators.mass, operators.damping))
    scale = 1 / np.sqrt(np.abs(np.diag(stiffness)))
    answers = []
    for omega in OMEGA:
        matrix = stiffness + 1j * omega * damping - omega**2 * mass
        answers.append(scale[:, None] * np.linalg.solve(scale[:, None] * matrix * scale, scale[:, None] * right))
    return np.array(answers)


def difference(here, exact):
    return np.max(np.abs(here - exact)) / np.max(np.abs(exact))


@pytest.mark.complex
@pytest.mark.ranks(2, 3)
def test_any_number_of_groups_equals_dense_algebra(assembly, comm):
    operators = assembly.operators
    exact = dense_answers(operators)
    first = sum(comm.allgather(operators.n_local)[: comm.rank])
    for groups in (None, *range(1, comm.size + 1)):
        transfer = harmonic_sweep(operators, OMEGA, groups=groups)
        for functionals, here in (
            (operators.probes, transfer.probes),
            (operators.contacts.elongation, transfer.elongation),
            (operators.reactions, transfer.group("reactions")),
        ):
            assert here.shape == (len(OMEGA), len(functionals.names), exact.shape[2])
            assert difference(here, on_all_ranks(functionals, comm) @ exact) < 1e-9
        assert difference(transfer.fields.transpose(0, 2, 1), exact[:, first : first + operators.n_local]) < 1e-9


@pytest.mark.complex
@pytest.mark.ranks(2, 3)
def test_more_groups_than_points(assembly, comm):
    operators = assembly.operators
    exact = on_all_ranks(operators.probes, comm) @ dense_answers(operators)[:1]
    transfer = harmonic_sweep(operators, OMEGA[:1], groups=comm.size)
    assert difference(transfer.probes, exact) < 1e-9
    with pytest.raises(ModelError, match="--groups: expected 1 to"):
        harmonic_sweep(operators, OMEGA, groups=comm.size + 1)


class FewRanks:
    """As much of a communicator as a layout asks for."""

    def __init__(self, rank, size):
        self.rank, self.size = rank, size


@pytest.mark.both
@pytest.mark.parametrize(("size", "groups"), [(1, 1), (4, 2), (5, 2), (7, 3), (6, 6)])
def test_every_group_holds_all_rows_once(size, groups):
    layouts = [Layout(FewRanks(rank, size), groups, None) for rank in range(size)]
    for group in range(groups):
        members = [layout for layout in layouts if layout.group == group]
        assert [layout.world.rank for layout in members] == list(layouts[0].ranks(group))
        assert [rank for layout in members for rank in layout.held()] == list(range(size))
        assert all(layout.holder(group, layout.world.rank) == layout.holders()[group] for layout in layouts)


@pytest.mark.both
def test_groups_follow_from_points_and_memory():
    world = FewRanks(0, 12)
    assert choose_groups(world, 1000, 1.0, 10.0) == 12
    assert choose_groups(world, 1000, 30.0, 10.0) == 4
    assert choose_groups(world, 5, 1.0, 10.0) == 4
    assert choose_groups(world, 1000, 1e9, 10.0) == 1
