"""Geometry and meshes: from a few dimensions to a distributed mesh whose groups have names."""
