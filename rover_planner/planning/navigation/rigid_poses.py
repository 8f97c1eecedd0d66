# SPDX-License-Identifier: Apache-2.0
"""Poses of messages as rigid transforms; takes any object with the fields of geometry_msgs."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from rover_planner.planning.navigation.transforms import Rigid


def read_pose(pose: Any) -> Rigid:
    """Return the transform of a pose from the frame that it is in."""
    place, turn = pose.position, pose.orientation
    return Rigid(
        np.array([place.x, place.y, place.z]),
        Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]),
    )


def write_pose(rigid: Rigid, pose: Any) -> None:
    """Set the numbers of a pose; its parts stay, as they may be known elsewhere."""
    place, turn = pose.position, pose.orientation
    place.x, place.y, place.z = rigid.translation.tolist()
    turn.x, turn.y, turn.z, turn.w = rigid.rotation.as_quat().tolist()


def move_path(path: Any, inner: Rigid | None) -> Any:
    """Change each pose of a path into that of a frame fixed to it, in place, and return the path.

    Args:
        path: The path.
        inner: Pose of the other frame in that of the path's poses; None is the same frame.
    """
    if inner is not None:
        for stamped in path.poses:
            write_pose(read_pose(stamped.pose).then(inner), stamped.pose)
    return path
