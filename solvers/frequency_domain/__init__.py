"""Sweeps over frequencies and Laplace points."""
