"""The results file: one HDF5 file that holds all of a run, with units in its attributes.

- / has the attributes format, version, name.
- /scene: the scene file, text; /facts: the summary, JSON.
- /times: (nt,) s.
- /probes, /ground, /contacts, /reactions, /uplift, /energy: histories (nt, n); attributes: unit, names (of the columns), about.
- /points: probes, contacts, springs, (n, 3) m; directions: in which the contacts push.
- /mesh: points (n, 3) m, cells in the order of VTK (attribute cell_type), peak and envelope of the displacements.
- /film/0000 ...: (n, 3) m, nodal displacements in single precision; attributes: row (of /times), time in s.
- /amplitude: modulus (m) and phase (rad) of a sweep's field at one frequency (attribute, Hz).
- /spectra: frequencies (Hz), damping (ratios), acceleration (n_d, n_f, n) m/s2, displacement (m), floor (m/s2).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.analysis.snapshots import SnapshotData
from uplift.drivers.results.results import Results, Series
from uplift.meshes.checked import ModelError
from uplift.solvers.spectra import ResponseSpectrum

FORMAT, VERSION = "uplift results", 1

NAME = "results.h5"

HISTORIES = ("probes", "ground", "contacts", "reactions", "uplift", "energy")

METRES = {"unit": "m"}


def write_results(path: Path, results: Results) -> None:
    """Write the results file."""
    import h5py

    # From 1.8 on the format holds attributes of any size: the names of some thousand contacts are more than 64 kB.
    with h5py.File(path, "w", libver=("v108", "v108")) as file:
        file.attrs.update({"format": FORMAT, "version": VERSION, "name": results.name, "units": "SI"})
        text = h5py.string_dtype("utf-8")
        file.create_dataset("scene", data=results.scene_text, dtype=text)
        file.create_dataset("facts", data=json.dumps(results.facts, ensure_ascii=False, default=str), dtype=text)
        _write(file, "times", results.times, unit="s", about="Archived instants")
        for key, series in results.series.items():
            _write(file, key, series.values, unit=series.unit, about=series.about, names=list(series.names))
        for key, points in results.points.items():
            _write(file, f"points/{key}", points, unit="" if key == "directions" else "m")
        file["points/probes"].attrs["names"] = list(results.probe_names)
        if results.plate is not None:
            _write_plate(file, results.plate, results.times)
        if results.spectra is not None:
            _write_spectra(file, results.spectra, results.spectra_names)


def _write(file: Any, key: str, values: np.ndarray, **attributes: Any) -> None:
    data = np.asarray(values)
    # Small data sets are quicker plain; contact forces of many supports are mostly smooth or zero.
    packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if data.nbytes > 2**16 else {}
    dataset = file.create_dataset(key, data=data, **packed)
    for name, value in attributes.items():
        dataset.attrs[name] = value


def _write_plate(file: Any, plate: SnapshotData, times: np.ndarray) -> None:
    _write(file, "mesh/points", plate.points, **METRES)
    _write(file, "mesh/cells", plate.cells.astype(np.int64), cell_type=plate.cell_type)
    _write(file, "mesh/peak", plate.peak, **METRES, about="Displacement when a probe is farthest from zero")
    _write(file, "mesh/envelope", plate.envelope, **METRES, about="Least and largest displacement, by component")
    file["mesh/envelope"].attrs["instants"] = plate.watched
    for k, (row, frame) in enumerate(zip(plate.rows, plate.snapshots, strict=True)):
        _write(file, frame_name(k), frame, row=int(row), time=float(times[row]), **METRES)
    if plate.amplitude is not None:
        _write(file, "amplitude/modulus", np.abs(plate.amplitude), **METRES, frequency=plate.frequency)
        _write(file, "amplitude/phase", np.angle(plate.amplitude), unit="rad", about="Of exp(i omega t)")


def frame_name(k: int) -> str:
    """Return the path of a frame of the film within the file."""
    return f"film/{k:04d}"


def _write_spectra(file: Any, spectra: ResponseSpectrum, names: tuple[str, ...]) -> None:
    _write(file, "spectra/frequencies", spectra.frequencies, unit="Hz")
    _write(file, "spectra/damping", spectra.damping, unit="")
    about = "Largest absolute acceleration of oscillators at the probes; axes: damping, frequency, probe"
    _write(file, "spectra/acceleration", spectra.acceleration, unit="m/s2", names=list(names), about=about)
    about = "Largest displacement of the oscillators relative to the probes"
    _write(file, "spectra/displacement", spectra.displacement, unit="m", names=list(names), about=about)
    _write(file, "spectra/floor", spectra.floor, unit="m/s2", names=list(names), about="Largest absolute acceleration of the probes")


def find_results(path: Path) -> Path:
    """Return the results file that `path` is or holds. Raises `ModelError` if there is none."""
    file = path / NAME if path.is_dir() else path
    if not file.is_file():
        raise ModelError("", f"{path}: expected a results file or a folder of results (with {NAME} in it)")
    return file


def read_results(path: Path) -> Results:
    """Read a results file, or the one in a folder of results. Raises `ModelError` if it is none."""
    import h5py

    file = find_results(path)
    try:
        with h5py.File(file, "r") as opened:
            if opened.attrs.get("format") != FORMAT:
                raise ModelError("", f"{file}: not a results file of this program")
            if opened.attrs["version"] != VERSION:
                raise ModelError("", f"{file}: written in version {opened.attrs['version']} of the format, this program reads {VERSION}")
            return _read(opened)
    except (OSError, KeyError, ValueError, TypeError) as error:
        if isinstance(error, ModelError):
            raise
        raise ModelError("", f"{file}: not a results file, or a damaged one ({str(error).splitlines()[0]:.80})") from None


def _read(file: Any) -> Results:
    series: dict[str, Series] = {}

    def visit(key: str, item: Any) -> None:
        if hasattr(item, "shape"):
            attributes = item.attrs
            series[key] = Series(_names(item), str(attributes["unit"]), item[()], str(attributes.get("about", "")))

    for group in HISTORIES:
        if group in file:
            file[group].visititems(lambda key, item, group=group: visit(f"{group}/{key}", item))
    times = file["times"][()]
    for key, one in series.items():
        if one.values.shape != (len(times), len(one.names)):
            raise ValueError(f"{key} has {one.values.shape} values for {len(times)} instants and {len(one.names)} names")
    spectra = names = None
    if "spectra" in file:
        part = file["spectra"]
        spectra = ResponseSpectrum(*(part[key][()] for key in ("frequencies", "damping", "acceleration", "displacement", "floor")))
        names = _names(part["acceleration"])
    return Results(
        facts=json.loads(file["facts"].asstr()[()]),
        scene_text=file["scene"].asstr()[()],
        times=times,
        series=series,
        points={key: item[()] for key, item in file["points"].items()},
        probe_names=_names(file["points/probes"]),
        plate=_read_plate(file) if "mesh" in file else None,
        spectra=spectra,
        spectra_names=names or (),
    )


def _names(item: Any) -> tuple[str, ...]:
    return tuple(str(name) for name in item.attrs["names"])


def _read_plate(file: Any) -> SnapshotData:
    mesh, points = file["mesh"], file["mesh/points"][()]
    frames = [file["film"][key] for key in sorted(file["film"])] if "film" in file else []
    amplitude = None
    if "amplitude" in file:
        amplitude = file["amplitude/modulus"][()] * np.exp(1j * file["amplitude/phase"][()])
    return SnapshotData(
        points=points,
        cells=mesh["cells"][()],
        cell_type=str(mesh["cells"].attrs["cell_type"]),
        peak=mesh["peak"][()],
        rows=np.array([frame.attrs["row"] for frame in frames], dtype=int),
        snapshots=np.stack([frame[()] for frame in frames]) if frames else np.zeros((0, len(points), 3), dtype=np.float32),
        envelope=mesh["envelope"][()],
        watched=int(mesh["envelope"].attrs["instants"]),
        frequency=float(file["amplitude/modulus"].attrs["frequency"]) if "amplitude" in file else 0.0,
        amplitude=amplitude,
    )
