"""Supports, joints and the law of contact."""
