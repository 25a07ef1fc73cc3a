"""What follows from section forces: stresses at the faces and in the middle, principal values, von Mises."""

from __future__ import annotations

import numpy as np

FACES = {"top": 1.0, "middle": 0.0, "bottom": -1.0}
"""Height over the mid-surface as a part of half the thickness; the normal leaves the top."""

PAIRS = ("11", "22", "12")

ROUND_OFF = 1e-9
"""Part of the largest value of a history below which differences have no direction."""


def face_stress(membrane: np.ndarray, moment: np.ndarray, thickness: float, height: float) -> np.ndarray:
    """Return the stresses (..., 3) Pa: 11, 22 and 12, tension positive, at `height` times half the thickness (m) over the mid-surface.

    `membrane` (..., 3) N/m and `moment` (..., 3) N m/m are in the same order.
    """
    stress: np.ndarray = membrane / thickness + 6 * height * moment / thickness**2
    return stress


def principal(tensor: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the larger and the smaller principal value (...) of (..., 3): 11, 22, 12, and the angle in rad from axis 1 to the larger.

    The angle is right-handed about the normal and lies in (-pi/2, pi/2]; 0 where both values are the same but for round-off.
    """
    one, two, both = np.moveaxis(tensor, -1, 0)
    middle, radius = (one + two) / 2, np.hypot((one - two) / 2, both)
    noise = ROUND_OFF * np.max(np.abs(tensor), initial=0.0)
    shear, apart = (np.where(np.abs(part) > noise, part, 0.0) for part in (2 * both, one - two))
    return middle + radius, middle - radius, np.arctan2(shear, apart) / 2


def von_mises(stress: np.ndarray) -> np.ndarray:
    """Return the equivalent stress (...) in plane stress of (..., 3): 11, 22, 12; transverse shear, zero at the faces, is left out."""
    one, two, both = np.moveaxis(stress, -1, 0)
    equivalent: np.ndarray = np.sqrt(one**2 - one * two + two**2 + 3 * both**2)
    return equivalent


def _tensors(forces: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return membrane forces and moments (..., 3), zero where a kinematics has none."""
    nothing = np.zeros_like(next(iter(forces.values())))
    membrane, moment = (np.stack([forces.get(f"{letter}{ij}", nothing) for ij in PAIRS], axis=-1) for letter in "NM")
    return membrane, moment


def face_stresses(forces: dict[str, np.ndarray], thickness: float) -> dict[str, np.ndarray]:
    """Return the stresses S11.top and so on (...) in Pa, which are linear: `forces`, as in `derived`, may be complex amplitudes."""
    membrane, moment = _tensors(forces)
    return {
        f"S{ij}.{face}": face_stress(membrane, moment, thickness, height)[..., k]
        for face, height in FACES.items() for k, ij in enumerate(PAIRS)
    }


def derived(forces: dict[str, np.ndarray], thickness: float) -> dict[str, tuple[str, np.ndarray]]:
    """Return unit and values of what follows from section forces at one point: by name, as S11.top, mises.top, M1 or angle.M.

    `forces` are N11, N22, N12 (N/m) and M11, M22, M12 (N m/m), of which those of a kinematics that has none are absent. Histories are real.
    """
    membrane, moment = _tensors(forces)
    found: dict[str, tuple[str, np.ndarray]] = {}
    for letter, unit, tensor in (("N", "N/m", membrane), ("M", "N m/m", moment)):
        if f"{letter}11" in forces:
            larger, smaller, angle = principal(tensor)
            found |= {f"{letter}1": (unit, larger), f"{letter}2": (unit, smaller), f"angle.{letter}": ("rad", angle)}
    for face, height in FACES.items():
        stress = face_stress(membrane, moment, thickness, height)
        larger, smaller, angle = principal(stress)
        found |= {f"S{ij}.{face}": ("Pa", stress[..., k]) for k, ij in enumerate(PAIRS)}
        found |= {f"S1.{face}": ("Pa", larger), f"S2.{face}": ("Pa", smaller), f"angle.{face}": ("rad", angle)}
        found[f"mises.{face}"] = "Pa", von_mises(stress)
    return found
