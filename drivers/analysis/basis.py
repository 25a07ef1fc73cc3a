"""The Krylov basis of a scene: its settings, read from a file or made."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.analysis.assembled_scene import AssembledScene
from uplift.drivers.scene.scene import Scene
from uplift.meshes.checked import ModelError
from uplift.solvers.bases.krylov import KrylovBasis, krylov_basis
from uplift.solvers.bases.settings import KrylovSettings


def krylov_settings(scene: Scene, tolerance: float, *, unrestrained: bool) -> KrylovSettings:
    """Return the settings of a basis for a scene: its band, and a shift where the plate is `loose`, free to move without strain."""
    settings = KrylovSettings(tolerance=tolerance)
    if scene.basis is not None and scene.basis.band is not None:
        settings = dataclasses.replace(settings, band=scene.basis.band)
    elif scene.fourier is not None:
        settings = dataclasses.replace(settings, band=scene.fourier.cutoff)
    if unrestrained:
        settings = dataclasses.replace(settings, shift=(0.02 * 2 * np.pi * settings.band) ** 2)
    return settings


def basis_of(assembly: AssembledScene, tolerance: float, path: Path | None) -> tuple[KrylovBasis, KrylovSettings]:
    """Read the basis from `path` if the file is there, else make one, and write it if a path is given (collective).

    Raises `ModelError` for a file that does not fit the model or whose basis is coarser than `tolerance`.
    """
    operators, settings = assembly.operators, krylov_settings(assembly.scene, tolerance, unrestrained=bool(assembly.plate.unrestrained))
    if path is not None and operators.comm.bcast(path.exists(), root=0):
        from uplift.solvers.basis_file import read_basis

        with assembly.clock.phase("basis"):
            basis, made = read_basis(path, operators)
        if made.tolerance > settings.tolerance or made.band < settings.band:
            words = f"made for a tolerance of {made.tolerance:g} to {made.band:g} Hz; this run asks for {settings.tolerance:g} to"
            raise ModelError("--basis-file", f"{path}: {words} {settings.band:g} Hz")
        return basis, made
    with assembly.clock.remainder("basis"):
        basis = krylov_basis(operators, settings)
        assembly.clock.add("factorisation", basis.growth.seconds["factorisation"])
        if path is not None:
            from uplift.solvers.basis_file import write_basis

            write_basis(path, operators, basis, settings)
    return basis, settings


def basis_notes(basis: KrylovBasis, settings: KrylovSettings) -> dict[str, Any]:
    """Return what the summary says of a basis."""
    growth = basis.growth
    return {
        "vectors": basis.size,
        "starting_columns": growth.columns,
        "blocks": len(growth.sizes),
        "order": growth.order,
        "solves": growth.solves,
        "tolerance": settings.tolerance,
        "band_Hz": settings.band,
        "estimated_error": growth.estimate,
        "residual_at_Hz": growth.checked,
        "residual_by_block": growth.residual,
        "transfer_change_by_block": growth.change,
        "seconds": growth.seconds,
    }
