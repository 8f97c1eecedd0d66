# SPDX-License-Identifier: Apache-2.0
"""Converts predictions into messages: arrays per waypoint and a joint trajectory."""

import array

import numpy as np
from numpy.typing import ArrayLike, NDArray
from std_msgs.msg import Float64MultiArray, Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from msg_adapters.commands import doubles, labelled_array
from msg_adapters.errors import MessageError
from msg_adapters.joints import OWN_NAMES, JointNames
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS, WHEELS
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import steered_wheels, steering_joints

MEASURES = ("tip_over_ratio", "tip_over_force_angle")
"""Columns of the tip-over margin: the paper's ratio, and the force-angle measure over its
value on flat ground."""

JOINTS = SUSPENSION_JOINTS + WHEEL_JOINTS
"""First joints of the predicted trajectory, in order; those of the steered wheels follow."""


def waypoint_array(values: ArrayLike, column_label: str = "wheel") -> Float64MultiArray:
    """Convert values (n, k), one row per waypoint, into an array with labelled dimensions.

    The columns are wheels in wheel order, or the MEASURES. Poses that did not settle have NaN.
    """
    return labelled_array(np.asarray(values, dtype=np.float64), "waypoint", column_label)


def array_values(message: Float64MultiArray) -> NDArray[np.float64]:
    """Return the values (n, k) of a two-dimensional array as a view of the message's data.

    Raises:
        MessageError: Not two dimensions, padding, or a length that disagrees.
    """
    sizes = [dim.size for dim in message.layout.dim]
    values = np.frombuffer(message.data, np.float64)[message.layout.data_offset :]
    if len(sizes) != 2 or len(values) != sizes[0] * sizes[1]:
        raise MessageError(
            f"array has dimensions {sizes} and {len(values)} values; "
            "it must have two dimensions and a value for each of their cells"
        )
    return values.reshape(sizes)


def wheel_array(prediction: PathPrediction | None, field: str) -> Float64MultiArray:
    """Convert values of wheels at n waypoints into an array (n, 6); None has no waypoints."""
    none = np.empty((0, len(WHEELS)))
    return waypoint_array(none if prediction is None else getattr(prediction, field))


def tip_over_array(prediction: PathPrediction | None) -> Float64MultiArray:
    """Convert the tip-over margins of n waypoints into an array (n, 2), see MEASURES."""
    margins = [[] if prediction is None else getattr(prediction, name) for name in MEASURES]
    return waypoint_array(np.column_stack(margins), "measure")


def joint_trajectory(
    prediction: PathPrediction | None,
    rover: Rover,
    header: Header,
    names: JointNames = OWN_NAMES,
) -> JointTrajectory:
    """Return the joints along a path, up to the first waypoint that did not settle.

    Positions are the suspension angles, the wheels' rolling angles without slip and the angles of
    the steered wheels [rad]. Velocities [rad/s] are the wheels' rates without slip; for suspension
    and steering, the mean rates since the waypoint before. Efforts [N m] are the drive torques for
    the wheels and zero for the other joints. The points are the waypoints in order, at their
    predicted time from start.

    Args:
        prediction: Prediction of n waypoints; None makes a trajectory without points.
        rover: The rover.
        header: Frame of the map, and stamp.
        names: Names, signs and offsets of the joints in messages.
    """
    joints = [*JOINTS, *steering_joints(rover)]
    trajectory = JointTrajectory(header=header, joint_names=list(names.robot_names(joints)))
    if prediction is None:
        return trajectory
    count = len(prediction.settled)
    if not prediction.settled.all():
        count = int(np.argmin(prediction.settled))
    suspension = np.hstack([prediction.rocker_angle, prediction.bogie_angle])[:count]
    steering = prediction.steering_angle[:count, steered_wheels(rover)]
    times = prediction.time[:count]
    rolled = _rolled_angles(prediction, rover.wheel.radius, count)
    positions = np.hstack([suspension, rolled, steering])
    velocities = np.hstack(
        [_rates(suspension, times), prediction.wheel_speed[:count], _rates(steering, times)]
    )
    efforts = np.zeros_like(positions)
    efforts[:, len(SUSPENSION_JOINTS) : len(JOINTS)] = prediction.torque[:count]
    signs = names.signs(joints)
    positions, velocities = signs * (positions - names.offsets(joints)), signs * velocities
    efforts = signs * efforts
    rows = zip(_rows(positions), _rows(velocities), _rows(efforts), strict=True)
    for (angles, rates, torques), time in zip(rows, times.tolist(), strict=True):
        point = JointTrajectoryPoint(positions=angles, velocities=rates, effort=torques)
        start = point.time_from_start
        start.sec, start.nanosec = divmod(round(time * 1e9), 1_000_000_000)
        trajectory.points.append(point)
    return trajectory


def _rolled_angles(
    prediction: PathPrediction, wheel_radius: float, count: int
) -> NDArray[np.float64]:
    """Return rolling angles (count, 6) [rad] of the wheels, negative backwards."""
    steps = np.diff(prediction.wheel_centres[:count], axis=0)
    heading = prediction.poses[1:count, 2, None] + prediction.steering_angle[1:count]
    forward = steps[:, :, 0] * np.cos(heading) + steps[:, :, 1] * np.sin(heading)
    lengths = np.copysign(np.linalg.norm(steps, axis=2), forward)
    rolled = np.zeros((count, len(WHEEL_JOINTS)))
    rolled[1:] = np.cumsum(lengths, axis=0) / wheel_radius
    return rolled


def _rates(values: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean rates (n, k) of values since the row before, 0 in the first row."""
    rates = np.zeros_like(values)
    steps = np.diff(times)[:, None]
    np.divide(np.diff(values, axis=0), steps, out=rates[1:], where=steps > 0.0)
    return rates


def _rows(values: NDArray[np.float64]) -> list[array.array]:
    """Copy the rows of values (n, k) into arrays as `doubles` does."""
    flat, width = doubles(values), values.shape[1]
    return [flat[k : k + width] for k in range(0, len(flat), width)]
