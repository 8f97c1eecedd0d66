# SPDX-License-Identifier: Apache-2.0
"""Geometry of paths: distances, waypoints between given poses, rings of goals around a goal."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from rover_planner.angles import wrap
from rover_planner.errors import PlanningError

MAX_WAYPOINTS = 100_000
"""Longest path [waypoints]; a longer one is probably an error in the units of the request."""
_MAX_RINGS = 4
"""Largest number of rings: each goal costs an evaluation."""
_RING_GOALS = 8
"""Goals on each ring: every 45 degrees."""


def distance_along(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance (n,) [m] of each pose of a path (n, 3) from its start, along it."""
    steps = np.diff(poses[:, :2], axis=0)
    return np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])


def path_length(poses: NDArray[np.float64]) -> float:
    """Return the length [m] of a path of poses (n, 3): the sum of its straight segments."""
    return float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum())


def densify(
    poses: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Insert waypoints into a path so that neighbours are at most `spacing` apart.

    The given poses stay. Between them x and y are interpolated linearly and the heading turns
    uniformly in the shorter direction. A turn on the spot, between poses at the same position,
    remains a single step.

    Args:
        poses: (n, 3) x, y [m], yaw [rad].
        spacing: Largest distance between waypoints [m].

    Returns:
        The waypoints (m, 3), and the index (m,) of the given pose at or after each of them.

    Raises:
        PlanningError: The path would have more than MAX_WAYPOINTS.
    """
    steps = np.diff(poses, axis=0)
    steps[:, 2] = wrap(steps[:, 2])
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    pieces = np.maximum(1.0, np.ceil(lengths / spacing - 1e-9))
    if pieces.sum() >= MAX_WAYPOINTS:
        raise PlanningError(
            f"path is {lengths.sum():.4g} m long, which at {spacing:g} m are more than "
            f"{MAX_WAYPOINTS} waypoints; ask for a shorter one"
        )
    counts = pieces.astype(np.intp)
    segment = np.repeat(np.arange(len(steps)), counts)
    within = np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)
    dense = poses[segment] + steps[segment] * (within / counts[segment])[:, None]
    return np.vstack([dense, poses[-1:]]), np.append(segment + (within > 0), len(steps))


def rings_within(
    start: NDArray[np.float64], goal: NDArray[np.float64], tolerance: float, apart: float
) -> Iterator[list[NDArray[np.float64]]]:
    """Yield rings of goals (3,) around a goal, from near to far within `tolerance` [m].

    They are at most `apart` [m] from each other, if _MAX_RINGS allows it. On each ring the goals
    on the start's side come first.
    """
    if tolerance <= 0.0:
        return
    rings = min(_MAX_RINGS, max(1, math.ceil(tolerance / apart)))
    towards_start = math.atan2(start[1] - goal[1], start[0] - goal[0])
    turns = sorted(
        (2.0 * math.pi * k / _RING_GOALS for k in range(_RING_GOALS)),
        key=lambda turn: -math.cos(turn),
    )
    for ring in range(1, rings + 1):
        # Slightly less than the tolerance, so that rounding does not exceed it.
        distance = tolerance * ring / rings * (1.0 - 1e-6)
        angles = [towards_start + turn for turn in turns]
        yield [
            goal + distance * np.array([math.cos(angle), math.sin(angle), 0.0]) for angle in angles
        ]
