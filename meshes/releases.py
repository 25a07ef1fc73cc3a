"""All that differs between the dolfinx releases this project runs on (0.5 and 0.9)."""

from __future__ import annotations

import importlib
from typing import Any

import dolfinx
import dolfinx.fem
import dolfinx.fem.petsc
import numpy as np
from dolfinx.io import gmshio

# What one release lacks is no error to a type checker that sees the other.
_fem: Any = dolfinx.fem
_geometry: Any = importlib.import_module("dolfinx.geometry")
_OLD = hasattr(dolfinx.fem, "VectorFunctionSpace")


def vector_space(mesh: Any, degree: int, components: int) -> Any:
    """Return the continuous Lagrange space of `degree` with `components` values a node."""
    if _OLD:
        return _fem.VectorFunctionSpace(mesh, ("Lagrange", degree), dim=components)
    return _fem.functionspace(mesh, ("Lagrange", degree, (components,)))


def compile_form(form: Any, cache_dir: str | None = None) -> Any:
    """Compile a UFL form, in the folder `cache_dir` where one is given (else the user's own form cache)."""
    options = {} if cache_dir is None else {"cache_dir": cache_dir}
    keywords: dict[str, Any] = {"jit_params" if _OLD else "jit_options": options}
    return dolfinx.fem.form(form, **keywords)


def distribute(model: Any, comm: Any, gdim: int) -> tuple[Any, Any, Any]:
    """Turn the gmsh model of rank 0 into a distributed mesh, in the plane (`gdim` 2) or in space (3), with cell and facet tags."""
    return gmshio.model_to_mesh(model, comm, 0, gdim=gdim)[:3]


def piecewise_constant_space(mesh: Any) -> Any:
    """Return the space of functions with one value a cell."""
    return (_fem.FunctionSpace if _OLD else _fem.functionspace)(mesh, ("DG", 0))


def geometry_cells(mesh: Any) -> np.ndarray:
    """Return the geometry nodes of each cell, (cells, nodes a cell), local numbers in the order of dolfinx."""
    nodes = mesh.geometry.dofmap
    if _OLD:
        return np.asarray(nodes.array).reshape(nodes.num_nodes, -1)
    return np.asarray(nodes)


def cell_containing(mesh: Any, point: np.ndarray) -> int:
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
