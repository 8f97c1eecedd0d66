# SPDX-License-Identifier: Apache-2.0
"""Halves stretches of path until the poses at their ends tell what is between them.

The pose in the middle of a stretch is evaluated, and each half that needs it becomes a stretch.
Poses of all stretches are rows of the same arrays: first the known ones, then those that are
evaluated, in the order in which they were asked for.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from rover_physics.numerics.kernels import exact_kernel
from rover_physics.prediction.drops import look_for_failure
from rover_physics.prediction.path_kernels import (
    MIN_SPACING,
    distance_between,
    jumps_between,
    turn_between,
    wanted_spacing,
)
from rover_physics.status import PoseStatus


class AtFailure(IntEnum):
    """What is searched no further once a pose between waypoints fails in any case."""

    SEARCH_ON = 0
    """Nothing: all is searched."""
    LEAVE_REST = 1
    """The rest of its path."""
    LEAVE_PATH = 2
    """Its whole path."""


NEXT, ROWS, CLOSED = 0, 1, 2
"""Places in `Stretches.numbers` of the row that is evaluated next, of the number of rows that are
known or asked for, and of that of closed stretches."""


class Stretches(NamedTuple):
    """Stretches of path, which kernels write."""

    ends: np.ndarray
    """(rows, 2) for a row that is evaluated, the rows at the ends of its stretch."""
    place: np.ndarray
    """(rows,) place along the path in waypoints."""
    waypoint: np.ndarray
    """(rows,) index of the waypoint that follows."""
    closed: np.ndarray
    """(rows, 2) ends of stretches in which a contact still jumps, but that are at one place."""
    numbers: np.ndarray
    """(3,) see NEXT, ROWS, CLOSED."""
    last: np.ndarray
    """(paths,) last waypoint of each path that is searched; may be shared by threads."""
    path: np.ndarray
    """(waypoints,) path of each waypoint, read only, as is the next."""
    at_failure: int
    """An AtFailure."""


NO_STRETCHES = Stretches(
    np.empty((0, 2), np.int64), np.empty(0), np.empty(0, np.int64), np.empty((0, 2), np.int64),
    np.zeros(3, np.int64), np.empty(0, np.int64), np.empty(0, np.int64), int(AtFailure.SEARCH_ON),
)  # fmt: skip
"""Value of `stretches` where poses are given."""


@exact_kernel
def ask_middle(stretches, poses, motions, results, row):
    """Write pose and motion of the row that is evaluated next; False if it is not asked any more.

    The motion is that of the end of the stretch, which leads there.
    """
    before, after = stretches.ends[row, 0], stretches.ends[row, 1]
    waypoint = stretches.waypoint[before]
    stretches.waypoint[row] = waypoint
    first, last = stretches.place[before], stretches.place[after]
    stretches.place[row] = first + 0.5 * (last - first)
    here, there = poses[before], poses[after]
    for k in range(2):
        poses[row, k] = here[k] + 0.5 * (there[k] - here[k])
    poses[row, 2] = here[2] + 0.5 * turn_between(here, there)
    for k in range(3):
        motions[row, k] = results[after].motion[k]
    return waypoint <= stretches.last[stretches.path[waypoint]]


@exact_kernel
def halve(stretches, model, limits, poses, results, row):
    """Ask for the halves of a stretch whose middle is evaluated, or close it.

    It is closed where a contact jumps but the rover does not settle in the middle.
    """
    before, after = stretches.ends[row, 0], stretches.ends[row, 1]
    if results[row].status == PoseStatus.NOT_SETTLED:
        if jumps_between(model, results[before], results[after]):
            _close(stretches, before, after)
        return
    stops = stretches.at_failure != AtFailure.SEARCH_ON
    if stops and look_for_failure(model, limits, results[row])[1]:
        _leave(stretches, stretches.waypoint[row])
    _sort_half(stretches, model, poses, results, before, row)
    _sort_half(stretches, model, poses, results, row, after)


@exact_kernel
def _leave(stretches, waypoint):
    """Search a path no further than a waypoint at which it fails, or not at all."""
    path = stretches.path[waypoint]
    if stretches.at_failure == AtFailure.LEAVE_PATH:
        waypoint = -1
    stretches.last[path] = min(stretches.last[path], waypoint)


@exact_kernel
def _sort_half(stretches, model, poses, results, before, after):
    """Close a half, ask for its middle, or leave it as it is."""
    linkage, numbers = model.linkage, stretches.numbers
    distance = distance_between(poses[before], poses[after], linkage.swing_radius)
    is_place = distance < MIN_SPACING * linkage.radius
    if is_place and jumps_between(model, results[before], results[after]):
        _close(stretches, before, after)
    elif wanted_spacing(model, results[before], results[after]) < distance:
        row = numbers[ROWS]
        stretches.ends[row, 0], stretches.ends[row, 1] = before, after
        numbers[ROWS] = row + 1


@exact_kernel
def _close(stretches, before, after):
    row = stretches.numbers[CLOSED]
    stretches.closed[row, 0], stretches.closed[row, 1] = before, after
    stretches.numbers[CLOSED] = row + 1
