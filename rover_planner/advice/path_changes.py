# SPDX-License-Identifier: Apache-2.0
"""Paths near a refused one: shifted, at another angle, in a curve, with turns, backwards.

All keep the start and the goal. Those that shift waypoints sideways keep their number, so that a
waypoint of one is the shifted waypoint of the other.
"""

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_planner.angles import wrap
from rover_planner.planning.candidates import turn_and_drive, turn_on_the_spot
from rover_planner.planning.path_geometry import distance_along

RAMP = 3.0
"""Length over which a path leaves the old one [wheelbases], where there is that much of it."""
LEAST_RAMP = 0.5
"""Shortest such length [wheelbases]; less is a kink."""
PLATEAU = 1.0
"""Distance before and behind a place in which a path is shifted as there [wheelbases]."""
AHEAD = np.radians(30.0)
"""Largest angle between heading and step [rad] of a path that is driven ahead."""


def is_driven_ahead(poses: Floats) -> bool:
    """Return whether a path (n, 3) leads ahead at every step, without turns on the spot."""
    if len(poses) < 3:
        return False
    steps = np.diff(poses[:, :2], axis=0)
    aside = wrap(np.arctan2(steps[:, 1], steps[:, 0]) - poses[:-1, 2])
    return bool((np.hypot(*steps.T) > 0.0).all() and (np.abs(aside) < AHEAD).all())


def shift_path(poses: Floats, place: int, offset: float, wheelbase: float) -> Floats | None:
    """Shift a path to the left by `offset` [m] around a waypoint; None if there is no room."""
    hill = _find_hill(distance_along(poses), place, wheelbase)
    return None if hill is None else _shift_sideways(poses, offset * hill)


def turn_path(poses: Floats, place: int, angle: float, wheelbase: float) -> Floats | None:
    """Lead a path over a waypoint at an angle [rad] to the left; None if there is no room."""
    distance = distance_along(poses)
    hill = _find_hill(distance, place, wheelbase)
    if hill is None:
        return None
    return _shift_sideways(poses, np.tan(angle) * (distance - distance[place]) * hill)


def bend_path(poses: Floats, offset: float) -> Floats:
    """Bend a path in one curve, half-way `offset` [m] to the left."""
    distance = distance_along(poses)
    return _shift_sideways(poses, offset * np.sin(np.pi * distance / distance[-1]) ** 2)


def pass_by(
    poses: Floats, place: int, offset: float, swing_radius: float, spacing: float
) -> Floats:
    """Return two straight legs past a waypoint, `offset` [m] left of it, with turns on the spot.

    Args:
        poses: (n, 3) the path; start and goal are kept.
        place: The waypoint.
        offset: Distance from it [m].
        swing_radius: Distance of the outermost wheel from the body origin [m].
        spacing: Largest distance between waypoints [m].
    """
    x, y, yaw = poses[place]
    via = np.array([x - offset * np.sin(yaw), y + offset * np.cos(yaw), 0.0])
    away = poses[-1, :2] - via[:2]
    via[2] = np.arctan2(away[1], away[0])
    there, _ = turn_and_drive(poses[0], via, swing_radius, spacing)
    on, _ = turn_and_drive(via, poses[-1], swing_radius, spacing)
    return np.concatenate([there, on[1:]])


def reverse_rover(poses: Floats, step: float) -> Floats:
    """Return the path driven tail first, with turns on the spot by half a turn at both ends.

    Args:
        poses: (n, 3) the path.
        step: Largest turn between waypoints [rad].
    """
    tail_first = poses + np.array([0.0, 0.0, np.pi])
    begin = turn_on_the_spot(poses[0, :2], poses[0, 2], np.pi, step)
    end = turn_on_the_spot(poses[-1, :2], tail_first[-1, 2], -np.pi, step)
    return np.concatenate([begin[:-1], tail_first, end[1:]])


def _find_hill(distance: Floats, place: int, wheelbase: float) -> Floats | None:
    """Return (n,) 0 at both ends of a path and 1 around a waypoint, with smooth ramps."""
    before = distance[place] - PLATEAU * wheelbase
    behind = distance[-1] - distance[place] - PLATEAU * wheelbase
    if min(before, behind) < LEAST_RAMP * wheelbase:
        return None
    up, down = (min(room, RAMP * wheelbase) for room in (before, behind))
    gap = np.abs(distance - distance[place]) - PLATEAU * wheelbase
    share = np.clip(gap / np.where(distance < distance[place], up, down), 0.0, 1.0)
    return np.asarray(1.0 - share**3 * (10.0 - 15.0 * share + 6.0 * share**2))


def _shift_sideways(poses: Floats, offset: Floats) -> Floats:
    """Shift waypoints to the left by offsets (n,) [m], and turn the headings along."""
    yaw, distance = np.unwrap(poses[:, 2]), distance_along(poses)
    slope = np.gradient(offset, distance) / (1.0 - np.gradient(yaw, distance) * offset)
    normal = np.column_stack([-np.sin(yaw), np.cos(yaw)])
    shifted = np.column_stack([poses[:, :2] + offset[:, None] * normal, yaw + np.arctan(slope)])
    shifted[[0, -1]] = poses[[0, -1]]
    return shifted
