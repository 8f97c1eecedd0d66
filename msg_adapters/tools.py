"""Reads messages about the arm's tool: the target of its tip, and the wrench on it."""

import numpy as np
from geometry_msgs.msg import PoseStamped, Vector3, WrenchStamped
from numpy.typing import NDArray

from msg_adapters.errors import MessageError
from msg_adapters.frames import check_frame


def target_to_point(target: PoseStamped, map_frame: str) -> NDArray[np.float64]:
    """Return the position (3,) [m] of a pose in the map frame; the orientation is ignored.

    Raises:
        MessageError: Another frame, or a position that is not finite.
    """
    check_frame(target.header.frame_id, map_frame, "tool target")
    return _finite(target.pose.position, "tool target", "a place in metres")


def wrench_to_force_and_moment(
    wrench: WrenchStamped, map_frame: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return force (3,) [N] and moment (3,) [N m] of a wrench, axes of the map frame.

    Raises:
        MessageError: Another frame, or components that are not finite.
    """
    check_frame(wrench.header.frame_id, map_frame, "tool wrench")
    force = _finite(wrench.wrench.force, "tool wrench force", "a force in N")
    return force, _finite(wrench.wrench.torque, "tool wrench torque", "a moment in N m")


def _finite(vector: Vector3, what: str, right: str) -> NDArray[np.float64]:
    values = np.array([vector.x, vector.y, vector.z])
    if not np.isfinite(values).all():
        raise MessageError(f"{what} is {values.tolist()}; it must be {right}, all finite")
    return values
