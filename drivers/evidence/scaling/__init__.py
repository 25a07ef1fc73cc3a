"""Growth with dofs and ranks."""
