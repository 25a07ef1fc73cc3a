from dataclasses import replace

import numpy as np
import pytest

from drivers.analysis import prepare
from forms.kinematics import Kinematics
from forms.material import Material
from forms.parameters import GroundMotion, PlateModel, Probe
from forms.signals import Constant
from forms.supports import Spring, Support
from meshes.checked import ModelError
from meshes.plate import Plate
from solvers.newmark import static_state
from tests.small import quadrilateral_matrices, to_dense


def bare(scene, plate=None, **model):
    """The scene with another mesh or model."""
    return replace(scene, plate=plate or scene.plate, model=replace(scene.model, **model))


def test_reference_case_has_100_dofs_and_its_mass(plant):
    assert plant.operators.n == 100
    # 4 m x 8 m x 1 m of 2500 kg/m3 and five joints of 0.1 kg; a sum of some 50 terms keeps 14 digits.
    assert abs(plant.assembled.total_mass - 80_000.5) < 1e-9 * 80_000.5
    assert plant.assembled.joint_mass == pytest.approx(0.5, rel=1e-15)


def test_weight_and_ground_motion_are_mass_times_acceleration(plant):
    gravity, motion = plant.operators.loads
    dense = to_dense(plant.operators.mass)
    static = static_state(plant.operators)
    with static:
        reach = to_dense(plant.operators.stiffness)
        assert reach.shape == dense.shape
    total = plant.operators.comm.allreduce(float(np.sum(np.real(gravity.vector.array))))
    # Rows of joints hold the elongation of their contact, on which a weight acts with the opposite sign: 5 x 0.1 kg less.
    assert total == pytest.approx(-9.81 * (80_000.5 - 0.5), rel=1e-12)
    assert gravity.static and not motion.static


@pytest.mark.both
def test_static_answer_of_the_reference_case(plant):
    with static_state(plant.operators) as state:
        probes = plant.operators.probes
        here = probes.total(probes.partial(np.real(state.displacement.array_r)))
        contacts = plant.operators.contacts
        tension = contacts.law.tension(contacts.elongation.total(contacts.elongation.partial(np.real(state.displacement.array_r))))
    # DY as printed by the source to eight digits; DX, a thousandth of it, keeps fewer there.
    assert here[1] == pytest.approx(-7.0878060e-03, rel=1e-8)
    assert here[0] == pytest.approx(2.4783508e-05, rel=1e-6)
    # Equilibrium: the supports carry the weight less what the two top springs of 1 N/m take.
    assert -tension.sum() == pytest.approx(9.81 * (80_000.5 - 0.5), rel=1e-6)
    assert np.allclose(tension, tension[::-1], rtol=1e-9)


def test_matrices_are_symmetric(plant):
    operators = plant.operators
    for matrix in (operators.stiffness, operators.mass, operators.damping):
        dense = to_dense(matrix)
        assert np.array_equal(dense, dense.T) or np.max(np.abs(dense - dense.T)) < 1e-15 * np.max(np.abs(dense))
    assert np.linalg.eigvalsh(to_dense(operators.mass)).min() > 0


def test_matrices_equal_a_hand_written_element(sdls119a, comm):
    scene = bare(sdls119a, Plate(1.0, 2.0, 1, 1), supports=(), springs=(), probes=(Probe("P3", (1.0, 2.0)),))
    with prepare(scene, comm) as plant:
        corners = np.array([[0, 0], [1, 0], [1, 2], [0, 2]], dtype=float)
        material = scene.model.material
        expected = quadrilateral_matrices(corners, material.young, material.poisson, material.density, material.thickness)
        operators = plant.operators
        coordinates = plant.assembled.space.tabulate_dof_coordinates()[: plant.assembled.numbering.n_field // 2, :2]
        order = np.concatenate(comm.allgather([int(np.argmin(np.linalg.norm(corners - x, axis=1))) for x in coordinates])).astype(int)
        dofs = np.stack([2 * order, 2 * order + 1], axis=1).ravel()
        for matrix, dense in zip((operators.stiffness, operators.mass), expected, strict=True):
            assert np.max(np.abs(to_dense(matrix) - dense[np.ix_(dofs, dofs)])) < 1e-14 * np.max(np.abs(dense))


def test_damping_is_that_of_the_plate_alone(plant):
    operators, material = plant.operators, plant.scene.model.material
    bare_scene = bare(plant.scene, supports=(), springs=())
    with prepare(bare_scene, operators.comm) as plate:
        stiffness, mass = (to_dense(m) for m in (plate.operators.stiffness, plate.operators.mass))
    expected = material.alpha * stiffness + material.beta * mass
    damping = to_dense(operators.damping)
    # The joints add ten rows and no damping: what remains are the plate's own eigenvalues and ten zeros.
    here, there = np.linalg.eigvalsh(damping), np.linalg.eigvalsh(expected)
    assert np.allclose(np.sort(here)[-90:], np.sort(there), rtol=1e-10)
    assert np.max(np.abs(np.sort(here)[:10])) < 1e-6 * there.min() + 1e-9 * there.max()


def test_undamped_scene_has_no_damping_matrix(sdls119a, comm):
    scene = bare(sdls119a, material=replace(sdls119a.model.material, alpha=0.0, beta=0.0))
    with prepare(scene, comm) as plant:
        assert plant.operators.damping is None


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
@pytest.mark.parametrize("degree", [1, 2])
def test_uniform_tension_is_exact_on_every_mesh(sdls119a, comm, cell, degree):
    """Patch test: a linear displacement field costs the strain energy of its constant stress."""
    scene = bare(sdls119a, Plate(4.0, 8.0, 3, 5, cell, degree), supports=(), springs=())
    with prepare(scene, comm) as plant:
        numbering, operators = plant.assembled.numbering, plant.operators
        x = plant.assembled.space.tabulate_dof_coordinates()[: numbering.n_field // 2]
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


def test_rigid_motions_cost_no_energy(sdls119a, comm):
    scene = bare(sdls119a, supports=(), springs=())
    with prepare(scene, comm) as plant:
        numbering, operators = plant.assembled.numbering, plant.operators
        x = plant.assembled.space.tabulate_dof_coordinates()[: numbering.n_field // 2]
        for u, v in ((np.ones(len(x)), 0 * x[:, 0]), (0 * x[:, 0], np.ones(len(x))), (-x[:, 1], x[:, 0])):
            rigid = numbering.vector(np.stack([u, v], axis=1).ravel())
            force = operators.new_vector()
            operators.stiffness.mult(rigid, force)
            assert force.norm() < 1e-12 * scene.model.material.young * rigid.norm()
            rigid.destroy()
            force.destroy()


def test_probe_between_nodes_interpolates(sdls119a, comm):
    probes = (Probe("A", (1.3, 2.6)), Probe("B", (4.0, 8.0)))
    with prepare(bare(sdls119a, probes=probes), comm) as plant:
        numbering = plant.assembled.numbering
        x = plant.assembled.space.tabulate_dof_coordinates()[: numbering.n_field // 2]
        bilinear = np.stack([1 + 2 * x[:, 0] + 3 * x[:, 1], x[:, 0] - x[:, 1]], axis=1)
        values = numbering.vector(bilinear.ravel()).array
        functionals = plant.operators.probes
        assert functionals.names == ("A.DX", "A.DY", "B.DX", "B.DY")
        here = functionals.total(functionals.partial(values))
        assert np.allclose(here, [1 + 2.6 + 7.8, 1.3 - 2.6, 33.0, -4.0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"supports": (Support("S", ((0.5, 0.0),), (1e15, 1e8), (1e15, 1e15)),)}, r"supports.S: S at \(0.5, 0\) m stands on no node"),
        ({"springs": (Spring("T", ((4.0, 7.9),), (0.0, 1.0)),)}, r"springs.T: T at \(4, 7.9\) m stands on no node"),
        ({"probes": (Probe("Q", (4.5, 1.0)),)}, r"probes: probe Q at \(4.5, 1\) m lies outside the plate"),
    ],
)
def test_what_does_not_fit_the_mesh_is_named_on_all_ranks(sdls119a, comm, change, words):
    with pytest.raises(ModelError, match=words):
        prepare(bare(sdls119a, **change), comm)


def test_a_model_without_loads_has_none(comm, sdls119a):
    model = PlateModel(Material(1e8, 0.2, 2000.0, 0.5), probes=(Probe("P3", (4.0, 8.0)),))
    scene = replace(sdls119a, model=model, kinematics=Kinematics("plane stress"))
    with prepare(scene, comm) as plant:
        assert plant.operators.loads == []
        assert plant.operators.contacts.names == ()
        assert plant.operators.n == 90
    motion = replace(model, motions=(GroundMotion((0.0, 1.0), Constant(2.0)),))
    with prepare(replace(sdls119a, model=motion), comm) as plant:
        total = comm.allreduce(float(np.sum(plant.operators.loads[0].vector.array)))
        assert total == pytest.approx(-32 * 0.5 * 2000.0, rel=1e-12)
