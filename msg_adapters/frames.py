# SPDX-License-Identifier: Apache-2.0
"""Checks the frame of messages and transforms between frames, and reads orientations."""

import math
from typing import Any

import numpy as np

from msg_adapters.errors import MessageError
from rover_physics.numerics.quaternions import rpy_from_xyzw

NORM_TOLERANCE = 0.01
"""Largest deviation of a quaternion's norm from 1."""


def check_frame(frame_id: str, map_frame: str, what: str) -> None:
    """Check that a message is in the map frame.

    Raises:
        MessageError: The frame is empty or differs; the text names the right one.
    """
    if frame_id != map_frame:
        given = f"in frame {frame_id!r}" if frame_id else "without a frame_id"
        raise MessageError(f"{what} is {given}; it must be in {map_frame!r}")


def read_orientation(turn: Any, what: str) -> tuple[float, float, float]:
    """Return roll, pitch, yaw [rad] of a geometry_msgs/Quaternion.

    Raises:
        MessageError: It is not of norm 1; `what` names it.
    """
    xyzw = (turn.x, turn.y, turn.z, turn.w)
    return rpy_from_xyzw(xyzw, squared_norm=check_norm(xyzw, what) ** 2)


def check_norm(
    xyzw: tuple[float, float, float, float], what: str, tolerance: float = NORM_TOLERANCE
) -> float:
    """Return the norm of a quaternion, which is 1 within a tolerance.

    Raises:
        MessageError: It is not; `what` names it.
    """
    norm = math.hypot(*xyzw)  # never overflows
    if not abs(norm - 1.0) <= tolerance:
        wrong = f"has length {norm:.3g}" if math.isfinite(norm) else "is not finite"
        raise MessageError(
            f"{describe_quaternion(xyzw, what)} {wrong}; it must be a quaternion of length 1, for "
            "no rotation w = 1"
        )
    return norm


def describe_quaternion(xyzw: tuple[float, float, float, float], what: str) -> str:
    """Return the name and the elements of a quaternion."""
    x, y, z, w = xyzw
    return f"{what} (x {x:g}, y {y:g}, z {z:g}, w {w:g})"


def check_transform(message: Any) -> None:
    """Check a geometry_msgs/TransformStamped, also one of a bag.

    Raises:
        MessageError: It is not finite, no unit quaternion, or not between two frames with names.
    """
    parent, child = message.header.frame_id, message.child_frame_id
    place, turn = message.transform.translation, message.transform.rotation
    numbers = np.array([place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w])
    length = float(np.linalg.norm(numbers[3:]))
    is_unit = bool(np.isfinite(numbers).all()) and abs(length - 1.0) <= NORM_TOLERANCE
    if not (is_unit and parent and child and parent != child):
        raise MessageError(
            f"transform from {child!r} to {parent!r} has translation {numbers[:3].tolist()} and "
            f"rotation {numbers[3:].tolist()}; it must be finite, a quaternion of length 1, and "
            "both frames must have names, which differ"
        )
