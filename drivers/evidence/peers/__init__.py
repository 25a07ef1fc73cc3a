"""Other programs on the same cases."""
