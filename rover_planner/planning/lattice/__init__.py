"""Finds a path around obstacles: a search over x, y and heading on the full model."""
