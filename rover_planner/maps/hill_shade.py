# SPDX-License-Identifier: Apache-2.0
"""The brightness of ground that is lit from the north-west, for pictures and the page."""

import numpy as np
from numpy.typing import NDArray

LEVEL_SHADE = 2 / 3
"""Brightness of level ground, so that both sides of a rock are visible."""


def hill_shade(elevation: NDArray[np.float64], resolution: float) -> NDArray[np.float64]:
    """Return the brightness (ny, nx) of the cells, 0 to 1, with light from the north-west.

    Cells with unknown height stay NaN.
    """
    dy, dx = np.gradient(elevation, resolution)
    azimuth, altitude = np.deg2rad(135.0), np.deg2rad(40.0)
    sun = np.array(
        [np.cos(altitude) * np.cos(azimuth), np.cos(altitude) * np.sin(azimuth), np.sin(altitude)]
    )
    cosine = (-dx * sun[0] - dy * sun[1] + sun[2]) / np.sqrt(1 + dx**2 + dy**2)
    return np.clip(LEVEL_SHADE + 0.9 * (cosine - sun[2]), 0.0, 1.0)
