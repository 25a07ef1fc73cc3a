"""Where a mesh comes from; apart from the modules that make it, which load dolfinx."""

from __future__ import annotations

from meshes.imported import MeshFile
from meshes.panels import Panels
from meshes.plate import Plate

MeshSource = Plate | Panels | MeshFile
"""A rectangle, joined plates, or a file."""
