# SPDX-License-Identifier: Apache-2.0
"""A short description of a terrain for logs and the terminal."""

import math

import numpy as np

from rover_physics.terrain.grid import Terrain


def describe_terrain(terrain: Terrain) -> str:
    """Return cells, cell size [m] and known share, such as "480 x 480 cells of 0.05 m, ...".

    The share is rounded down to 0.1 %, so that 100 % means that every cell is known.
    """
    rows, columns = terrain.elevation.shape
    known = math.floor(1000.0 * np.isfinite(terrain.elevation).mean()) / 10.0
    return f"{columns} x {rows} cells of {terrain.resolution:g} m, {known:g} % known"
