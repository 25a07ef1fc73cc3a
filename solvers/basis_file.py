"""A Krylov basis in an HDF5 file, bound to its model by a fingerprint.

The fingerprint covers what the space is made of: the values of stiffness, mass and damping, the contacts' forces and stiffnesses, and how
the rows lie on the ranks. Load histories, amplitudes, gaps, preloads, probes and time schemes are not in it, so one file serves them all;
loads of another shape in space are found out on reading, because their static answers are then not in the basis.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import logging
import os
import tempfile
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

log = logging.getLogger(__name__)

FORMAT = "uplift basis 1"

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
    problem: str | None = None
    staging = None
    file = None
    if comm.rank == 0:
        try:
            path.absolute().parent.mkdir(parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(prefix=".writing-", dir=path.absolute().parent)
            os.close(handle)
            staging = Path(name)
            file = h5py.File(staging, "w")
            file.attrs["format"], file.attrs["fingerprint"] = FORMAT, mark
            file.attrs["settings"] = json.dumps(dataclasses.asdict(settings))
            file.attrs["growth"] = json.dumps(dataclasses.asdict(basis.growth))
            assert basis.projected is not None
            for key, matrix in dataclasses.asdict(basis.projected).items():
                file[key] = matrix
            file["rows"] = np.array(sizes)
            file.create_dataset("vectors", (basis.size, sum(sizes)), dtype=float)
        except OSError as error:
            problem = _words(error)
    for j in range(basis.size):
        whole = _gathered(basis.vectors[:, j], sizes, comm)
        if file is not None and problem is None:
            try:
                file["vectors"][j] = whole
            except OSError as error:
                problem = _words(error)
    if file is not None and staging is not None:
        try:
            file.close()
            if problem is None:
                with staging.open("rb") as written:
                    os.fsync(written.fileno())
                staging.replace(path)
        except (OSError, RuntimeError) as error:
            problem = problem or _words(error)
        finally:
            with contextlib.suppress(OSError):
                staging.unlink(missing_ok=True)
    problem = comm.bcast(problem, root=0)
    if problem:
        raise ModelError("--basis-file", f"{path} cannot be written: {problem}")


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
            file = h5py.File(path, "r")
            problem, about = _about(file, mark, sizes)
        except FileNotFoundError:
            problem = "there is no such file"
        except (OSError, RuntimeError, KeyError, ValueError) as error:
            problem = f"not a whole HDF5 file ({_words(error)})"
    problem, about = comm.bcast((problem, about), root=0)
    vectors = np.empty((operators.n_local, about.get("size", 0)), order="F")
    if problem is None:
        for j in range(about["size"]):
            whole = None
            if file is not None and problem is None:
                try:
                    whole = np.asarray(file["vectors"][j])
                except (OSError, RuntimeError) as error:
                    problem, whole = f"not a whole HDF5 file ({_words(error)})", np.zeros(sum(sizes))
            vectors[:, j] = _scattered(whole, sizes, comm)
    if file is not None:
        file.close()
    problem = comm.bcast(problem, root=0)
    if problem:
        raise ModelError("--basis-file", f"{path}: {problem}")
    settings = KrylovSettings(**about["settings"])
    basis = KrylovBasis(vectors, comm, Projected(**about["projected"]), Growth(**about["growth"]))
    outside = load_outside(operators, basis, settings)
    if outside is not None:
        words = f"made for other loads; the static answer to the load {outside!r} is not in the basis"
        raise ModelError("--basis-file", f"{path}: {words}")
    log.info("Krylov basis: %d vectors read from %s", basis.size, path)
    return basis, settings


def _about(file: Any, mark: str, sizes: list[int]) -> tuple[str | None, dict[str, Any]]:
    """Return what is wrong with a file, or None, and what it says of its basis."""
    if file.attrs.get("format") != FORMAT:
        return f"not a file of a basis (format {file.attrs.get('format', 'unknown')!s:.40}; expected {FORMAT!r})", {}
    rows = [int(n) for n in file["rows"][...]]
    if sum(rows) != sum(sizes):
        return f"the basis of another model, with {sum(rows)} dofs instead of {sum(sizes)}", {}
    if rows != sizes:
        return f"made on {len(rows)} ranks, and its rows lie otherwise on the {len(sizes)} of this run", {}
    if file.attrs["fingerprint"] != mark:
        return "the basis of another model: stiffness, mass, damping or contacts differ", {}
    projected = {key: np.asarray(file[key]) for key in ("stiffness", "mass", "damping")}
    about = {"size": int(file["vectors"].shape[0]), "projected": projected}
    return None, about | {key: json.loads(file.attrs[key]) for key in ("settings", "growth")}


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
