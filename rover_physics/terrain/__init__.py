"""Terrain: elevation maps with their layers, soils, and height look-up for kernels."""
