"""What joints, springs and masses add to a system, without a mesh: two nodes 2 m apart, by hand calculation."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from uplift.forms.contact import joint_matrices
from uplift.forms.contact.ground_forces import resultants, spring_forces
from uplift.forms.contact.placement import place
from uplift.forms.contact.rigid_motions import foot_middle
from uplift.forms.contact.supports import Spring, Support
from uplift.forms.parameters import Mass, PlateModel
from uplift.forms.shells.material import Material
from uplift.meshes.checked import ModelError

FEET = ((0.0, 0.0), (2.0, 0.0))
MODEL = PlateModel(
    Material(young=1.0, poisson=0.0, density=1.0, thickness=1.0),
    # Springs of 4 and 12 N/m in series along Y make 3 N/m, of 5 and 20 N/m along X make 4 N/m; the second foot carries half as much.
    supports=(Support("S", FEET, (5.0, 4.0), (20.0, 12.0), mass=0.7, gap=0.1, sideways="released", shares=(1.0, 0.5)),),
    springs=(Spring("T", (FEET[1],), (3.0, 0.0)),),
    masses=(Mass("W", (FEET[0],), 2.0),),
)
LIFT = np.array([0.0, 1.0, 0.0, 1.0])


def of_rows(rows, extra):
    """Rows of the plate's four dofs DX, DY of node 0, DX, DY of node 1, and then of the joints."""
    free = max(rows) + 1
    return SimpleNamespace(local_row=np.array(rows), n_local=free + extra, extra_row=lambda number: free + number, comm=MPI.COMM_SELF)


@pytest.fixture
def standing(monkeypatch):
    at = {(*foot, 0.0): node for node, foot in enumerate(FEET)}
    monkeypatch.setattr("uplift.forms.contact.placement.owned_nodes", lambda space, points, what: np.array([at[tuple(p)] for p in points]))
    return place(None, ("DX", "DY"), "plane stress", MODEL)


def condensed(matrix):
    """A stiffness without the joints' own dofs, and their displacements under a lift of the plate by 1 m."""
    plate, joints = slice(0, 4), slice(4, None)
    follow = -np.linalg.solve(matrix[joints, joints], matrix[joints, plate])
    return matrix[plate, plate] + matrix[plate, joints] @ follow, np.concatenate([LIFT, follow @ LIFT])


def test_stiffness_is_that_of_springs_in_series(standing):
    bonded, unilateral, _ = joint_matrices.entries(standing, of_rows(range(4), standing.n_extra))
    stiffness, _ = condensed((bonded + unilateral).toarray())
    assert stiffness == pytest.approx(np.diag([4.0, 3.0, 2.0 + 3.0, 1.5]), abs=1e-14)
    assert bonded.nnz == 1  # the plain spring: sideways forces are released with their contact


def test_masses_move_with_the_plate(standing):
    numbering = of_rows(range(4), standing.n_extra)
    mass = joint_matrices.entries(standing, numbering)[2].toarray()
    lift = np.concatenate([LIFT, np.zeros(standing.n_extra)])  # contacts that are not strained
    assert lift @ mass @ lift == pytest.approx(2.0 + 0.7 * 1.5)
    inertia = joint_matrices.inertia(standing, numbering, 1, np.zeros(3))
    assert inertia == pytest.approx(mass @ lift)
    # Rotation about Z through the first foot lifts the second one by 2 m.
    assert joint_matrices.inertia(standing, numbering, 5, np.zeros(3))[[1, 3]] == pytest.approx([0.0, 2 * 0.7 * 0.5])


def test_contacts_come_before_their_sideways_forces(standing):
    numbering = of_rows(range(4), standing.n_extra)
    contacts = joint_matrices.contacts(standing, numbering)
    assert contacts.law.owner.tolist() == [0, 1, 0, 1] and len(contacts.names) == 2
    assert contacts.law.stiffness == pytest.approx([12.0, 6.0, 20.0, 10.0])
    assert contacts.law.flexibility == pytest.approx([1 / 3, 1 / 1.5, 1 / 4, 1 / 2])
    assert contacts.law.mass == pytest.approx([0.7, 0.35, 0.7, 0.35])
    bonded, unilateral, _ = joint_matrices.entries(standing, numbering)
    _, lifted = condensed((bonded + unilateral).toarray())
    assert contacts.law.tension(contacts.elongation.partial(lifted)) == pytest.approx([3.0, 1.5, 0.0, 0.0])
    assert contacts.push.toarray()[:4] == pytest.approx(np.eye(4)[:, [1, 3, 0, 2]])


def test_the_ground_pulls_a_lifted_plate_down(standing):
    numbering = of_rows(range(4), standing.n_extra)
    bonded, unilateral, _ = joint_matrices.entries(standing, numbering)
    _, lifted = condensed((bonded + unilateral).toarray())
    found = spring_forces(resultants("plane stress", [None, "S", "T"]), standing, numbering, foot_middle(MODEL))
    # 3 N at 1 m to the left of the middle and 1.5 N at 1 m to the right of it, both downwards.
    assert found.rows @ lifted == pytest.approx([0.0, -4.5, 3.0 - 1.5, 0.0, -4.5, 3.0 - 1.5, 0.0, 0.0, 0.0])
    # The ground lies 0.1 m lower than the plate: its springs of 4 and 2 N/m pull with 0.4 N and 0.2 N.
    assert found.constant == pytest.approx([0.0, -0.6, 0.4 - 0.2, 0.0, -0.6, 0.4 - 0.2, 0.0, 0.0, 0.0])


def test_what_a_condition_holds_has_no_entries_and_no_contact_under_it(standing):
    held = of_rows([0, 1, -1, 2], standing.n_extra)  # DX of the second foot
    bonded, unilateral, _ = joint_matrices.entries(standing, held)
    assert bonded.nnz == 0 and (bonded + unilateral).shape == (3 + 4, 3 + 4)
    with pytest.raises(ModelError, match=r"a condition holds the plate at \(2, 0\) m") as error:
        standing.refuse_held(np.array([3]), MPI.COMM_SELF)
    assert error.value.key == "supports.S.unilateral"
