# SPDX-License-Identifier: Apache-2.0
"""Unit quaternions: conversions from and to roll, pitch and yaw, and to rotation matrices.

A quaternion rotates vectors from the body frame to the map frame. Function names state the order
of its elements: `xyzw` as in ROS messages, `wxyz` as in MuJoCo and viser. Roll, pitch and yaw
[rad] are defined by R = Rz(yaw) Ry(pitch) Rx(roll).
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.numerics.arrays import Floats

Quaternion = Sequence[float] | Floats
"""Four numbers, in the order that the function's name states."""


def xyzw_from_rpy(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> Floats:
    """Return quaternions x, y, z, w (..., 4) of rolls, pitches and yaws (...) [rad]."""
    halves = [np.asarray(angle, dtype=np.float64) / 2.0 for angle in (roll, pitch, yaw)]
    (cr, cp, cy), (sr, sp, sy) = np.cos(halves), np.sin(halves)
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ],
        axis=-1,
    )


def wxyz_from_rpy(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> Floats:
    """Return quaternions w, x, y, z (..., 4) of rolls, pitches and yaws (...) [rad]."""
    return wxyz_from_xyzw(xyzw_from_rpy(roll, pitch, yaw))


def xyzw_from_yaw(yaw: float) -> tuple[float, float, float, float]:
    """Return the quaternion x, y, z, w of a level body with a yaw [rad]."""
    return 0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)


def wxyz_about_y(angle: float) -> Floats:
    """Return the quaternion w, x, y, z (4,) of a rotation about +y by an angle [rad]."""
    return np.array([np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0])


def wxyz_from_xyzw(xyzw: Floats) -> Floats:
    """Return quaternions (..., 4) in the order w, x, y, z."""
    return xyzw[..., [3, 0, 1, 2]]


def xyzw_from_wxyz(wxyz: Floats) -> Floats:
    """Return quaternions (..., 4) in the order x, y, z, w."""
    return wxyz[..., [1, 2, 3, 0]]


def rpy_from_xyzw(xyzw: Quaternion, squared_norm: float = 1.0) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] of a quaternion x, y, z, w.

    Args:
        xyzw: The quaternion.
        squared_norm: Its squared norm (default 1).
    """
    x, y, z, w = xyzw
    roll = math.atan2(2.0 * (w * x + y * z), squared_norm - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x) / squared_norm)))
    yaw = math.atan2(2.0 * (w * z + x * y), squared_norm - 2.0 * (y * y + z * z))
    return roll, pitch, yaw


def forward_from_xyzw(xyzw: Quaternion) -> tuple[float, float]:
    """Return x and y of the body's forward axis in the map frame.

    Both are near 0 if that axis is vertical; such a body has no heading.
    """
    x, y, z, w = xyzw
    return w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z)


def matrix_from_xyzw(xyzw: Quaternion) -> Floats:
    """Return the rotation matrix R (3, 3), body to map, of a quaternion x, y, z, w."""
    x, y, z, w = xyzw
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
