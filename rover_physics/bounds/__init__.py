"""Bounds on predictions over uncertain maps."""
