"""The plate's material, thickness and damping."""

from __future__ import annotations

from dataclasses import dataclass

from uplift.meshes.checked import Checked, ModelError, quantity


@dataclass(frozen=True)
class Material(Checked):
    """Isotropic linear elastic plate with Rayleigh damping C = alpha K + beta M over its own K and M."""

    young: float = quantity("Young's modulus", "Pa", above=0.0)
    poisson: float = quantity("Poisson's ratio", above=-1.0, below=0.5)
    density: float = quantity("mass per volume", "kg/m3", above=0.0)
    thickness: float = quantity("thickness along Z", "m", above=0.0)
    alpha: float = quantity("stiffness-proportional damping", "s", default=0.0, at_least=0.0)
    beta: float = quantity("mass-proportional damping", "1/s", default=0.0, at_least=0.0)

    def check(self) -> None:
        """Refuse numbers whose products no double can hold."""
        for name in ("young", "density", "thickness", "alpha", "beta"):
            if getattr(self, name) > 1e30:
                raise ModelError(name, f"expected at most 1e30, got {getattr(self, name):g}")
