# SPDX-License-Identifier: Apache-2.0
"""Paths for tests: poses on lines and arcs."""

import numpy as np
from numpy.typing import ArrayLike


def poses_at(x: ArrayLike, y: ArrayLike = 0.0, yaw: ArrayLike = 0.0) -> np.ndarray:
    """Return poses (n, 3) of places [m] and headings [rad], each one number or n of them."""
    return np.column_stack(np.broadcast_arrays(x, y, yaw))


def arc_of(curvature: float, along: np.ndarray, yaw: float = 0.0) -> np.ndarray:
    """Return poses on an arc through the origin, where it has a heading `yaw` [rad].

    Its curvature [1/m] is positive to the left; `along` (n,) is the way of each pose [m].
    """
    turn = curvature * along
    chord, direction = along * np.sinc(0.5 * turn / np.pi), yaw + 0.5 * turn
    return poses_at(chord * np.cos(direction), chord * np.sin(direction), yaw + turn)
