"""Internal forces: what is in the plate, as linear functionals of its displacements."""
