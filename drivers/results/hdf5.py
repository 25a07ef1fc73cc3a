"""The results file: one HDF5 file that holds all of a run, with units in its attributes.

- / has the attributes format, version, name.
- /scene: the scene file, text; /facts: the summary, JSON.
- /times: (nt,) s.
- /probes, /ground, /contacts, /reactions, /forces, /cuts, /uplift, /energy: histories (nt, n);
  attributes: unit, names (of the columns), about.
- /points: probes, contacts, springs, (n, 3) m; directions: in which the contacts push.
- /mesh: points (n, 3) m, cells in the order of VTK (attribute cell_type), peak and envelope of the displacements.
- /film/0000 ...: (n, 3) m, nodal displacements in single precision; attributes: row (of /times), time in s.
- /amplitude: modulus (m) and phase (rad) of a sweep's field at one frequency (attribute, Hz).
- /spectra: frequencies (Hz), damping (ratios), acceleration (n_d, n_f, n) m/s2, displacement (m), floor (m/s2).
- /envelopes: places (n, 3) m, and for each section force, as M11, min and max (attribute unit), t_min and t_max (s), each (n,).
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.analysis.envelope_data import EnvelopeData
from uplift.drivers.analysis.snapshots import SnapshotData
from uplift.drivers.results.results import Results, Series
from uplift.meshes.checked import ModelError
from uplift.solvers.hdf5_reading import READ_ERRORS, dataset, numbers, see_sound, size_of
from uplift.solvers.memory import available_bytes
from uplift.solvers.spectra import ResponseSpectrum
from uplift.solvers.whole_file import MARGIN, whole_file

FORMAT, VERSION = "uplift results", 1

NAME = "results.h5"

HISTORIES = ("probes", "ground", "contacts", "reactions", "forces", "cuts", "uplift", "energy")

METRES = {"unit": "m"}


def write_results(path: Path, results: Results) -> None:
    """Write the results file, whole or not at all. Raises `OSError` where there is no room for it."""
    import h5py

    facts = json.dumps(results.facts, ensure_ascii=False, default=str)
    room = _bytes_of(results) + 4 * (len(facts) + len(results.scene_text)) + MARGIN
    # From 1.8 on the format holds attributes of any size: the names of some thousand contacts are more than 64 kB.
    with whole_file(path, room) as staging, h5py.File(staging, "w", libver=("v108", "v108")) as file:
        file.attrs.update({"format": FORMAT, "version": VERSION, "name": results.name, "units": "SI"})
        text = h5py.string_dtype("utf-8")
        file.create_dataset("scene", data=results.scene_text, dtype=text)
        file.create_dataset("facts", data=facts, dtype=text)
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
        if results.envelopes is not None:
            _write_envelopes(file, results.envelopes)


PER_DATASET = 2**11
"""Bytes of a data set beside its numbers: header, attributes, chunks that are not full."""


def _bytes_of(results: Results) -> int:
    """Return what the numbers and names of the results take in a file at most."""
    plate, spectra = results.plate, results.spectra
    arrays: list[Any] = [results.times, *results.points.values(), *(series.values for series in results.series.values())]
    if plate is not None:
        arrays += [plate.points, plate.cells, plate.peak, plate.envelope, *plate.snapshots]
        arrays += [plate.amplitude, plate.amplitude] * (plate.amplitude is not None)
    if spectra is not None:
        arrays += [spectra.frequencies, spectra.damping, spectra.acceleration, spectra.displacement, spectra.floor]
    names = sum(len(name.encode()) + 32 for series in results.series.values() for name in series.names)
    return names + sum(np.asarray(array).nbytes + PER_DATASET for array in arrays)


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


def _write_envelopes(file: Any, envelopes: EnvelopeData) -> None:
    _write(file, "envelopes/places", envelopes.places, **METRES, about="Points of the cells at which section forces are best")
    for column, (name, unit) in enumerate(zip(envelopes.names, envelopes.units, strict=True)):
        parts = (("min", envelopes.least, unit), ("max", envelopes.largest, unit),
                 ("t_min", envelopes.t_least, "s"), ("t_max", envelopes.t_largest, "s"))
        for key, values, its_unit in parts:
            _write(file, f"envelopes/{name}/{key}", values[:, column], unit=its_unit)


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


def read_results(path: Path, *, own: bool = False) -> Results:
    """Read a results file, or the one in a folder; `own`: this process has just written it. Raises `ModelError` if it is none."""
    import h5py

    file = find_results(path)
    try:
        if not own:
            see_sound(file)
        with h5py.File(file, "r") as opened:
            if opened.attrs.get("format") != FORMAT:
                raise ModelError("", f"{file}: not a results file of this program")
            if opened.attrs["version"] != VERSION:
                words = f"written in version {opened.attrs['version']!s:.20} of the format, this program reads {VERSION}"
                raise ModelError("", f"{file}: {words}")
            return _read(opened)
    except READ_ERRORS as error:
        if isinstance(error, ModelError):
            raise
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise ModelError("", f"{file}: not a results file, or a damaged one ({reason:.80})") from None


@contextmanager
def damage_named(path: Path) -> Iterator[None]:
    """Turn what goes wrong in the block with results that were read into a `ModelError` on their file."""
    try:
        yield
    except READ_ERRORS as error:
        if isinstance(error, (ModelError, OSError)):
            raise
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise ModelError("", f"{path}: its contents do not fit together: a damaged results file ({reason:.80})") from error


def _read(file: Any) -> Results:
    import h5py

    if any(not isinstance(file.get(name, getlink=True), h5py.HardLink) for name in file):
        raise ValueError("it holds links")
    total = _total_bytes(file)
    if total > LARGEST_SHARE * available_bytes():
        raise ValueError(f"it would take {total / 2**30:.2g} GiB of memory")
    times = numbers(file, "times", "f", ndim=1)
    if not len(times) or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0):
        raise ValueError("its instants do not increase")
    series: dict[str, Series] = {}
    for group in HISTORIES:
        for key in _paths(file, group):
            item = dataset(file, key, "f", ndim=2)
            names, about = _names(item), str(item.attrs.get("about", ""))
            if item.shape != (len(times), len(names)):
                raise ValueError(f"{key} has {item.shape} values for {len(times)} instants and {len(names)} names")
            series[key] = Series(names, str(item.attrs["unit"]), item[()], about)
    spectra, names = _read_spectra(file) if "spectra" in file else (None, ())
    facts = json.loads(_text(file, "facts"))
    if not isinstance(facts, dict):
        raise ValueError("its facts are none")
    probes = _names(dataset(file, "points/probes", ndim=2, columns=3))
    return Results(
        facts=facts,
        scene_text=_text(file, "scene"),
        times=times,
        series=series,
        points={key.removeprefix("points/"): numbers(file, key, ndim=2, columns=3) for key in _paths(file, "points")},
        probe_names=probes,
        plate=_read_plate(file, len(times)) if "mesh" in file else None,
        spectra=spectra,
        spectra_names=names,
    )


LARGEST_SHARE = 0.5
"""Of the memory that is available, for the numbers of a results file: a page is made beside them."""


def _paths(file: Any, group: str) -> list[str]:
    """Return the paths of the data sets of a group, at any depth; none where there is no such group."""
    found: list[str] = []
    if group in file:
        file[group].visititems(lambda key, item: found.append(f"{group}/{key}") if hasattr(item, "shape") else None)
    return found


def _total_bytes(file: Any) -> int:
    total = 0

    def add(key: str, item: Any) -> None:
        nonlocal total
        total += size_of(item) if hasattr(item, "shape") else 0

    file.visititems(add)
    return total


def _text(file: Any, key: str) -> str:
    return str(dataset(file, key, "O", ndim=0).asstr()[()])


def _names(item: Any) -> tuple[str, ...]:
    return tuple(str(name) for name in item.attrs["names"])


def _read_spectra(file: Any) -> tuple[ResponseSpectrum, tuple[str, ...]]:
    frequencies, damping = (numbers(file, f"spectra/{key}", "f", ndim=1) for key in ("frequencies", "damping"))
    names = _names(dataset(file, "spectra/acceleration", "f", ndim=3))
    shape = (len(damping), len(frequencies), len(names))
    acceleration, displacement = (numbers(file, f"spectra/{key}", "f") for key in ("acceleration", "displacement"))
    floor = numbers(file, "spectra/floor", "f", ndim=1, columns=len(names))
    if acceleration.shape != shape or displacement.shape != shape:
        raise ValueError(f"its spectra have the shape {acceleration.shape}, not {shape}")
    return ResponseSpectrum(frequencies, damping, acceleration, displacement, floor), names


def _read_plate(file: Any, instants: int) -> SnapshotData:
    points, cells = numbers(file, "mesh/points", "f", ndim=2, columns=3), numbers(file, "mesh/cells", "iu", ndim=2)
    n = len(points)
    if cells.size and not 0 <= int(cells.min()) <= int(cells.max()) < n:
        raise ValueError("its cells have nodes that are not there")
    frames = [dataset(file, key, "f", ndim=2, columns=3) for key in sorted(_paths(file, "film"))]
    rows = np.array([int(frame.attrs["row"]) for frame in frames], dtype=int)
    fields = [numbers(file, f"mesh/{key}", "f", ndim=3, columns=3) for key in ("peak", "envelope")]
    if any(frame.shape[0] != n for frame in frames) or any(field.shape[1] != n for field in fields if len(field)):
        raise ValueError(f"its displacements are not those of {n} nodes")
    if np.any((rows < 0) | (rows >= instants)):
        raise ValueError("its film has instants that are not there")
    amplitude = None
    if "amplitude" in file:
        modulus, phase = (numbers(file, f"amplitude/{key}", "f", ndim=2, columns=3) for key in ("modulus", "phase"))
        if modulus.shape != (n, 3) or phase.shape != (n, 3):
            raise ValueError(f"its amplitudes are not those of {n} nodes")
        amplitude = modulus * np.exp(1j * phase)
    return SnapshotData(
        points=points,
        cells=cells,
        cell_type=str(file["mesh/cells"].attrs["cell_type"]),
        peak=fields[0],
        rows=rows,
        snapshots=np.stack([frame[()] for frame in frames]) if frames else np.zeros((0, n, 3), dtype=np.float32),
        envelope=fields[1],
        watched=int(file["mesh/envelope"].attrs["instants"]),
        frequency=float(file["amplitude/modulus"].attrs["frequency"]) if amplitude is not None else 0.0,
        amplitude=amplitude,
    )
