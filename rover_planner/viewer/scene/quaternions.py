"""Quaternions as the page takes them: w, x, y, z."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def about_y(angle: float) -> Floats:
    """Return the turn by an angle [rad] about +y, right-handed."""
    return np.array([np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0])


def about_z(angle: float) -> Floats:
    """Return the turn by an angle [rad] about +z."""
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])


def of_attitude(roll: float, pitch: float, yaw: float) -> Floats:
    """Return R = Rz(yaw) Ry(pitch) Rx(roll)."""
    cr, sr = np.cos(roll / 2), np.sin(roll / 2)
    cp, sp = np.cos(pitch / 2), np.sin(pitch / 2)
    cy, sy = np.cos(yaw / 2), np.sin(yaw / 2)
    return np.array(
        [
            cy * cp * cr + sy * sp * sr,
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
        ]
    )


def matrix_of(roll: float, pitch: float, yaw: float) -> Floats:
    """Return R (3, 3), body to map."""
    w, x, y, z = of_attitude(roll, pitch, yaw)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
