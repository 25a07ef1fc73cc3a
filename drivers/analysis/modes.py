"""The modes of a scene, every contact bonded."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.scene.scene import Scene
from uplift.meshes.checked import ModelError
from uplift.meshes.tagged import extent_of
from uplift.solvers.bases.modes import Modes, modes
from uplift.solvers.bases.pencil import dofs_with_mass
from uplift.solvers.errors import SolverError

USUAL = 20
"""Modes of a scene that asks for none."""


@dataclass(frozen=True)
class Wanted:
    """Which modes are asked for, and by whom."""

    number: int | None
    band: tuple[float, float] | None
    """(low, high) in Hz."""
    shift: float
    """rad2/s2."""
    number_key: str = "modal.number"
    band_key: str = "modal"


def wanted_modes(scene: Scene, number: int | None, band: Sequence[float] | None) -> Wanted:
    """Return what the command line asks for, else what the scene does, else the usual number."""
    modal = scene.modal
    shift = modal.shift if modal else 0.0
    if number is not None:
        return Wanted(number, None, shift, number_key="--number")
    if band is not None:
        return Wanted(None, (band[0], band[1]), shift, band_key="--band")
    return Wanted(modal.number, modal.band, shift) if modal else Wanted(None, None, shift)


def find_modes(assembly: AssembledScene, wanted: Wanted) -> Modes:
    """Return the modes (collective). Raises `ModelError` for a number or a band that the model has not, or if nothing holds it."""
    number = wanted.number
    if number is None and wanted.band is None:
        number = min(USUAL, dofs_with_mass(assembly.operators))
    try:
        return modes(assembly.operators, number=number, band=wanted.band, shift=wanted.shift)
    except ModelError as error:
        key = {"number": wanted.number_key, "band": wanted.band_key, "shift": "modal.shift"}.get(error.key, "modal")
        raise ModelError(key, error.message) from None
    except SolverError:
        if wanted.shift < 0:
            raise
        try:
            rigid, shift = _rigid_modes(assembly)
        except SolverError:
            rigid, shift = 0, 0.0
        if rigid == 0:
            raise
        raise ModelError(
            "modal",
            f"the plate can move without strain, in {rigid} rigid-body mode(s) or mechanism(s), so its stiffness is singular; hold it by "
            f"supports or springs, or set modal.shift < 0, such as {shift:g} rad2/s2, to find these modes at 0 Hz",
        ) from None


def _rigid_modes(assembly: AssembledScene) -> tuple[int, float]:
    """Return the number of modes without strain and the shift in rad2/s2 with which they were found (collective).

    The shift is that of a wave which crosses the plate in 1 s / sqrt(-shift), a wave of bending if the plate can bend, so of the size
    of its lowest eigenvalues.
    """
    material, extent = assembly.scene.model.material, extent_of(assembly.tagged.mesh.geometry.x, assembly.operators.comm)
    slender = 1.0 if assembly.plate.kind == "plane stress" else min(1.0, 10 * (material.thickness / extent) ** 2)
    shift = -float(f"{slender * material.young / material.density / extent ** 2:.1g}")
    level = logging.root.manager.disable
    logging.disable(logging.INFO)  # nobody asked for these modes
    try:
        return modes(assembly.operators, number=min(USUAL, dofs_with_mass(assembly.operators)), shift=shift).rigid, shift
    finally:
        logging.disable(level)


@dataclass(frozen=True)
class ModeTable:
    """Modes with their numbers in the whole spectrum and their effective masses."""

    found: Modes
    masses: np.ndarray
    """(n_modes, n_axes) kg."""
    axes: tuple[str, ...]
    """Along which the plate can move."""
    total: float
    """kg, plate and point masses."""

    @property
    def numbers(self) -> np.ndarray:
        """(n_modes,) numbers, counted from the lowest mode of the model."""
        return self.found.sturm.below_lower + 1 + np.arange(self.found.number)

    @property
    def periods(self) -> np.ndarray:
        """(n_modes,) s, infinite for rigid-body modes."""
        f = self.found.frequencies
        return np.divide(1.0, f, out=np.full_like(f, np.inf), where=f > 0)

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns of the table."""
        return {
            "mode": self.numbers,
            "frequency [Hz]": self.found.frequencies,
            "period [s]": self.periods,
            "damping [%]": 100 * self.found.damping,
            **{f"mass {axis} [{unit}]": values for axis, kg in zip(self.axes, self.masses.T, strict=True)
               for unit, values in (("kg", kg), ("%", 100 * kg / self.total))},
            "residual": self.found.residuals,
        }

    def labels(self) -> list[str]:
        """Return the name of each mode, such as "mode 1, 1.821 Hz"."""
        return [f"mode {n}, {f:.4g} Hz" for n, f in zip(self.numbers, self.found.frequencies, strict=True)]

    def lines(self) -> list[str]:
        """Return the table as it is printed, with the sums of the masses at its foot."""
        lines = [
            f"{'mode':>5}{'frequency':>18}{'period':>14}{'damping':>10}"
            + "".join(f"{f'mass {axis}':>15}{'':>9}" for axis in self.axes) + f"{'residual':>10}",
            f"{'':>5}{'[Hz]':>18}{'[s]':>14}{'[%]':>10}" + f"{'[kg]':>15}{'[%]':>9}" * len(self.axes),
        ]
        for n, f, period, damping, *masses, residual in zip(*self.columns().values(), strict=True):
            lines.append(f"{n:>5}{f:>18.12g}{period:>14.8g}{damping:>10.4f}{_masses(masses)}{residual:>10.1e}")
        sums = [column.sum() for name, column in self.columns().items() if name.startswith("mass")]
        return [*lines, f"{'sum':>5}{'':>42}{_masses(sums)}"]

    def count(self) -> str:
        """Say what the Sturm count found."""
        sturm, found = self.found.sturm, self.found
        low, high = (np.sqrt(max(end, 0.0)) / (2 * np.pi) for end in (sturm.lower, sturm.upper))
        text = (
            f"Sturm count (negative pivots of K - lambda M): {sturm.below_lower} below {low:.6g} Hz and {sturm.below_upper} below "
            f"{high:.6g} Hz, so {sturm.inside} mode{'s' if sturm.inside != 1 else ''} between; "
        )
        if sturm.inside == found.number:
            return text + "as many were found and none is missing"
        return text + f"all were found, and {sturm.inside - found.number} of them, as close as a double mode, follow the last one shown"

    def orthonormality(self) -> str:
        """Say how good the modes are."""
        return f"residuals up to {self.found.residuals.max():.1e}, M-orthonormal to {self.found.orthonormality:.1e}"


def _masses(values: Sequence[float]) -> str:
    return "".join(f"{v:>15.4f}" if i % 2 == 0 else f"{v:>9.4f}" for i, v in enumerate(values))
