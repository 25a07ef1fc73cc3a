"""Uplift case by case, by every method."""
