# SPDX-License-Identifier: Apache-2.0
"""Messages of transforms, as /tf carries them."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from rclpy.duration import Duration
from rclpy.node import Node

from rover_planner.planning.navigation.transforms import Rigid

Edge = tuple[str, str, Rigid]
"""Parent frame, child frame, and where the child is in the parent."""


def transform_message(parent: str, child: str, rigid: Rigid, stamp: Time) -> TransformStamped:
    """Return the message that tells where a child frame is in its parent frame."""
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id, message.header.stamp = parent, stamp
    place, turn = message.transform.translation, message.transform.rotation
    place.x, place.y, place.z = rigid.translation.tolist()
    turn.x, turn.y, turn.z, turn.w = rigid.rotation.as_quat().tolist()
    return message


def send_transforms(
    node: Node, take: Callable[[Any], object], *edges: Edge, age: float = 0.0
) -> None:
    """Give the callback of a node transforms of an age [s] as a TFMessage.

    tf2_msgs is not on PyPI.
    """
    stamp = (node.get_clock().now() - Duration(seconds=age)).to_msg()
    take(SimpleNamespace(transforms=[transform_message(*edge, stamp) for edge in edges]))
