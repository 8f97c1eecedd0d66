# SPDX-License-Identifier: Apache-2.0
"""Commands to wheels and to the arm."""

import array
import math
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped, Vector3, WrenchStamped
from numpy.typing import NDArray
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from msg_adapters.errors import MessageError
from msg_adapters.frames import check_frame
from msg_adapters.joints import OWN_NAMES, JointNames
from rover_physics.names import WHEEL_JOINTS
from rover_physics.numerics.plausible import MAX_COORDINATE, MAX_FORCE


def twist_to_speeds(twist: TwistStamped | Twist) -> tuple[float, float]:
    """Return forward speed [m/s] and yaw rate [rad/s]; other components are ignored.

    Raises:
        MessageError: One of them is not finite.
    """
    speeds = getattr(twist, "twist", twist)
    forward, yaw = speeds.linear.x, speeds.angular.z
    if not (math.isfinite(forward) and math.isfinite(yaw)):
        raise MessageError(
            f"cmd_vel has linear.x {forward} and angular.z {yaw}; both must be finite"
        )
    return forward, yaw


def joint_order(joints: Sequence[str], names: JointNames = OWN_NAMES) -> NDArray[np.int64]:
    """Return the index (6,) of the wheel that each named joint drives.

    Args:
        joints: Names of the wheel joints, in the model or in messages.
        names: Their names in messages.

    Raises:
        MessageError: The names are not those of the six wheel joints, each once.
    """
    found = [names.model_name(joint) for joint in joints]
    if sorted(found) != sorted(WHEEL_JOINTS):
        right = ", ".join(names.robot_names(WHEEL_JOINTS))
        raise MessageError(f"joints are {', '.join(joints)}; they must be {right} in any order")
    return np.array([WHEEL_JOINTS.index(joint) for joint in found])


def labelled_array(values: NDArray[np.float64], *labels: str) -> Float64MultiArray:
    """Convert values into an array whose dimensions have labels."""
    message = Float64MultiArray(data=doubles(values))
    message.layout.dim = [
        MultiArrayDimension(label=label, size=size, stride=math.prod(values.shape[k:]))
        for k, (label, size) in enumerate(zip(labels, values.shape, strict=True))
    ]
    return message


def doubles(values: NDArray[np.float64]) -> array.array:
    """Copy values into the array type that message fields take without a check per element."""
    data = array.array("d")
    data.frombytes(np.asarray(values, dtype=np.float64).tobytes())
    return data


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
