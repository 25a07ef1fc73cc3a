"""Where a mesh comes from; apart from the modules that make it, which load dolfinx."""

from __future__ import annotations

from uplift.meshes.imported import MeshFile
from uplift.meshes.panels import Panels
from uplift.meshes.plate import Plate

MeshSource = Plate | Panels | MeshFile
"""A rectangle, joined plates, or a file."""
