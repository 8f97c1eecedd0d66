# SPDX-License-Identifier: Apache-2.0
"""Messages about the arm's tool, for tests."""

from geometry_msgs.msg import PoseStamped, WrenchStamped


def make_target(x=1.0, y=2.0, z=0.3, frame="map") -> PoseStamped:
    """Return a target position for the tip of the arm [m]."""
    target = PoseStamped()
    target.header.frame_id = frame
    target.pose.position.x, target.pose.position.y, target.pose.position.z = x, y, z
    return target


def make_wrench(force=(1.0, 2.0, 3.0), moment=(4.0, 5.0, 6.0), frame="map") -> WrenchStamped:
    """Return force [N] and moment [N m] on the tip of the arm."""
    wrench = WrenchStamped()
    wrench.header.frame_id = frame
    for vector, values in ((wrench.wrench.force, force), (wrench.wrench.torque, moment)):
        vector.x, vector.y, vector.z = values
    return wrench
