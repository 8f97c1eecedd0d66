# SPDX-License-Identifier: Apache-2.0
"""Messages of a drive, made of the rows that the ground is learned from."""

from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

from msg_adapters.stamps import ns_to_stamp
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import xyzw_from_rpy
from rover_planner.learning.drive_log import (
    PITCH,
    RATES,
    ROLL,
    SUSPENSION,
    TIME,
    TORQUES,
    YAW,
    X,
    Y,
)


def row_messages(row: Floats, begin: float) -> tuple[JointState, Odometry]:
    """Return joint states and odometry of a row of a drive that began at a time [s]."""
    joints = JointState(name=[*SUSPENSION_JOINTS, *WHEEL_JOINTS])
    joints.position = [*row[SUSPENSION].tolist(), *([0.0] * len(WHEEL_JOINTS))]
    joints.velocity = [0.0] * len(SUSPENSION_JOINTS) + row[RATES].tolist()
    joints.effort = [0.0] * len(SUSPENSION_JOINTS) + row[TORQUES].tolist()
    odometry = Odometry()
    odometry.header.frame_id = "map"
    odometry.header.stamp = ns_to_stamp(int((begin + row[TIME]) * 1e9))
    place, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
    place.x, place.y = float(row[X]), float(row[Y])
    turn.x, turn.y, turn.z, turn.w = xyzw_from_rpy(*row[[ROLL, PITCH, YAW]]).tolist()
    return joints, odometry
