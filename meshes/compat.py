"""All that differs between the dolfinx releases this project runs on: 0.5 (Debian 12), 0.9 (Debian 13) and 0.11 (wheels).

A branch on `_IS_05` dies with Debian 12, what `_FROM_10` and `_FROM_11` leave aside dies with Debian 13.
"""

from __future__ import annotations

import importlib
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias
from unittest.mock import patch

import numpy as np

from uplift.meshes.partition import keep_joints_whole, ranks_at_vertices
from uplift.meshes.working_folder import ignore_option_files

ignore_option_files()

# The libraries below bring no types: these names say what an argument is to a reader.
Mesh: TypeAlias = Any
"""A distributed mesh, `dolfinx.mesh.Mesh`."""
Space: TypeAlias = Any
"""A function space, `dolfinx.fem.FunctionSpace`, blocked by node."""
Mat: TypeAlias = Any
"""A distributed matrix, `petsc4py.PETSc.Mat`."""
Vec: TypeAlias = Any
"""A distributed vector, `petsc4py.PETSc.Vec`."""

# Modules without a type: what one release lacks is no error to a type checker that sees another.
dolfinx: Any = importlib.import_module("dolfinx")
_fem: Any = importlib.import_module("dolfinx.fem")
_geometry: Any = importlib.import_module("dolfinx.geometry")
_jit: Any = importlib.import_module("dolfinx.jit")
_mesh: Any = importlib.import_module("dolfinx.mesh")

_RELEASE = tuple(int(number) for number in dolfinx.__version__.split(".")[:2])
_IS_05, _FROM_10, _FROM_11 = _RELEASE < (0, 6), _RELEASE >= (0, 10), _RELEASE >= (0, 11)


def vector_space(mesh: Mesh, degree: int, components: int) -> Space:
    """Return the continuous Lagrange space of `degree` with `components` values a node."""
    if _IS_05:
        return _fem.VectorFunctionSpace(mesh, ("Lagrange", degree), dim=components)
    return _fem.functionspace(mesh, ("Lagrange", degree, (components,)))


def piecewise_constant_space(mesh: Mesh) -> Space:
    """Return the space of functions with one value a cell."""
    return (_fem.FunctionSpace if _IS_05 else _fem.functionspace)(mesh, ("DG", 0))


def vector_of(function: Any) -> Vec:
    """Return the PETSc vector, with ghosts, that holds the values of a function."""
    return function.vector if _IS_05 else function.x.petsc_vec


def compile_form(form: Any, cache_dir: str | None = None) -> Any:
    """Compile a UFL form, in the folder `cache_dir` where one is given (else the user's own form cache)."""
    options = {} if cache_dir is None else {"cache_dir": cache_dir}
    keywords: dict[str, Any] = {"jit_params" if _IS_05 else "jit_options": options}
    return _fem.form(form, **keywords)


def form_cache_folder() -> Path:
    """Return the folder in which compiled forms are kept."""
    return Path((_jit.get_parameters if _IS_05 else _jit.get_options)()["cache_dir"])


def distribute(model: Any, comm: Any, gdim: int) -> tuple[Mesh, Any, Any]:
    """Turn the gmsh model of rank 0 into a distributed mesh, in the plane (`gdim` 2) or in space (3), with cell and facet tags.

    In space, where plates meet along joints, cells are shared out so that no joint comes open (`uplift.meshes.partition`).
    """
    # Not at the head of the module: 0.5 imports gmsh with it, and that gmsh can be loaded is found out when a mesh is made.
    gmsh_io: Any = importlib.import_module("dolfinx.io.gmsh" if _FROM_10 else "dolfinx.io.gmshio")
    # A joint of plates is a side of any number of cells.
    links: dict[str, Any] = {"max_facet_to_cell_links": None} if _FROM_11 and gdim == 3 else {}
    if gdim == 2 or comm.size == 1:
        return _mesh_and_tags(gmsh_io.model_to_mesh(model, comm, 0, gdim=gdim, **links))
    library = _mesh.create_cell_partitioner(*(() if _IS_05 else (_mesh.GhostMode.none,)), *links.values())

    def partitioner(comm: Any, parts: int, kind: Any, cells: Any, *ghost_mode: Any) -> Any:
        """Share out the cells, all on rank 0 before, as the library does, and see to the joints."""
        found = library(comm, parts, kind, cells, *ghost_mode)
        if not found.num_nodes:
            return found
        vertices = np.asarray(cells.array if _IS_05 else cells[0]).reshape(found.num_nodes, -1)
        owners = found.array[found.offsets[:-1]]
        if _IS_05:
            return type(found)(*ranks_at_vertices(vertices, owners))
        return type(found)(keep_joints_whole(vertices, owners), np.arange(len(owners) + 1, dtype=np.int32))

    if not _IS_05:
        return _mesh_and_tags(gmsh_io.model_to_mesh(model, comm, 0, gdim=gdim, partitioner=partitioner, **links))
    # This release takes no partitioner here: it gets ours through the function that it calls.
    create_mesh = partial(_mesh.create_mesh, ghost_mode=_mesh.GhostMode.none, partitioner=partitioner)
    with patch.object(gmsh_io, "create_mesh", create_mesh):
        return _mesh_and_tags(gmsh_io.model_to_mesh(model, comm, 0, gdim=gdim))


def _mesh_and_tags(made: Any) -> tuple[Any, Any, Any]:
    """Return mesh, cell tags and facet tags of what the library makes of a gmsh model.

    Where no edge has a name, a release from 0.10 on has no facet tags and the others have empty ones.
    """
    mesh, cell_tags, facet_tags = made[:3]
    if facet_tags is None:
        nothing = np.zeros(0, dtype=np.int32)
        facet_tags = _mesh.meshtags(mesh, 1, nothing, nothing)
    return mesh, cell_tags, facet_tags


def geometry_cells(mesh: Mesh) -> np.ndarray:
    """Return the geometry nodes of each cell, (cells, nodes a cell), local numbers in the order of dolfinx."""
    if _FROM_11:
        return np.asarray(mesh.geometry.dofmaps[0])
    return _rows(mesh.geometry.dofmap)


def dof_cells(space: Space) -> np.ndarray:
    """Return the nodes of the space in each cell, (cells, nodes a cell), local numbers in the order of dolfinx."""
    return _rows(space.dofmap.list)


def _rows(nodes: Any) -> np.ndarray:
    """Return the nodes of each cell (cells, nodes a cell) from what the library keeps them in."""
    return np.asarray(nodes.array).reshape(nodes.num_nodes, -1) if _IS_05 else np.asarray(nodes)


def cell_containing(mesh: Mesh, point: np.ndarray) -> int:
    """Return a cell owned by this rank that contains `point` (3,), or -1."""
    if _IS_05:
        tree = _geometry.BoundingBoxTree(mesh, mesh.topology.dim)
        candidates = _geometry.compute_collisions(tree, point)
    else:
        tree = _geometry.bb_tree(mesh, mesh.topology.dim)
        candidates = _geometry.compute_collisions_points(tree, point)
    cells = _geometry.compute_colliding_cells(mesh, candidates, point.reshape(1, 3)).links(0)
    owned = cells[cells < mesh.topology.index_map(mesh.topology.dim).size_local]
    return int(owned[0]) if owned.size else -1
