"""Assemble a scene and run one method."""
