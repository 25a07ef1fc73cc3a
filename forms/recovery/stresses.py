"""What follows from section forces: stresses at the faces and in the middle, principal values, von Mises, moments of reinforcement."""

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


def wood_armer(moment: np.ndarray) -> dict[str, np.ndarray]:
    """Return the design moments (...) N m/m of reinforcement along axes 1 and 2 for moments (..., 3): 11, 22, 12.

    WA1.top and WA2.top, of bars at the face that the normal points to, are >= 0, WA1.bottom and WA2.bottom <= 0: in every direction the
    section resists at least the moment that acts, with the least sum of both. Sources: Wood, Concrete 2 (1968) 69, and Armer's discussion
    of it, ibid. 319.
    """
    top, bottom = _resisting(moment), _resisting(moment * np.array([-1.0, -1.0, 1.0]))
    return {"WA1.top": top[0], "WA2.top": top[1], "WA1.bottom": -bottom[0], "WA2.bottom": -bottom[1]}


def _resisting(moment: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the moments >= 0 along axes 1 and 2 that resist the positive ones of (..., 3): 11, 22, 12."""
    one, two, both = np.moveaxis(moment, -1, 0)
    twist = np.abs(both)
    first_idle, second_idle = one < -twist, two < -twist

    def beside(other: np.ndarray, idle: np.ndarray) -> np.ndarray:
        """Return what the twist adds to one direction where the other one needs nothing."""
        ratio: np.ndarray = twist**2 / np.where(idle, np.abs(other), 1.0)
        return ratio

    first = np.where(first_idle, 0.0, one + np.where(second_idle, beside(two, second_idle), twist))
    second = np.where(second_idle, 0.0, two + np.where(first_idle, beside(one, first_idle), twist))
    return np.maximum(first, 0.0), np.maximum(second, 0.0)


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
    if "M11" in forces:
        found |= {name: ("N m/m", values) for name, values in wood_armer(moment).items()}
    for face, height in FACES.items():
        stress = face_stress(membrane, moment, thickness, height)
        larger, smaller, angle = principal(stress)
        found |= {f"S{ij}.{face}": ("Pa", stress[..., k]) for k, ij in enumerate(PAIRS)}
        found |= {f"S1.{face}": ("Pa", larger), f"S2.{face}": ("Pa", smaller), f"angle.{face}": ("rad", angle)}
        found[f"mises.{face}"] = "Pa", von_mises(stress)
    return found
