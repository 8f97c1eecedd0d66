# SPDX-License-Identifier: Apache-2.0
"""Reads messages about the arm's tool: the target of its tip, and the wrench on it."""

import numpy as np
from geometry_msgs.msg import PoseStamped, Vector3, WrenchStamped
from numpy.typing import NDArray

from msg_adapters.errors import MessageError
from msg_adapters.frames import check_frame
from rover_physics.numerics.plausible import MAX_COORDINATE, MAX_FORCE


def target_to_point(target: PoseStamped, map_frame: str) -> NDArray[np.float64]:
    """Return the position (3,) [m] of a pose in the map frame; the orientation is ignored.

    Raises:
        MessageError: Another frame, or a position that is not finite or beyond MAX_COORDINATE.
    """
    check_frame(target.header.frame_id, map_frame, "tool target")
    return _read(target.pose.position, MAX_COORDINATE, "tool target", "a place in metres")


def wrench_to_force_and_moment(
    wrench: WrenchStamped, map_frame: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return force (3,) [N] and moment (3,) [N m] of a wrench, axes of the map frame.

    Raises:
        MessageError: Another frame, or components that are not finite or beyond MAX_FORCE.
    """
    check_frame(wrench.header.frame_id, map_frame, "tool wrench")
    force = _read(wrench.wrench.force, MAX_FORCE, "tool wrench force", "a force in N")
    return force, _read(wrench.wrench.torque, MAX_FORCE, "tool wrench torque", "a moment in N m")


def _read(vector: Vector3, largest: float, what: str, right: str) -> NDArray[np.float64]:
    values = np.array([vector.x, vector.y, vector.z])
    if not (np.abs(values) <= largest).all():  # also for NaN
        raise MessageError(
            f"{what} is {values.tolist()}; it must be {right}, all finite and within {largest:g}"
        )
    return values
