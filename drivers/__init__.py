"""Scenes, the command line and reports."""
