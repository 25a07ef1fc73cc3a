"""Reduced bases: modes, static answers, Krylov vectors, and the projection on them."""
