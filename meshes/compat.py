"""All that differs between the dolfinx releases this project runs on (0.5 and 0.9)."""

from __future__ import annotations

import importlib
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias
from unittest.mock import patch

import dolfinx
import dolfinx.fem
import dolfinx.fem.petsc
import dolfinx.jit
import numpy as np
from dolfinx.io import gmshio

from uplift.meshes.partition import keep_joints_whole, ranks_at_vertices

# The libraries below bring no types: these names say what an argument is to a reader.
Mesh: TypeAlias = Any
"""A distributed mesh, `dolfinx.mesh.Mesh`."""
Space: TypeAlias = Any
"""A function space, `dolfinx.fem.FunctionSpace`, blocked by node."""
Mat: TypeAlias = Any
"""A distributed matrix, `petsc4py.PETSc.Mat`."""
Vec: TypeAlias = Any
"""A distributed vector, `petsc4py.PETSc.Vec`."""

# What one release lacks is no error to a type checker that sees the other.
_fem: Any = dolfinx.fem
_jit: Any = dolfinx.jit
_geometry: Any = importlib.import_module("dolfinx.geometry")
_gmshio: Any = gmshio
_mesh: Any = importlib.import_module("dolfinx.mesh")
_OLD = hasattr(dolfinx.fem, "VectorFunctionSpace")


def vector_space(mesh: Mesh, degree: int, components: int) -> Space:
    """Return the continuous Lagrange space of `degree` with `components` values a node."""
    if _OLD:
        return _fem.VectorFunctionSpace(mesh, ("Lagrange", degree), dim=components)
    return _fem.functionspace(mesh, ("Lagrange", degree, (components,)))


def compile_form(form: Any, cache_dir: str | None = None) -> Any:
    """Compile a UFL form, in the folder `cache_dir` where one is given (else the user's own form cache)."""
    options = {} if cache_dir is None else {"cache_dir": cache_dir}
    keywords: dict[str, Any] = {"jit_params" if _OLD else "jit_options": options}
    return dolfinx.fem.form(form, **keywords)


def form_cache_folder() -> Path:
    """Return the folder in which compiled forms are kept."""
    return Path((_jit.get_parameters if _OLD else _jit.get_options)()["cache_dir"])


def distribute(model: Any, comm: Any, gdim: int) -> tuple[Mesh, Any, Any]:
    """Turn the gmsh model of rank 0 into a distributed mesh, in the plane (`gdim` 2) or in space (3), with cell and facet tags.

    In space, where plates meet along joints, cells are shared out so that no joint comes open (`uplift.meshes.partition`).
    """
    if gdim == 2 or comm.size == 1:
        return gmshio.model_to_mesh(model, comm, 0, gdim=gdim)[:3]
    library = _mesh.create_cell_partitioner(*(() if _OLD else (_mesh.GhostMode.none,)))

    def partitioner(comm: Any, parts: int, kind: Any, cells: Any, *ghost_mode: Any) -> Any:
        """Share out the cells, all on rank 0 before, as the library does, and see to the joints."""
        found = library(comm, parts, kind, cells, *ghost_mode)
        if not found.num_nodes:
            return found
        vertices = np.asarray(cells.array if _OLD else cells[0]).reshape(found.num_nodes, -1)
        owners = found.array[found.offsets[:-1]]
        if _OLD:
            return type(found)(*ranks_at_vertices(vertices, owners))
        return type(found)(keep_joints_whole(vertices, owners), np.arange(len(owners) + 1, dtype=np.int32))

    if not _OLD:
        return _gmshio.model_to_mesh(model, comm, 0, gdim=gdim, partitioner=partitioner)[:3]
    # This release takes no partitioner here: it gets ours through the function that it calls.
    create_mesh = partial(_mesh.create_mesh, ghost_mode=_mesh.GhostMode.none, partitioner=partitioner)
    with patch.object(gmshio, "create_mesh", create_mesh):
        return gmshio.model_to_mesh(model, comm, 0, gdim=gdim)


def piecewise_constant_space(mesh: Mesh) -> Space:
    """Return the space of functions with one value a cell."""
    return (_fem.FunctionSpace if _OLD else _fem.functionspace)(mesh, ("DG", 0))


def geometry_cells(mesh: Mesh) -> np.ndarray:
    """Return the geometry nodes of each cell, (cells, nodes a cell), local numbers in the order of dolfinx."""
    nodes = mesh.geometry.dofmap
    if _OLD:
        return np.asarray(nodes.array).reshape(nodes.num_nodes, -1)
    return np.asarray(nodes)


def dof_cells(space: Space) -> np.ndarray:
    """Return the nodes of the space in each cell, (cells, nodes a cell), local numbers in the order of dolfinx."""
    nodes = space.dofmap.list
    if _OLD:
        return np.asarray(nodes.array).reshape(nodes.num_nodes, -1)
    return np.asarray(nodes)


def cell_containing(mesh: Mesh, point: np.ndarray) -> int:
    """Return a cell owned by this rank that contains `point` (3,), or -1."""
    if _OLD:
        tree = _geometry.BoundingBoxTree(mesh, mesh.topology.dim)
        candidates = _geometry.compute_collisions(tree, point)
    else:
        tree = _geometry.bb_tree(mesh, mesh.topology.dim)
        candidates = _geometry.compute_collisions_points(tree, point)
    cells = _geometry.compute_colliding_cells(mesh, candidates, point.reshape(1, 3)).links(0)
    owned = cells[cells < mesh.topology.index_map(mesh.topology.dim).size_local]
    return int(owned[0]) if owned.size else -1
