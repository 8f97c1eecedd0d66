# SPDX-License-Identifier: Apache-2.0
"""Converts PoseStamped and Path messages to arrays of x, y, yaw and back."""

import math
import struct

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped, Quaternion
from nav_msgs.msg import Path
from numpy.typing import ArrayLike, NDArray
from std_msgs.msg import Header

from msg_adapters.errors import MessageError
from msg_adapters.frames import check_frame, check_norm, describe_quaternion
from msg_adapters.raw_messages import Fields
from rover_physics.numerics.plausible import MAX_COORDINATE
from rover_physics.numerics.quaternions import (
    forward_from_xyzw,
    xyzw_from_rpy,
    xyzw_from_yaw,
)
from rover_physics.results.path_prediction import PathPrediction

_NORM_TOLERANCE = 0.005
"""Largest deviation of a quaternion's norm from 1, as in tf2."""

MAX_POSES = 100_000
"""Largest number of poses of a path; a longer path is refused before it is read. It is the
largest number of waypoints of a path, one pose for each."""
MAX_MARKS = 1_000_000
"""Largest number of distances at which `decimate` chooses a pose."""

_MIN_LEVEL = 1e-3
"""Smallest horizontal part of the forward axis (a unit vector) for which a heading is defined."""


def count_poses(message: bytes) -> int:
    """Return the number of poses of a serialised Path without reading them.

    Raises:
        MessageError: The message ends before that number.
    """
    fields = Fields(message)
    try:
        fields.numbers("iI"), fields.text()  # stamp and frame
        return fields.count()
    except struct.error:
        raise MessageError(f"{len(message)} bytes were received that are no Path") from None


def yaw_from_quaternion(quaternion: Quaternion, what: str = "orientation") -> float:
    """Return the heading [rad] of the body's forward axis.

    Raises:
        MessageError: NaN, not of unit length, or the forward axis is vertical.
    """
    xyzw = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    check_norm(xyzw, what, _NORM_TOLERANCE)
    forward_x, forward_y = forward_from_xyzw(xyzw)
    if math.hypot(forward_x, forward_y) < _MIN_LEVEL:
        text = describe_quaternion(xyzw, what)
        raise MessageError(f"{text} points forward straight up or down; it has no heading")
    return math.atan2(forward_y, forward_x)


def pose_to_array(pose: Pose, what: str = "pose") -> NDArray[np.float64]:
    """Return (3,) x, y [m] and yaw [rad] of a pose; z, roll and pitch are ignored.

    Raises:
        MessageError: Position or orientation is not finite, or no unit quaternion.
    """
    x, y = pose.position.x, pose.position.y
    if not (abs(x) <= MAX_COORDINATE and abs(y) <= MAX_COORDINATE):
        raise MessageError(
            f"{what} has position x {x}, y {y}; both must be finite, in metres, within "
            f"{MAX_COORDINATE:g}"
        )
    return np.array([x, y, yaw_from_quaternion(pose.orientation, f"{what} orientation")])


def path_to_poses(path: Path, map_frame: str) -> NDArray[np.float64]:
    """Return (n, 3) x, y [m] and yaw [rad] of a path's poses.

    The frame of the path's header must be the map frame; the frames of poses may be empty. The
    heading is that of each pose's orientation, not the direction of the path.

    Raises:
        MessageError: No poses, more than MAX_POSES, another frame, or a pose that
            `pose_to_array` refuses.
    """
    check_frame(path.header.frame_id, map_frame, "path")
    if not path.poses:
        raise MessageError("path has no poses; it must have at least one")
    if len(path.poses) > MAX_POSES:
        raise MessageError(
            f"path has {len(path.poses)} poses; it may have {MAX_POSES}: leave out poses that are "
            "closer together than the rover needs, or send it in parts"
        )
    for i, stamped in enumerate(path.poses):
        if stamped.header.frame_id:
            check_frame(stamped.header.frame_id, map_frame, f"path pose {i}")
    return np.array(
        [pose_to_array(stamped.pose, f"path pose {i}") for i, stamped in enumerate(path.poses)]
    )


STANDING = 1e-6
"""Step [m] below which a path stands still, such as in a turn on the spot."""
TURN_SPACING = 0.3
"""Turn [rad] between chosen poses of a turn on the spot."""


def decimate(poses: ArrayLike, spacing: float, always: ArrayLike = ()) -> NDArray[np.intp]:
    """Choose poses about `spacing` [m] apart along a path, including the first and the last.

    Poses where the rover changes between forwards and backwards, or begins or ends a turn on the
    spot, are chosen too, and some in the turn: between chosen poses the heading is interpolated.

    Args:
        poses: (n, 3) x, y [m] and yaw [rad].
        spacing: Distance between chosen poses [m]; 0 keeps all.
        always: Indices of other poses that are chosen in any case.

    Returns:
        (m,) ascending indices of the chosen poses.
    """
    values = np.asarray(poses, dtype=np.float64)
    xy = values[:, :2]
    if len(xy) <= 2 or spacing <= 0.0:
        return np.arange(len(xy))
    steps = np.hypot(*np.diff(xy, axis=0).T)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    spacing = max(spacing, travelled[-1] / MAX_MARKS)
    marks = np.arange(0.0, travelled[-1], spacing)
    chosen = np.searchsorted(travelled, marks - 1e-9 * spacing)
    ends = [0, len(xy) - 1]
    others = _find_corners(values), np.asarray(always, np.intp)
    return np.unique(np.concatenate([ends, chosen, *others])).astype(np.intp)


def _find_corners(poses: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the indices of poses (n, 3) between which the heading may not be interpolated."""
    steps = np.diff(poses, axis=0)
    yaw = poses[:-1, 2]
    ahead = np.sign(steps[:, 0] * np.cos(yaw) + steps[:, 1] * np.sin(yaw))
    stands = np.hypot(steps[:, 0], steps[:, 1]) < STANDING
    gear = np.where(stands, 0.0, ahead)
    turn = np.where(stands, np.abs(np.arctan2(np.sin(steps[:, 2]), np.cos(steps[:, 2]))), 0.0)
    marks = np.floor(np.cumsum(turn) / TURN_SPACING)
    changes = (np.diff(gear) != 0.0) | (np.diff(marks) != 0.0)
    return np.flatnonzero(changes) + 1


def settled_path(prediction: PathPrediction, rows: ArrayLike, header: Header) -> Path:
    """Convert settled waypoints of a prediction into a path with the body's full orientation.

    Args:
        prediction: Prediction of n waypoints.
        rows: Indices of the waypoints to write, in order; all must have settled.
        header: Frame and stamp of the path and of every pose.
    """
    rows = np.asarray(rows, dtype=np.intp)
    rotations = xyzw_from_rpy(
        prediction.roll[rows], prediction.pitch[rows], prediction.poses[rows, 2]
    )
    path = Path(header=header)
    for xyz, xyzw in zip(prediction.position[rows].tolist(), rotations.tolist(), strict=True):
        stamped = PoseStamped(header=header)
        place, turn = stamped.pose.position, stamped.pose.orientation
        place.x, place.y, place.z = xyz
        turn.x, turn.y, turn.z, turn.w = xyzw
        path.poses.append(stamped)
    return path


def stamped_pose(pose: ArrayLike, frame_id: str) -> PoseStamped:
    """Convert a pose (3,) x, y [m], yaw [rad] into a level one, such as the goal of a request."""
    x, y, yaw = (float(value) for value in np.asarray(pose, dtype=np.float64))
    stamped = PoseStamped(header=Header(frame_id=frame_id))
    stamped.pose.position.x, stamped.pose.position.y = x, y
    turn = stamped.pose.orientation
    turn.x, turn.y, turn.z, turn.w = xyzw_from_yaw(yaw)
    return stamped


def poses_path(poses: ArrayLike, frame_id: str) -> Path:
    """Convert poses (n, 3) x, y [m], yaw [rad] into a path of level poses to be checked."""
    stamped = [stamped_pose(pose, frame_id) for pose in np.asarray(poses)]
    return Path(header=Header(frame_id=frame_id), poses=stamped)
