"""Extreme and ill-posed cases against independent oracles."""
