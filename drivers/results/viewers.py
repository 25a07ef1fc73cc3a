"""Files for ParaView and SALOME beside the results file: the film as XDMF, fields as VTU and MED. Scalars are real everywhere."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from uplift.drivers.analysis.snapshots import SnapshotData
from uplift.drivers.results.hdf5 import NAME, frame_name
from uplift.solvers.whole_file import MARGIN, reserve

XDMF_CELLS = {"triangle": "Triangle", "triangle6": "Triangle_6", "quad": "Quadrilateral", "quad9": "Quadrilateral_9"}

DISPLACEMENT = "displacement [m]"


def real_fields(name: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """Return a nodal field as viewers can read it: as it is, or modulus and phase (rad, of exp(i omega t)) if it is complex."""
    if not np.iscomplexobj(values):
        return {name: values}
    return {f"{name}, modulus": np.abs(values), f"{name}, phase [rad]": np.angle(values)}


def write_film(path: Path, plate: SnapshotData, times: np.ndarray) -> None:
    """Write an XDMF time series that names the mesh and the frames in the results file beside it and copies nothing."""
    cells, points = plate.cells.shape, plate.points.shape
    grids = []
    for k, row in enumerate(plate.rows):
        grids.append(
            f'<Grid Name="plate" GridType="Uniform"><Time Value="{round(float(times[row]), 12)!r}"/>'
            f'<Topology TopologyType="{XDMF_CELLS[plate.cell_type]}" NumberOfElements="{cells[0]}">'
            f"{_item(cells, 'Int', 8, 'mesh/cells')}</Topology>"
            f'<Geometry GeometryType="XYZ">{_item(points, "Float", 8, "mesh/points")}</Geometry>'
            f'<Attribute Name={quoteattr(DISPLACEMENT)} AttributeType="Vector" Center="Node">'
            f"{_item(points, 'Float', 4, frame_name(k))}</Attribute></Grid>"
        )
    body = "\n".join(grids)
    path.write_text(
        '<?xml version="1.0"?>\n<Xdmf Version="3.0"><Domain>\n'
        f'<Grid Name="film" GridType="Collection" CollectionType="Temporal">\n{body}\n</Grid>\n</Domain></Xdmf>\n',
        encoding="utf-8",
    )


def _item(shape: tuple[int, ...], kind: str, precision: int, key: str) -> str:
    size = " ".join(str(n) for n in shape)
    return f'<DataItem Format="HDF" DataType="{kind}" Precision="{precision}" Dimensions="{size}">{NAME}:/{key}</DataItem>'


def write_fields(folder: Path, plate: SnapshotData) -> None:
    """Write displacement and envelope as deformed.vtu and deformed.med, a sweep's amplitudes as amplitude.vtu."""
    import meshio

    fields = {DISPLACEMENT: plate.peak[0]} if len(plate.peak) else {}
    if len(plate.envelope):
        fields |= {"least displacement [m]": plate.envelope[0], "largest displacement [m]": plate.envelope[1]}
    cells = [(plate.cell_type, plate.cells)]
    if fields:
        meshio.Mesh(plate.points, cells, point_data=fields).write(folder / "deformed.vtu")
        med_points, med_cells, kept = _med_mesh(plate)
        # meshio writes MED by HDF5, which must not find out that the disk is full.
        arrays = [med_points, *(numbers for _, numbers in med_cells), *fields.values()]
        reserve(folder / "deformed.med", MARGIN + 2 * sum(np.asarray(array).nbytes for array in arrays))
        short = {name.removesuffix(" [m]"): np.ascontiguousarray(values[kept]) for name, values in fields.items()}
        meshio.Mesh(med_points, med_cells, point_data=short).write(folder / "deformed.med")
    if plate.amplitude is not None:
        complex_field = real_fields(f"amplitude at {plate.frequency:.6g} Hz [m]", plate.amplitude)
        meshio.Mesh(plate.points, cells, point_data=complex_field).write(folder / "amplitude.vtu")


def _med_mesh(plate: SnapshotData) -> tuple[np.ndarray, list[tuple[str, np.ndarray]], np.ndarray]:
    """Return points, cells and the nodes that they are: meshio's MED knows no nine-node quadrilaterals, of which the corners are kept."""
    if plate.cell_type != "quad9":
        return plate.points, [(plate.cell_type, plate.cells)], np.arange(len(plate.points))
    kept, numbers = np.unique(plate.corners, return_inverse=True)
    return plate.points[kept], [("quad", numbers.reshape(plate.corners.shape))], kept
