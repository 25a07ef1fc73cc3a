import numpy as np
import pytest

from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.evidence.scaling.cost import refined
from uplift.forms.assembly.row_labels import rigid_motions
from uplift.solvers.errors import SolverError
from uplift.solvers.linear import DirectSolver, IterativeSolver
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import transient
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.scheme import Scheme


@pytest.mark.ranks
def test_iterative_march_equals_the_direct_one_joints_of_1e15_included(sdls119a, comm):
    histories = []
    with prepare(refined(sdls119a, 4), comm) as assembly:
        motions = rigid_motions(assembly.plate.labels)
        for given in (None, motions):
            with (
                static_state(assembly.operators, exact_uplift=True, rigid_modes=given) as start,
                Newmark(assembly.operators, Scheme(), 0.005, exact_uplift=True, rigid_modes=given) as method,
            ):
                histories.append(transient(method, start, 10))
        # Ten steps, the first acceleration and one solve for each contact: a preconditioner that has lost the rigid motions needs hundreds.
        assert method.solver.iterations < 40 * (10 + len(assembly.operators.contacts.names))
    direct, iterative = histories
    assert np.max(np.abs(direct.probes - iterative.probes)) < 1e-9 * np.max(np.abs(direct.probes))
    assert np.max(np.abs(direct.release - iterative.release)) < 1e-9 * np.max(np.abs(direct.elongation)) * 1e15


@pytest.mark.ranks
def test_rigid_motions_strain_the_plate_no_more_than_its_supports(assembly, comm):
    """What they strain is the joints: without these the stiffness maps them to zero."""
    operators = assembly.operators
    motions = rigid_motions(assembly.plate.labels)
    assert motions.shape == (3, operators.n_local)
    vector, force = operators.new_vector(), operators.new_vector()
    springs = operators.bonded_springs + operators.unilateral_springs
    for motion in motions:
        vector.array[:] = motion
        operators.stiffness.mult(vector, force)
        left = np.abs(force.array - springs @ motion)
        assert comm.allreduce(float(left.max(initial=0.0)), op=max) < 1e-14 * 1e15


def test_a_matrix_that_is_not_definite_is_an_error(sdls119a, comm):
    with prepare(refined(sdls119a, 2), comm) as assembly:
        operators = assembly.operators
        matrix, solution = operators.stiffness.copy(), operators.new_vector()
        matrix.axpy(-1e4, operators.mass)
        motions = rigid_motions(assembly.plate.labels)
        with (
            pytest.raises(SolverError, match="the rocking plate cannot be solved: conjugate gradients"),
            IterativeSolver(matrix, "t_", motions=motions, what="rocking plate") as solver,
        ):
            solver.solve(operators.loads[0].vector, solution, check=True)


@pytest.mark.ranks
def test_new_values_are_factorised_on_any_number_of_ranks(sdls119a, comm):
    with prepare(refined(sdls119a, 6), comm) as assembly:  # large enough for MUMPS on one rank
        operators = assembly.operators
        matrix, solution = operators.stiffness.copy(), operators.new_vector()
        with DirectSolver(matrix, "t_", definite=True) as solver:
            solver.solve(operators.loads[0].vector, solution, check=True)
            matrix.axpy(1e5, operators.mass, structure=matrix.Structure.SAME_NONZERO_PATTERN)
            solver.refactor()
            solver.solve(operators.loads[0].vector, solution, check=True)


@pytest.mark.both
@pytest.mark.ranks
def test_block_solve_equals_single_solves(assembly):
    from petsc4py import PETSc

    operators = assembly.operators
    n, n_local = operators.n, operators.n_local
    blocks = [PETSc.Mat().createDense(((n_local, n), (None, 3)), comm=operators.comm) for _ in range(3)]
    for block in blocks:
        block.setUp()
        block.assemble()
    vector, solution = operators.new_vector(), operators.new_vector()
    with DirectSolver(operators.stiffness, "t_", definite=False) as solver:
        for j, load in enumerate((operators.loads[0].vector, operators.loads[1].vector)):
            blocks[0].getDenseArray()[:, j] = load.array_r  # the third column stays zero
        blocks[0].assemble()
        solver.solve_block(*blocks)
        for j in range(2):
            vector.array[:] = blocks[0].getDenseArray()[:, j]
            solver.solve(vector, solution, check=True)
            difference = blocks[1].getDenseArray()[:, j] - solution.array
            assert operators.comm.allreduce(float(np.max(np.abs(difference), initial=0.0)), op=max) < 1e-12 * solution.norm()
        assert not blocks[1].getDenseArray()[:, 2].any()
