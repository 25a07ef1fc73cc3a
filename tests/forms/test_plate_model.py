from dataclasses import replace

import numpy as np
import pytest

from tests.small import quadrilateral_matrices, to_dense
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.forms.contact.supports import Spring, Support
from uplift.forms.loads.signals import Constant
from uplift.forms.parameters import GroundMotion, Part, PlateModel, Probe
from uplift.forms.shells.kinematics import Kinematics
from uplift.forms.shells.material import Material
from uplift.meshes.checked import ModelError
from uplift.meshes.plate import Plate
from uplift.solvers.time_domain.initial import static_state


def bare(scene, plate=None, **model):
    """The scene with another mesh or model."""
    return replace(scene, plate=plate or scene.plate, model=replace(scene.model, **model))


@pytest.mark.ranks
def test_reference_case_has_100_dofs_and_its_mass(assembly):
    assert assembly.operators.n == 100
    # 4 m x 8 m x 1 m of 2500 kg/m3 and five joints of 0.1 kg; a sum of some 50 terms keeps 14 digits.
    assert abs(assembly.plate.total_mass - 80_000.5) < 1e-9 * 80_000.5
    assert assembly.plate.joint_mass == pytest.approx(0.5, rel=1e-15)


@pytest.mark.ranks
def test_weight_and_ground_motion_are_mass_times_acceleration(assembly):
    gravity, motion = assembly.operators.loads
    dense = to_dense(assembly.operators.mass)
    static = static_state(assembly.operators)
    with static:
        reach = to_dense(assembly.operators.stiffness)
        assert reach.shape == dense.shape
    total = assembly.operators.comm.allreduce(float(np.sum(np.real(gravity.vector.array))))
    # Rows of joints hold the elongation of their contact, on which a weight acts with the opposite sign: 5 x 0.1 kg less.
    assert total == pytest.approx(-9.81 * (80_000.5 - 0.5), rel=1e-12)
    assert gravity.static and not motion.static


@pytest.mark.both
@pytest.mark.ranks(2, 3)
def test_static_answer_of_the_reference_case(assembly):
    with static_state(assembly.operators) as state:
        outputs = assembly.operators.outputs
        here = outputs.linear("probes", np.real(state.displacement.array_r))
        contacts = assembly.operators.contacts
        tension = contacts.law.tension(contacts.elongation.total(contacts.elongation.partial(np.real(state.displacement.array_r))))
    # DY as printed by the source to eight digits; DX, a thousandth of it, keeps fewer there.
    assert here[1] == pytest.approx(-7.0878060e-03, rel=1e-8)
    assert here[0] == pytest.approx(2.4783508e-05, rel=1e-6)
    # Equilibrium: the supports carry the weight less what the two top springs of 1 N/m take.
    assert -tension.sum() == pytest.approx(9.81 * (80_000.5 - 0.5), rel=1e-6)
    assert np.allclose(tension, tension[::-1], rtol=1e-9)


@pytest.mark.ranks
def test_matrices_are_symmetric(assembly):
    operators = assembly.operators
    for matrix in (operators.stiffness, operators.mass, operators.damping):
        dense = to_dense(matrix)
        assert np.array_equal(dense, dense.T) or np.max(np.abs(dense - dense.T)) < 1e-15 * np.max(np.abs(dense))
    assert np.linalg.eigvalsh(to_dense(operators.mass)).min() > 0


@pytest.mark.ranks(1)
def test_matrices_equal_a_hand_written_element(sdls119a, comm):
    scene = bare(sdls119a, Plate(1.0, 2.0, 1, 1), supports=(), springs=(), probes=(Probe("P3", (1.0, 2.0)),))
    with prepare(scene, comm) as assembly:
        corners = np.array([[0, 0], [1, 0], [1, 2], [0, 2]], dtype=float)
        material = scene.model.material
        expected = quadrilateral_matrices(corners, material.young, material.poisson, material.density, material.thickness)
        operators = assembly.operators
        coordinates = assembly.plate.space.tabulate_dof_coordinates()[: assembly.plate.numbering.n_field // 2, :2]
        order = np.concatenate(comm.allgather([int(np.argmin(np.linalg.norm(corners - x, axis=1))) for x in coordinates])).astype(int)
        dofs = np.stack([2 * order, 2 * order + 1], axis=1).ravel()
        for matrix, dense in zip((operators.stiffness, operators.mass), expected, strict=True):
            assert np.max(np.abs(to_dense(matrix) - dense[np.ix_(dofs, dofs)])) < 1e-14 * np.max(np.abs(dense))


@pytest.mark.ranks
def test_damping_is_that_of_the_plate_alone(assembly):
    operators, material = assembly.operators, assembly.scene.model.material
    bare_scene = bare(assembly.scene, supports=(), springs=())
    with prepare(bare_scene, operators.comm) as plate:
        stiffness, mass = (to_dense(m) for m in (plate.operators.stiffness, plate.operators.mass))
    expected = material.alpha * stiffness + material.beta * mass
    damping = to_dense(operators.damping)
    # The joints add ten rows and no damping: what remains are the plate's own eigenvalues and ten zeros.
    here, there = np.linalg.eigvalsh(damping), np.linalg.eigvalsh(expected)
    assert np.allclose(np.sort(here)[-90:], np.sort(there), rtol=1e-10)
    assert np.max(np.abs(np.sort(here)[:10])) < 1e-6 * there.min() + 1e-9 * there.max()


@pytest.mark.ranks
def test_undamped_scene_has_no_damping_matrix(sdls119a, comm):
    scene = bare(sdls119a, material=replace(sdls119a.model.material, alpha=0.0, beta=0.0))
    with prepare(scene, comm) as assembly:
        assert assembly.operators.damping is None


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.ranks
def test_uniform_tension_is_exact_on_every_mesh(sdls119a, comm, cell, degree):
    """Patch test: a linear displacement field costs the strain energy of its constant stress."""
    scene = bare(sdls119a, Plate(4.0, 8.0, 3, 5, cell, degree), supports=(), springs=())
    with prepare(scene, comm) as assembly:
        numbering, operators = assembly.plate.numbering, assembly.operators
        x = assembly.plate.space.tabulate_dof_coordinates()[: numbering.n_field // 2]
        gradient = np.array([[1e-3, 2e-4], [-5e-4, 7e-4]])
        u = numbering.vector((x[:, :2] @ gradient.T).ravel())
        force = operators.new_vector()
        operators.stiffness.mult(u, force)
        energy = 0.5 * np.real(u.dot(force))
        eps = 0.5 * (gradient + gradient.T)
        m = scene.model.material
        stress = m.young / (1 - m.poisson**2) * ((1 - m.poisson) * eps + m.poisson * np.trace(eps) * np.eye(2))
        assert energy == pytest.approx(0.5 * 32.0 * m.thickness * np.sum(stress * eps), rel=1e-12)
        u.destroy()
        force.destroy()


@pytest.mark.ranks
def test_rigid_motions_cost_no_energy(sdls119a, comm):
    scene = bare(sdls119a, supports=(), springs=())
    with prepare(scene, comm) as assembly:
        numbering, operators = assembly.plate.numbering, assembly.operators
        x = assembly.plate.space.tabulate_dof_coordinates()[: numbering.n_field // 2]
        for u, v in ((np.ones(len(x)), 0 * x[:, 0]), (0 * x[:, 0], np.ones(len(x))), (-x[:, 1], x[:, 0])):
            rigid = numbering.vector(np.stack([u, v], axis=1).ravel())
            force = operators.new_vector()
            operators.stiffness.mult(rigid, force)
            assert force.norm() < 1e-12 * scene.model.material.young * rigid.norm()
            rigid.destroy()
            force.destroy()


@pytest.mark.ranks(2, 3)
def test_probe_between_nodes_interpolates(sdls119a, comm):
    probes = (Probe("A", (1.3, 2.6)), Probe("B", (4.0, 8.0)))
    with prepare(bare(sdls119a, probes=probes), comm) as assembly:
        numbering = assembly.plate.numbering
        x = assembly.plate.space.tabulate_dof_coordinates()[: numbering.n_field // 2]
        bilinear = np.stack([1 + 2 * x[:, 0] + 3 * x[:, 1], x[:, 0] - x[:, 1]], axis=1)
        values = numbering.vector(bilinear.ravel()).array
        outputs = assembly.operators.outputs
        assert outputs["probes"].names == ("A.DX", "A.DY", "B.DX", "B.DY")
        here = outputs.linear("probes", values)
        assert np.allclose(here, [1 + 2.6 + 7.8, 1.3 - 2.6, 33.0, -4.0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"supports": (Support("S", ((0.5, 0.0),), (1e15, 1e8), (1e15, 1e15)),)}, r"supports.S: S at \(0.5, 0\) m stands on no node"),
        ({"springs": (Spring("T", ((4.0, 7.9),), (0.0, 1.0)),)}, r"springs.T: T at \(4, 7.9\) m stands on no node"),
        ({"probes": (Probe("Q", (4.5, 1.0)),)}, r"probes: probe Q at \(4.5, 1\) m lies outside the plate"),
    ],
)
@pytest.mark.ranks(2, 3)
def test_what_does_not_fit_the_mesh_is_named_on_all_ranks(sdls119a, comm, change, words):
    with pytest.raises(ModelError, match=words):
        prepare(bare(sdls119a, **change), comm)


@pytest.mark.ranks
def test_a_model_without_loads_has_none(comm, sdls119a):
    model = PlateModel(Material(1e8, 0.2, 2000.0, 0.5), probes=(Probe("P3", (4.0, 8.0)),))
    scene = replace(sdls119a, model=model, kinematics=Kinematics("plane stress"))
    with prepare(scene, comm) as assembly:
        assert assembly.operators.loads == []
        assert assembly.operators.contacts.names == ()
        assert assembly.operators.n == 90
    motion = replace(model, motions=(GroundMotion((0.0, 1.0), Constant(2.0)),))
    with prepare(replace(sdls119a, model=motion), comm) as assembly:
        total = comm.allreduce(float(np.sum(assembly.operators.loads[0].vector.array)))
        assert total == pytest.approx(-32 * 0.5 * 2000.0, rel=1e-12)


MATERIAL = Material(young=2e10, poisson=0.2, density=2500.0, thickness=1.0)


@pytest.mark.parametrize(
    ("key", "make"),
    [
        ("direction", lambda: GroundMotion((0.0, 0.0), Constant(1.0))),
        ("direction", lambda: GroundMotion((float("nan"),), Constant(1.0))),
        ("center", lambda: GroundMotion((0, 0, 0, 1.0), Constant(1.0), (0.0, float("inf")))),
        ("group", lambda: Part("", MATERIAL)),
        ("gravity", lambda: PlateModel(MATERIAL, gravity=float("inf"))),
        ("up", lambda: PlateModel(MATERIAL, up="-Z")),
    ],
)
def test_parameters_refuse_what_has_no_meaning(key, make):
    with pytest.raises(ModelError) as error:
        make()
    assert error.value.key == key
