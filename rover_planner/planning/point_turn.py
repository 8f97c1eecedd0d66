# SPDX-License-Identifier: Apache-2.0
"""The candidate that turns on the spot: to face the goal, and once more when it is there."""

import numpy as np

from rover_planner.planning.angles import wrap

LEAST_TURN = 1e-3
"""Turn [rad] below which it is left out."""


def turn_and_drive(
    start: np.ndarray, goal: np.ndarray, swing_radius: float, waypoint_spacing: float
) -> tuple[np.ndarray, float]:
    """Return the path that turns, drives straight ahead and turns, and its length.

    Args:
        start: (3,) x, y [m] and yaw [rad].
        goal: (3,) x, y [m] and yaw [rad].
        swing_radius: Distance of the outermost wheel from the body origin [m].
        waypoint_spacing: Largest distance between waypoints [m]; in the turns, that of the
            outermost wheel.

    Returns:
        Waypoints (n, 3), and the straight distance plus that of the outer wheel in turns [m].
    """
    away = goal[:2] - start[:2]
    length = float(np.hypot(*away))
    heading = float(np.arctan2(away[1], away[0])) if length > 0.0 else float(start[2])
    first, last = float(wrap(heading - start[2])), float(wrap(goal[2] - heading))
    step = waypoint_spacing / swing_radius
    shares = np.linspace(0.0, 1.0, 1 + max(1, int(np.ceil(length / waypoint_spacing - 1e-9))))
    line = np.column_stack([start[:2] + shares[:, None] * away, np.full(len(shares), heading)])
    parts = [
        turn_on_the_spot(start[:2], start[2], first, step)[:-1],
        line if length > 0.0 else line[:1],
        turn_on_the_spot(goal[:2], heading, last, step)[1:],
    ]
    return np.concatenate(parts), length + swing_radius * (abs(first) + abs(last))


def turn_on_the_spot(place: np.ndarray, yaw: float, turn: float, step: float) -> np.ndarray:
    """Return poses (k, 3) of a turn on the spot, both ends included; one if it is left out.

    Args:
        place: (2,) x, y [m].
        yaw: Heading at its begin [rad].
        turn: Turn to the left [rad].
        step: Largest turn between two poses [rad].
    """
    if abs(turn) < LEAST_TURN:
        return np.array([[*place, yaw]])
    count = 1 + max(1, int(np.ceil(abs(turn) / step - 1e-9)))
    return np.column_stack([np.tile(place, (count, 1)), yaw + np.linspace(0.0, turn, count)])
