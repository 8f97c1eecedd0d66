# SPDX-License-Identifier: Apache-2.0
"""Writes the messages of a rover's sensors: joint states, odometry and IMU."""

import array
from collections.abc import Mapping

import numpy as np
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState

from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import matrix_from_xyzw

BASE_FRAME = "base_link"


def joint_state(
    positions: Mapping[str, float],
    velocities: Mapping[str, float],
    efforts: Mapping[str, float],
    stamp,
) -> JointState:
    """Convert angles [rad], rates [rad/s] and torques [N m] by joint name into a message.

    A joint without a rate or torque gets zero.
    """
    message = JointState(name=list(positions))
    message.header.stamp = stamp
    message.position = array.array("d", positions.values())
    message.velocity = array.array("d", (velocities.get(name, 0.0) for name in positions))
    message.effort = array.array("d", (efforts.get(name, 0.0) for name in positions))
    return message


def odometry_message(
    position: Floats,
    orientation: Floats,
    velocity: Floats,
    body_rates: Floats,
    covariances: tuple[Floats, Floats],
    frame_id: str,
    stamp,
) -> Odometry:
    """Return the odometry of a rover.

    Args:
        position: (3,) body origin [m], map frame.
        orientation: (4,) quaternion x, y, z, w.
        velocity: (3,) [m/s], body frame.
        body_rates: (3,) angular velocity [rad/s], body frame.
        covariances: (6, 6) of the pose and of the velocities: x, y, z, roll, pitch, yaw.
        frame_id: Frame of the pose.
        stamp: builtin_interfaces/Time.
    """
    message = Odometry(child_frame_id=BASE_FRAME)
    message.header.stamp, message.header.frame_id = stamp, frame_id
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    place.x, place.y, place.z = position.tolist()
    turn.x, turn.y, turn.z, turn.w = orientation.tolist()
    linear, angular = message.twist.twist.linear, message.twist.twist.angular
    linear.x, linear.y, linear.z = velocity.tolist()
    angular.x, angular.y, angular.z = body_rates.tolist()
    message.pose.covariance, message.twist.covariance = (one.ravel() for one in covariances)
    return message


def imu_message(
    orientation: Floats, body_rates: Floats, gravity: float, deviation: float, stamp
) -> Imu:
    """Return what an IMU at the body origin measures; accelerations of the rover are neglected.

    Args:
        orientation: (4,) quaternion x, y, z, w, body to map.
        body_rates: (3,) angular velocity [rad/s], body frame.
        gravity: Gravity [m/s^2]; the IMU measures this acceleration upwards.
        deviation: Standard deviation of angles [rad].
        stamp: builtin_interfaces/Time.
    """
    message = Imu()
    message.header.stamp, message.header.frame_id = stamp, BASE_FRAME
    turn, rates, pull = message.orientation, message.angular_velocity, message.linear_acceleration
    turn.x, turn.y, turn.z, turn.w = orientation.tolist()
    rates.x, rates.y, rates.z = body_rates.tolist()
    upwards = matrix_from_xyzw(orientation)[2]
    pull.x, pull.y, pull.z = (gravity * upwards).tolist()
    covariance = np.diag(np.full(3, max(deviation, 1e-4) ** 2)).ravel()
    message.orientation_covariance = covariance
    message.angular_velocity_covariance = covariance
    message.linear_acceleration_covariance = covariance
    return message
