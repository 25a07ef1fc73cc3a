"""Write a mesh with its named groups for other programs."""

from __future__ import annotations

import contextlib
import io
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from uplift.meshes.checked import ModelError
from uplift.meshes.discrete import Entities
from uplift.meshes.plate import Plate
from uplift.meshes.sources import MeshSource
from uplift.meshes.tagged import opened, physical_groups

FORMATS = (".msh", ".vtu", ".xdmf", ".med")


def write_mesh(source: MeshSource, path: Path) -> int:
    """Write the mesh to `path`, in the format of its suffix (.msh by gmsh, .vtu .xdmf .med by meshio); return its number of cells.

    Groups keep their names in .msh (physical groups) and .med (families); .vtu and .xdmf, which know no names, carry
    numbers of the geometry in the cell array `group`, .xdmf those of the surface alone. Raises `ModelError` for another suffix.
    """
    if path.suffix not in FORMATS:
        raise ModelError("--out", f"expected a file name ending in one of {', '.join(FORMATS)}, got {path.name!r}")
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        plain = Path(folder) / "plate.msh"
        with opened(source) as (model, entities, _):
            import gmsh

            if isinstance(source, Plate) and (source.degree or 1) > 1:
                model.mesh.setOrder(2)
            groups = physical_groups(model) if entities is None else entities
            cells = sum(len(tags) for d, t in model.getEntities(2) for tags in model.mesh.getElements(d, t)[1])
            names = _name_groups(model, groups) if path.suffix == ".msh" else _number_entities(model, groups)
            if path.suffix != ".msh":
                # The older format lists each element once with its group, which is what meshio reads best.
                gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
            gmsh.write(str(plain))
        if path.suffix == ".msh":
            plain.replace(path)
            return cells
        _convert(plain, Path(folder) / path.name, names)
        for written in sorted(Path(folder).iterdir()):
            if written != plain:
                written.replace(path.with_name(written.name))
    return cells


def _name_groups(model: Any, groups: Entities) -> dict[int, list[str]]:
    """Make each group a physical group of gmsh."""
    model.removePhysicalGroups()
    for number, (name, entities) in enumerate(groups.items(), start=1):
        dimension = max(d for d, _ in entities)
        model.addPhysicalGroup(dimension, [tag for _, tag in entities], number)
        model.setPhysicalName(dimension, number, name)
    return {}


def _number_entities(model: Any, groups: Entities) -> dict[int, list[str]]:
    """Make each entity of a group a physical group of its own, so that no element is written twice; return number -> names."""
    model.removePhysicalGroups()
    members: dict[tuple[int, int], list[str]] = {}
    for name, entities in groups.items():
        for entity in entities:
            members.setdefault(entity, []).append(name)
    for entity in model.getEntities(2):
        members.setdefault(entity, [])
    for number, (dimension, tag) in enumerate(members, start=1):
        model.addPhysicalGroup(dimension, [tag], number)
    return dict(enumerate(members.values(), start=1))


def _convert(source: Path, target: Path, names: dict[int, list[str]]) -> None:
    import meshio

    with contextlib.redirect_stdout(io.StringIO()):  # some releases of meshio print an empty line here
        mesh = meshio.read(source)
    blocks = list(zip(mesh.cells, mesh.cell_data["gmsh:physical"], strict=True))
    if target.suffix == ".xdmf":
        # meshio cannot read back an XDMF grid that mixes points and edges with the surface.
        blocks = [(block, tags) for block, tags in blocks if block.type.startswith(("quad", "triangle"))]
    plain = meshio.Mesh(mesh.points, [(block.type, block.data) for block, _ in blocks])
    if target.suffix == ".med":
        if any(block.type == "quad9" for block, _ in blocks):
            raise ModelError("--out", "meshio's MED has no nine-node quadrilaterals: use .msh, .vtu or triangles")
        # MED numbers the families of cells downwards from -1 and keeps the names of their groups.
        plain.cell_tags = {-tag: members for tag, members in names.items() if members}
        plain.cell_data["cell_tags"] = [-np.asarray(tags) for _, tags in blocks]
        plain.write(target)
        return
    plain.cell_data["group"] = [np.asarray(tags) for _, tags in blocks]
    plain.write(target, **({"data_format": "XML"} if target.suffix == ".xdmf" else {}))
