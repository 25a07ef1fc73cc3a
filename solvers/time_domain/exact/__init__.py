"""Time integration without a step: exact between contact events, or with contact forces that are polynomials in time."""
