# SPDX-License-Identifier: Apache-2.0
"""Hashes of questions and paths: by them a client tells which question an answer is about.

A hash is the first 16 hexadecimal digits of SHA-256 over these bytes, in this order:

1. the frame_id of the path's header (for a plan request: of start and goal) as UTF-8, each
   followed by a zero byte,
2. seven numbers for each pose: position x, y, z and orientation x, y, z, w,
3. for a plan request: the tolerance.

Numbers are 64-bit floats, little-endian. Stamps, and frames of single poses, do not count.
"""

import hashlib
from collections.abc import Iterable

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped
from nav_msgs.msg import Path

DIGITS = 16
"""Hexadecimal digits of a hash."""


def path_hash(path: Path) -> str:
    """Return the hash of a path, `path_hash` in the verdict on it."""
    return _digest([path.header.frame_id], (stamped.pose for stamped in path.poses))


def plan_request_hash(start: PoseStamped, goal: PoseStamped, tolerance: float) -> str:
    """Return the hash of a nav_msgs/GetPlan request, `question_hash` in the verdict on it.

    Args:
        start: Start of the request.
        goal: Goal of the request.
        tolerance: Tolerance of the request [m]; the message field is a 32-bit float.
    """
    frames = [start.header.frame_id, goal.header.frame_id]
    return _digest(frames, (start.pose, goal.pose), [float(np.float32(tolerance))])


def _digest(frames: Iterable[str], poses: Iterable[Pose], more: Iterable[float] = ()) -> str:
    numbers = [number for pose in poses for number in _numbers(pose)]
    numbers.extend(more)
    digest = hashlib.sha256()
    for frame in frames:
        digest.update(frame.encode("utf-8", "surrogatepass") + b"\0")
    digest.update(np.array(numbers, "<f8").tobytes())
    return digest.hexdigest()[:DIGITS]


def _numbers(pose: Pose) -> tuple[float, ...]:
    place, turn = pose.position, pose.orientation
    return (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)
