# SPDX-License-Identifier: Apache-2.0
"""A hash of a terrain's content, by which two maps can be told apart."""

import hashlib

import numpy as np

from rover_physics.terrain.grid import Terrain

LAYERS = ("elevation", "friction", "elevation_std", "soil", "ground_class")
"""Layers that count, in this order."""
DIGITS = 16
"""Hexadecimal digits of a fingerprint."""


def fingerprint(terrain: Terrain) -> str:
    """Return 16 hexadecimal digits of SHA-256 over all that defines a terrain.

    The bytes are: resolution, origin x and y as 64-bit floats; then per layer its name, its shape
    and its values; then the names of the soils. Unknown cells of all kinds of NaN count alike.
    """
    digest = hashlib.sha256(np.array([terrain.resolution, *terrain.origin], "<f8").tobytes())
    for name in LAYERS:
        layer = getattr(terrain, name)
        if layer is not None:
            digest.update(f"{name} {layer.shape} ".encode())
            digest.update(_bytes(layer).data)
    digest.update("\n".join(terrain.soil_names).encode())
    return digest.hexdigest()[:DIGITS]


def _bytes(layer: np.ndarray) -> np.ndarray:
    """Return the values of a layer, little-endian, with one kind of NaN."""
    values = np.ascontiguousarray(layer)
    if values.dtype.kind == "f":
        values = np.where(np.isnan(values), np.nan, values).astype("<f8", copy=False)
    return values
