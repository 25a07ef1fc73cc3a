"""From a mesh and parameters to operators."""
