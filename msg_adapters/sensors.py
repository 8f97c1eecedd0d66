# SPDX-License-Identifier: Apache-2.0
"""Joint states, odometry and IMU: messages read, and made of what a rover measures."""

import array
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState

from msg_adapters.errors import MessageError
from msg_adapters.frames import check_frame, check_norm, read_orientation
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import matrix_from_xyzw, xyzw_from_rpy, xyzw_from_yaw

NOT_MEASURED = -1.0
"""First element of a covariance in sensor_msgs/Imu if the quantity is not measured."""


@dataclass(frozen=True, eq=False)
class Attitude:
    """Attitude of the body, measured by an IMU whose axes are those of the body."""

    roll: float
    """[rad]"""
    pitch: float
    """Pitch [rad], positive with the nose down."""
    rates: Floats | None
    """(3,) angular velocity, body frame [rad/s]; None if it is not measured."""


class ImuMounting:
    """Frame of an IMU and its turn against the body."""

    def __init__(self, frame_id: str, rpy: Sequence[float] = (0.0, 0.0, 0.0)):
        """Take the frame of the IMU, and roll, pitch, yaw of its axes in the body frame [rad]."""
        self.frame_id = frame_id
        """Frame that its messages must have; one without a frame_id is taken as well."""
        self._turn = matrix_from_xyzw(xyzw_from_rpy(*rpy)) if any(rpy) else None

    def turn(self, vector: Floats) -> Floats:
        """Return a vector (3,) in the body frame from one in the IMU's frame."""
        return vector if self._turn is None else self._turn @ vector


def imu_to_attitude(imu: Imu, mounting: ImuMounting | None = None) -> Attitude:
    """Read attitude and angular velocity; the yaw of the orientation is ignored.

    Args:
        imu: The message.
        mounting: Frame and mounting of the IMU; None takes every frame as that of the body.

    Raises:
        MessageError: Another frame, no orientation, no unit quaternion, or values that are not
            finite.
    """
    frame = imu.header.frame_id
    if mounting is not None and frame not in ("", mounting.frame_id):
        raise MessageError(
            f"imu is in frame {frame!r}; it must be in {mounting.frame_id!r}, or the parameters "
            "imu_frame and imu_mounting must tell how it is mounted"
        )
    if imu.orientation_covariance[0] == NOT_MEASURED:
        raise MessageError(
            "imu has no orientation (orientation_covariance[0] is -1); roll and pitch are needed"
        )
    q = imu.orientation
    xyzw = (q.x, q.y, q.z, q.w)
    norm = check_norm(xyzw, "imu orientation")
    turn = (lambda vector: vector) if mounting is None else mounting.turn
    x, y, z = turn(matrix_from_xyzw(np.array(xyzw) / norm)[2]).tolist()  # upwards
    roll, pitch = math.atan2(y, z), -math.asin(max(-1.0, min(1.0, x)))
    if imu.angular_velocity_covariance[0] == NOT_MEASURED:
        return Attitude(roll, pitch, None)
    rate = imu.angular_velocity
    if not math.isfinite(rate.x + rate.y + rate.z):
        raise MessageError(
            f"imu has angular velocity {[rate.x, rate.y, rate.z]}; it must be finite, in rad/s"
        )
    return Attitude(roll, pitch, turn(np.array([rate.x, rate.y, rate.z])))


MAX_COORDINATE = 1e8
"""Largest coordinate of a pose [m]; UTM has 1e7."""
MAX_DEVIATION = 1e8
"""Largest standard deviation of a pose [m]."""
UNKNOWN = 1e6
"""Variance of what is not measured."""
YAW_RATE_VARIANCE = 1e-4
"""Variance of a yaw rate of an IMU [rad^2/s^2]."""


def odometry_to_pose(
    odometry: Odometry, map_frame: str, base_frame: str = ""
) -> tuple[Floats, float]:
    """Return the pose of the body, and the standard deviation of x, y [m].

    The pose is x, y, z [m], roll, pitch, yaw [rad] (6,).

    Args:
        odometry: The message.
        map_frame: Frame that its pose must be in.
        base_frame: Frame of the body; the message must have it or none as child_frame_id. Empty
            takes every child frame.

    Raises:
        MessageError: Another frame, values that are not finite or impossible, or no unit
            quaternion.
    """
    check_frame(odometry.header.frame_id, map_frame, "odometry")
    child = odometry.child_frame_id
    if base_frame and child not in ("", base_frame):
        raise MessageError(f"odometry is of frame {child!r}; it must be of {base_frame!r}")
    place = odometry.pose.pose.position
    angles = read_orientation(odometry.pose.pose.orientation, "odometry orientation")
    pose = np.array([place.x, place.y, place.z, *angles])
    variances = [float(odometry.pose.covariance[index]) for index in (0, 7)]
    possible = all(abs(one) <= MAX_COORDINATE for one in (place.x, place.y, place.z))
    if not possible or not all(variance <= MAX_DEVIATION**2 for variance in variances):
        raise MessageError(
            f"odometry has pose {pose.tolist()} and variances {variances}; coordinates must be "
            f"within {MAX_COORDINATE:g} m, variances within {MAX_DEVIATION**2:g} m^2"
        )
    return pose, math.sqrt(max(*variances, 0.0))


def planar_odometry(
    pose: Floats,
    covariance: Floats,
    speed: tuple[float, float],
    yaw_rate: float,
    frame_id: str,
    stamp: Any,
) -> Odometry:
    """Return the odometry of a rover that measures its way in the plane.

    Args:
        pose: (3,) x, y [m] and yaw [rad].
        covariance: (3, 3) of the pose.
        speed: Speed ahead and its standard deviation [m/s].
        yaw_rate: Rate of the yaw [rad/s].
        frame_id: Frame of the pose.
        stamp: builtin_interfaces/Time.
    """
    measured, unknown = [0, 1, 5], np.full(6, UNKNOWN)
    whole = np.diag(unknown)
    whole[np.ix_(measured, measured)] = covariance
    unknown[measured] = speed[1] ** 2, speed[1] ** 2, YAW_RATE_VARIANCE
    return odometry_message(
        np.array([pose[0], pose[1], 0.0]),
        np.array(xyzw_from_yaw(float(pose[2]))),
        np.array([speed[0], 0.0, 0.0]),
        np.array([0.0, 0.0, yaw_rate]),
        (whole, np.diag(unknown)),
        frame_id,
        stamp,
    )


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
