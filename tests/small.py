"""Small models for tests, and independent dense computations to hold the project's against."""

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from uplift.forms.contact.law import UpliftLaw
from uplift.forms.operators import (
    Contacts,
    Functionals,
    Load,
    Operators,
    OutputGroup,
    Outputs,
    elongation_group,
    no_contacts,
    no_reactions,
    probe_group,
)
from uplift.solvers.history import History
from uplift.solvers.time_domain.march import stepper_of, transient


def petsc_matrix(dense):
    csr = sparse.csr_matrix(dense)
    indices = np.tile(np.arange(dense.shape[1], dtype=PETSc.IntType), dense.shape[0])
    indptr = np.arange(dense.shape[0] + 1, dtype=PETSc.IntType) * dense.shape[1]
    assert csr.shape == dense.shape
    return PETSc.Mat().createAIJ(size=dense.shape, csr=(indptr, indices, dense.astype(PETSc.ScalarType).ravel()), comm=MPI.COMM_SELF)


def petsc_vector(values):
    # Not createWithArray: PETSc 3.18 takes the norms of a vector that was never written to for known, and zero.
    vector = PETSc.Vec().createSeq(len(values), comm=MPI.COMM_SELF)
    vector.array[:] = values
    return vector


def dense_operators(stiffness, mass, damping=None, loads=(), contacts=None):
    """Operators of a small dense system whose probes are all its dofs; loads are (vector, history, static)."""
    n = len(stiffness)
    contacts = contacts or no_contacts(n, MPI.COMM_SELF)
    rows = contacts.elongation.local
    return Operators(
        stiffness=petsc_matrix(np.asarray(stiffness, dtype=float)),
        mass=petsc_matrix(np.asarray(mass, dtype=float)),
        damping=None if damping is None else petsc_matrix(np.asarray(damping, dtype=float)),
        loads=[Load(f"load {i}", petsc_vector(v), h, static=s) for i, (v, h, s) in enumerate(loads)],
        contacts=contacts,
        outputs=Outputs.of(
            [probe_group(tuple(f"u{i}" for i in range(n)), sparse.identity(n, format="csr")), elongation_group(contacts), no_reactions(n)],
            MPI.COMM_SELF,
        ),
        comm=MPI.COMM_SELF,
        bonded_springs=sparse.csr_matrix((n, n)),
        unilateral_springs=(rows.T @ sparse.diags(contacts.law.stiffness) @ rows).tocsr(),
    )


def outputs_of(**groups):
    """The layout of some groups of outputs, of names each, for histories that are written down by hand."""
    return Outputs.of(
        [OutputGroup(name, names, ("m",) * len(names), sparse.csr_matrix((len(names), 0))) for name, names in groups.items()], MPI.COMM_SELF
    )


def history_of(times, probes, elongation, release):
    """A history of probes and contacts that is written down by hand."""
    layout = outputs_of(
        probes=[f"u{i}" for i in range(probes.shape[1])], elongation=[f"c{i}" for i in range(elongation.shape[1])], reactions=[]
    )
    return History(times, np.hstack([probes, elongation]), layout, release)


def marched(operators, scheme, step, steps, start, *, exact_uplift=False, **options):
    """The history of a march from the state `start`, in all dofs or in a basis."""
    with start, stepper_of(operators, scheme, step, exact_uplift=exact_uplift) as stepper:
        return transient(stepper, start, steps, **options)


def contact_on(dof, stiffness, n):
    """One contact whose elongation is the displacement of `dof`, pushing it upwards."""
    row = sparse.csr_matrix(([1.0], ([0], [dof])), shape=(1, n))
    law = UpliftLaw(np.array([stiffness]), np.array([1 / stiffness]))
    return Contacts(("c1",), np.zeros((1, 2)), Functionals(("c1",), row, MPI.COMM_SELF), row.T.tocsr(), law)


def to_dense(matrix):
    """The whole matrix on every rank."""
    comm = matrix.comm.tompi4py()
    indptr, indices, data = matrix.getValuesCSR()
    local = sparse.csr_matrix((data, indices, indptr), shape=(matrix.getLocalSize()[0], matrix.getSize()[1])).toarray()
    return np.concatenate(comm.allgather(local))


def quadrilateral_matrices(corners, young, poisson, density, thickness):
    """Stiffness and consistent mass (8, 8) of a four-node plane-stress element by 2 x 2 Gauss points, written out by hand."""
    law = young / (1 - poisson**2) * np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]])
    stiffness, mass = np.zeros((8, 8)), np.zeros((8, 8))
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    for xi in (-1 / np.sqrt(3), 1 / np.sqrt(3)):
        for eta in (-1 / np.sqrt(3), 1 / np.sqrt(3)):
            shape = (1 + signs[:, 0] * xi) * (1 + signs[:, 1] * eta) / 4
            slopes = np.stack([signs[:, 0] * (1 + signs[:, 1] * eta), signs[:, 1] * (1 + signs[:, 0] * xi)]) / 4
            jacobian = slopes @ corners
            gradient = np.linalg.solve(jacobian, slopes)
            b = np.zeros((3, 8))
            b[0, 0::2], b[1, 1::2], b[2, 0::2], b[2, 1::2] = gradient[0], gradient[1], gradient[1], gradient[0]
            n = np.zeros((2, 8))
            n[0, 0::2] = n[1, 1::2] = shape
            weight = thickness * np.linalg.det(jacobian)
            stiffness += weight * b.T @ law @ b
            mass += weight * density * n.T @ n
    return stiffness, mass
