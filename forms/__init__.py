"""Mechanics: variational forms of the plate, springs and joints, loads and the law of uplift."""
