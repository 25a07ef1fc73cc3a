"""Write the plate's mesh with its named groups for other programs."""

from __future__ import annotations

import contextlib
import io
import tempfile
from pathlib import Path

import numpy as np

from meshes.checked import ModelError
from meshes.plate import Plate, gmsh_model

FORMATS = (".msh", ".vtu", ".xdmf", ".med")


def write_mesh(plate: Plate, path: Path) -> None:
    """Write the mesh to `path`, in the format of its suffix (.msh by gmsh, .vtu .xdmf .med by meshio).

    Groups keep their names in .msh (physical groups) and .med (families); .vtu and .xdmf, which know no names, carry
    their numbers in the cell array `group`, .xdmf those of the surface alone. Raises `ModelError` for another suffix.
    """
    if path.suffix not in FORMATS:
        raise ModelError("--out", f"expected a file name ending in one of {', '.join(FORMATS)}, got {path.name!r}")
    import gmsh

    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        plain = Path(folder) / "plate.msh"
        with gmsh_model(plate):
            if path.suffix != ".msh":
                # The older format lists each element once with its group, which is what meshio reads best.
                gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
            gmsh.write(str(plain))
        if path.suffix == ".msh":
            plain.replace(path)
            return
        _convert(plain, Path(folder) / path.name)
        for written in sorted(Path(folder).iterdir()):
            if written != plain:
                written.replace(path.with_name(written.name))


def _convert(source: Path, target: Path) -> None:
    import meshio

    with contextlib.redirect_stdout(io.StringIO()):  # some releases of meshio print an empty line here
        mesh = meshio.read(source)
    names = {int(tag): name for name, (tag, _) in mesh.field_data.items()}
    blocks = list(zip(mesh.cells, mesh.cell_data["gmsh:physical"], strict=True))
    if target.suffix == ".xdmf":
        # meshio cannot read back an XDMF grid that mixes points and edges with the surface.
        blocks = [(block, tags) for block, tags in blocks if block.type.startswith(("quad", "triangle"))]
    plain = meshio.Mesh(mesh.points, [(block.type, block.data) for block, _ in blocks])
    if target.suffix == ".med":
        if any(block.type == "quad9" for block, _ in blocks):
            raise ModelError("--out", "meshio's MED has no nine-node quadrilaterals: use .msh, .vtu or triangles")
        # MED numbers the families of cells downwards from -1 and keeps their names.
        plain.cell_tags = {-tag: [name] for tag, name in names.items()}
        plain.cell_data["cell_tags"] = [-np.asarray(tags) for _, tags in blocks]
        plain.write(target)
        return
    plain.cell_data["group"] = [np.asarray(tags) for _, tags in blocks]
    plain.write(target, **({"data_format": "XML"} if target.suffix == ".xdmf" else {}))
