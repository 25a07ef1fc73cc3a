"""A Krylov basis in an HDF5 file, bound to its model by a fingerprint.

The fingerprint covers what the space is made of: the values of stiffness, mass and damping, the contacts' forces and stiffnesses, and how
the rows lie on the ranks. Load histories, amplitudes, gaps, preloads, probes and time schemes are not in it, so one file serves them all;
loads of another shape in space are found out on reading, because their static answers are then not in the basis. A digest of the
contents tells a damaged file.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import logging
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from mpi4py import MPI

from uplift.forms.operators import Operators
from uplift.meshes.checked import ModelError
from uplift.solvers.bases.basis import Basis, Projected, apply, inner
from uplift.solvers.bases.estimator import Growth
from uplift.solvers.bases.krylov import KrylovBasis
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.dense import solve_definite
from uplift.solvers.hdf5_reading import READ_ERRORS, dataset, numbers, see_sound
from uplift.solvers.whole_file import MARGIN, whole_file

log = logging.getLogger(__name__)

FORMAT = "uplift basis 2"

OUTSIDE = 1e-6
"""Largest scaled residual of the static answer to a load that counts as held by the basis; round-off stays below 1e-9."""


def fingerprint(operators: Operators) -> str:
    """Return a digest of the model that a basis is made for, the same on every rank (collective)."""
    digest = hashlib.blake2b(digest_size=16)
    contacts = operators.contacts
    sparse = [matrix.getValuesCSR() for matrix in (operators.stiffness, operators.mass, operators.damping) if matrix is not None]
    sparse += [(m.indptr, m.indices, m.data) for m in (contacts.elongation.local, contacts.push.tocsr())]
    for indptr, indices, values in sparse:
        for array, kind in ((indptr, np.int64), (indices, np.int64), (np.real(values), np.float64)):
            digest.update(np.ascontiguousarray(array, dtype=kind).data)
    digest.update(np.ascontiguousarray(contacts.law.stiffness).data)
    whole = hashlib.blake2b(digest_size=16)
    for part in operators.comm.allgather((operators.n_local, digest.digest())):
        whole.update(repr(part).encode())
    return whole.hexdigest()


def write_basis(path: Path, operators: Operators, basis: KrylovBasis, settings: KrylovSettings) -> None:
    """Write a basis, whole or not at all (collective). Raises `ModelError` where the file cannot be written."""
    comm, mark = operators.comm, fingerprint(operators)
    sizes = comm.allgather(operators.n_local)
    columns = (_gathered(basis.vectors[:, j], sizes, comm) for j in range(basis.size))
    problem: str | None = None
    if comm.rank == 0:
        try:
            path.absolute().parent.mkdir(parents=True, exist_ok=True)
            room = basis.vectors.itemsize * basis.size * (sum(sizes) + 3 * basis.size + len(sizes))
            with whole_file(path, room + MARGIN) as staging, h5py.File(staging, "w") as file:
                file.attrs["format"], file.attrs["fingerprint"] = FORMAT, mark
                file.attrs["settings"] = json.dumps(dataclasses.asdict(settings))
                file.attrs["growth"] = json.dumps(dataclasses.asdict(basis.growth))
                assert basis.projected is not None
                for key, matrix in dataclasses.asdict(basis.projected).items():
                    file[key] = matrix
                file["rows"] = np.array(sizes)
                vectors = file.create_dataset("vectors", (basis.size, sum(sizes)), dtype=float)
                contents = _digest_of(file)
                for j, whole in enumerate(columns):
                    assert whole is not None
                    vectors[j] = whole
                    contents.update(np.ascontiguousarray(whole).data)
                file.attrs["contents"] = contents.hexdigest()
        except OSError as error:
            problem = _words(error)
    for _ in columns:  # the others wait in the gathering of those that rank 0 has not asked for
        pass
    problem = comm.bcast(problem, root=0)
    if problem:
        raise ModelError("--basis-file", f"{path} cannot be written: {problem}")


def _digest_of(file: Any) -> hashlib.blake2b:
    """Return a digest of all that a file holds beside its vectors, to which these are added in their order."""
    digest = hashlib.blake2b(digest_size=16)
    for key in ("format", "fingerprint", "settings", "growth"):
        digest.update(str(file.attrs[key]).encode())
    for key in ("stiffness", "mass", "damping", "rows"):
        digest.update(np.ascontiguousarray(file[key][...]).data)
    return digest


def read_basis(path: Path, operators: Operators) -> tuple[KrylovBasis, KrylovSettings]:
    """Read the basis of this very model and the settings that it was made with (collective).

    Raises `ModelError` for a file that is missing, cut off, foreign or made for another model, or whose basis does not hold a load.
    """
    comm, mark = operators.comm, fingerprint(operators)
    sizes = comm.allgather(operators.n_local)
    problem: str | None = None
    about: dict[str, Any] = {}
    file = None
    if comm.rank == 0:
        try:
            see_sound(path)
            file = h5py.File(path, "r")
            problem, about = _about(file, mark, sizes)
        except FileNotFoundError:
            problem = "there is no such file"
        except READ_ERRORS as error:
            problem = f"not a whole file of a basis ({_words(error)})"
    problem, about = comm.bcast((problem, about), root=0)
    vectors = np.empty((operators.n_local, about.get("size", 0)), order="F")
    if problem is None:
        contents = _digest_of(file) if file is not None else hashlib.blake2b()
        for j in range(about["size"]):
            whole = None
            if file is not None:
                try:
                    whole = np.asarray(file["vectors"][j], dtype=float)
                    contents.update(whole.data)
                except READ_ERRORS as error:
                    problem, whole = f"not a whole file of a basis ({_words(error)})", np.zeros(sum(sizes))
            vectors[:, j] = _scattered(whole, sizes, comm)
        if file is not None and problem is None and contents.hexdigest() != file.attrs.get("contents"):
            problem = "damaged: its contents are not what was written"
    if file is not None:
        file.close()
    problem = comm.bcast(problem, root=0)
    if problem:
        raise ModelError("--basis-file", f"{path}: {problem}")
    basis = KrylovBasis(vectors, comm, about["projected"], about["growth"])
    outside = load_outside(operators, basis, about["settings"])
    if outside is not None:
        words = f"made for other loads; the static answer to the load {outside!r} is not in the basis"
        raise ModelError("--basis-file", f"{path}: {words}")
    log.info("Krylov basis: %d vectors read from %s", basis.size, path)
    return basis, about["settings"]


def _about(file: Any, mark: str, sizes: list[int]) -> tuple[str | None, dict[str, Any]]:
    """Return what is wrong with a file, or None, and what it says of its basis."""
    if file.attrs.get("format") != FORMAT:
        return f"not a file of a basis (format {file.attrs.get('format', 'unknown')!s:.40}; expected {FORMAT!r})", {}
    rows = [int(n) for n in numbers(file, "rows", "iu", ndim=1)]
    if sum(rows) != sum(sizes):
        return f"the basis of another model, with {sum(rows)} dofs instead of {sum(sizes)}", {}
    if rows != sizes:
        return f"made on {len(rows)} ranks, and its rows lie otherwise on the {len(sizes)} of this run", {}
    if file.attrs["fingerprint"] != mark:
        return "the basis of another model: stiffness, mass, damping or contacts differ", {}
    size = int(dataset(file, "vectors", "f", ndim=2, columns=sum(sizes)).shape[0])
    if size > sum(sizes):
        raise ValueError("it has more vectors than the model has dofs")
    projected = {key: numbers(file, key, "f", ndim=2, columns=size) for key in ("stiffness", "mass", "damping")}
    if any(matrix.shape != (size, size) for matrix in projected.values()):
        raise ValueError("its matrices are not square")
    return None, {
        "size": size, "projected": Projected(**projected), "settings": KrylovSettings(**json.loads(file.attrs["settings"])),
        "growth": Growth(**json.loads(file.attrs["growth"])),
    }


def load_outside(operators: Operators, basis: Basis, settings: KrylovSettings) -> str | None:
    """Return the name of a load whose static answer is not in the basis of its model, or None (collective)."""
    assert basis.projected is not None
    matrix = basis.projected.stiffness + settings.shift * basis.projected.mass
    diagonal = operators.stiffness.getDiagonal()
    weight = 1 / np.sqrt(np.maximum(np.abs(np.real(diagonal.array_r)), np.finfo(float).tiny))
    diagonal.destroy()
    for load in operators.loads:
        force = np.real(load.vector.array_r)[:, None]
        answer = basis.vectors @ solve_definite(matrix, inner(basis.vectors, force, operators.comm), "basis")
        rest = force - apply(operators.stiffness, answer)
        if settings.shift:
            rest -= settings.shift * apply(operators.mass, answer)
        left, size = (operators.comm.allreduce(float(np.sum((weight[:, None] * a) ** 2))) for a in (rest, force))
        if left > OUTSIDE**2 * size:
            return load.name
    return None


def _words(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).splitlines()[0][:120]


def _gathered(own: np.ndarray, sizes: list[int], comm: Any) -> np.ndarray | None:
    own = np.ascontiguousarray(own)
    if comm.size == 1:
        return own
    whole = np.empty(sum(sizes)) if comm.rank == 0 else None
    comm.Gatherv(own, [whole, sizes, None, MPI.DOUBLE] if comm.rank == 0 else None, root=0)
    return whole


def _scattered(whole: np.ndarray | None, sizes: list[int], comm: Any) -> np.ndarray:
    if comm.size == 1:
        assert whole is not None
        return whole
    own = np.empty(sizes[comm.rank])
    comm.Scatterv([whole, sizes, None, MPI.DOUBLE] if comm.rank == 0 else None, own, root=0)
    return own
