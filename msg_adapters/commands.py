# SPDX-License-Identifier: Apache-2.0
"""Converts command messages: reads the commanded speed, writes joint efforts and wheel values."""

import array
import math
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Twist, TwistStamped
from numpy.typing import NDArray
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from msg_adapters.errors import MessageError
from msg_adapters.joints import OWN_NAMES, JointNames
from rover_physics.names import WHEEL_JOINTS


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
