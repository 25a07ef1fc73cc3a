"""Functions of time, and records from files."""
