"""A tour of a results file, cell by cell (run it whole, or open it in an editor that knows cells).

    /usr/bin/python3 docs/read_results.py results/sdls119a/transient

It needs h5py and numpy, and meshio for the last cell: nothing of this project.
"""

# %% What is in the file
import sys
from pathlib import Path

import h5py
import meshio
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results/sdls119a/transient")
file = h5py.File(folder / "results.h5", "r")
print(file.attrs["name"])


def show(key: str, item: h5py.Dataset | h5py.Group) -> None:
    """Print shape and unit of a data set."""
    if isinstance(item, h5py.Dataset) and not key.startswith("film"):
        print(f"  {key:<32}{item.shape} {item.attrs.get('unit', '')}")


file.visititems(show)

# %% The farthest a probe gets, and when
times = file["times"][()]
displacement = file["probes/displacement"]
for name, column in zip(displacement.attrs["names"], displacement[()].T, strict=True):
    row = np.argmax(np.abs(column))
    print(f"{name}: {column[row]:.6e} {displacement.attrs['unit']} at t = {times[row]:g} s")

# %% When does the first contact open, and how long is each open in all?
if "contacts/gap" in file:
    gap = file["contacts/gap"]
    opened = gap[()] > 0
    print("first opening at t =", times[np.argmax(opened.any(axis=1))] if opened.any() else None, "s")
    for name, share in zip(gap.attrs["names"], opened.mean(axis=0), strict=True):
        print(f"{name}: open {100 * share:.1f} % of the time")

# %% The floor spectrum's peak, for each probe and damping ratio
if "spectra" in file:
    frequencies, peaks = file["spectra/frequencies"][()], file["spectra/acceleration"]
    for zeta, curves in zip(file["spectra/damping"], peaks[()], strict=True):
        for name, curve in zip(peaks.attrs["names"], curves.T, strict=True):
            print(f"{name}, {100 * zeta:g} %: {curve.max():.3f} {peaks.attrs['unit']} at {frequencies[np.argmax(curve)]:.2f} Hz")

# %% The moving plate, frame by frame
with meshio.xdmf.TimeSeriesReader(folder / "film.xdmf") as snapshots:
    points, cells = snapshots.read_points_cells()
    steps = [snapshots.read_data(k) for k in range(snapshots.num_steps)]
largest = max(steps, key=lambda step: np.abs(step[1]["displacement [m]"]).max())
print(f"{len(points)} nodes, {len(steps)} frames; farthest at t = {largest[0]:g} s")
