"""Wheels that roll off an edge: where they fall, and how far they drop.

A wheel slides down if its contact is behind it and steeper than friction can hold, whatever the
motors do. If this lasts little more than a wheel's size, the wheel has rolled off an edge. Until
it lands there is no equilibrium, and none is required; the height of the drop is a result. If it
lasts longer, the wheel is on a slope that is too steep, and the usual limits apply.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.numerics.kernels import allocating_kernel, exact_kernel
from rover_physics.numerics.read_only import view_read_only
from rover_physics.prediction.crossing import HEIGHT_JUMP, MIN_SPACING, Crossings
from rover_physics.prediction.path_kernels import Wheels, way_between

MIN_ANGLE = np.radians(15.0)
"""Least steepness [rad] of a contact from which a wheel falls, however low its friction."""
MAX_FALLING = 2
"""Most wheels that can fall at once: one axle. If there are more, the rover slides downhill."""
ON_THE_EDGE = np.radians(-2.0)
"""Contact angle [rad] below which a wheel rolls over an edge before it falls."""
ROUNDING = 1e-9
"""Descent [m] below which it counts as zero."""
MAX_FALL_LENGTH = 2.5
"""Longest distance [wheel radii] the rover drives from before the edge to after the landing."""


@dataclass(frozen=True, eq=False)
class Falls:
    """Where wheels fall along a path."""

    at_waypoints: np.ndarray
    """(n, 6) True for wheels that fall at a waypoint."""
    between: np.ndarray
    """(m, 6) True for wheels that fall at a pose between waypoints."""
    drops: np.ndarray
    """(n, 6) largest drop of each wheel at a waypoint or on the way to it [m]."""
    decided: int
    """Number of waypoints, from the first, whose falls no later pose of the path can change."""
    restart: int
    """Last of these waypoints from which the falls can be found without those before it; 0 if
    there is none."""


def find_falls(
    wheels: Wheels,
    poses: np.ndarray,
    results: Any,
    crossings: Crossings,
) -> Falls:
    """Find where wheels fall along a path, and how far they drop.

    Args:
        wheels: Size of wheels and rover.
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints, map frame.
        results: (n,) RESULT of each waypoint.
        crossings: Poses between the waypoints.
    """
    path = view_read_only(poses), view_read_only(results)
    found = _find_falls(wheels, *path, crossings.points)
    return Falls(*found)


@allocating_kernel
def _find_falls(wheels, poses, results, between):
    """Return the fields of `Falls`; `wheels` are Wheels, `between` holds PathPoints."""
    radius = wheels.radius
    n, m = len(poses), len(between.place)
    order = np.empty(n + m, np.int64)
    _merge(n, between.place, order)
    steps, distance = np.zeros(n + m), np.zeros(n + m)
    angle, height = np.empty((n + m, 6)), np.empty((n + m, 6))
    steep, turning = np.zeros((n + m, 6), np.bool_), np.zeros((n + m, 6), np.bool_)
    last = poses[0]
    for k in range(n + m):
        i = order[k]
        here = poses[i] if i < n else between.poses[i - n]
        result = results[i] if i < n else between.results[i - n]
        steps[k] = way_between(last, here, wheels.reach)
        distance[k] = steps[k] + (distance[k - 1] if k > 0 else 0.0)
        if _read_contacts(result, angle[k], height[k]) < -MIN_ANGLE:
            _find_steep(angle[k], result.friction, steep[k])
        last = here
    first_open = _find_first_open(distance, radius, angle, steep)
    flat = np.empty(n + m, np.bool_)
    for k in range(n + m):
        flat[k] = not np.any(steep[k])
    _keep_short_runs(distance, radius, steep)
    _extend_to_edges(steep, angle, distance, radius, turning)
    fallen, drops = np.zeros((n + m, 6)), np.zeros((n, 6))
    _measure_drops(radius, height, steps, turning, fallen)
    at_waypoints, at_between = np.empty((n, 6), np.bool_), np.empty((m, 6), np.bool_)
    decided, restart = 0, 0
    for k in range(n + m):
        i = order[k]
        if i < n and k < first_open:
            decided += 1
            if flat[k] and not np.any(turning[k]) and not np.any(fallen[k] > 0.0):
                restart = i
        owner = i if i < n else between.waypoint[i - n]
        for wheel in range(6):
            drops[owner, wheel] = max(drops[owner, wheel], fallen[k, wheel])
            if i < n:
                at_waypoints[i, wheel] = steep[k, wheel]
            else:
                at_between[i - n, wheel] = steep[k, wheel]
    return at_waypoints, at_between, drops, decided, restart


@exact_kernel
def _find_first_open(distance, radius, angle, steep):
    """Return the first row whose falls depend on poses after the last row.

    These are the rows of a run in `steep` (k, 6) that may still end as a short one, and the rows
    before it, or before a run that may begin next, while a wheel rolls over.
    """
    rows = distance.size
    first = rows
    for wheel in range(6):
        before = rows - 1
        while before >= 0 and steep[before, wheel]:
            before -= 1
        if before < rows - 1:
            too_long = distance[rows - 1] - distance[before] > MAX_FALL_LENGTH * radius
            if before < 0 or too_long:
                continue
            first = min(first, before + 1)
        k = before
        while (
            k >= 0 and angle[k, wheel] < ON_THE_EDGE and distance[before] - distance[k] <= radius
        ):
            first = min(first, k)
            k -= 1
    return first


@exact_kernel
def _merge(n, place, order):
    """Write the rows in path order into `order`: waypoint i as i, the i-th place as n + i."""
    i = 0
    for k in range(n + place.size):
        waypoint = k - i
        if i < place.size and (waypoint == n or place[i] < waypoint):
            order[k] = n + i
            i += 1
        else:
            order[k] = waypoint


@exact_kernel
def _read_contacts(result, angle, height):
    """Write contact angles [rad], positive where each wheel rolls to, and heights [m].

    Returns the smallest angle.
    """
    smallest = 0.0
    for wheel in range(6):
        angle[wheel] = result.contact_angle[wheel]
        if result.wheel_speed[wheel] < 0.0:
            angle[wheel] = -angle[wheel]
        height[wheel] = result.wheel_centres[wheel, 2]
        if angle[wheel] < smallest:
            smallest = angle[wheel]
    return smallest


@exact_kernel
def _find_steep(angle, friction, steep):
    """Write (6,) True where the contact is behind the wheel and steeper than friction can hold.

    All are False if the rover as a whole goes downhill: it then slides, and no wheel falls alone.
    """
    count, others, least_held = 0, 0.0, np.inf
    for wheel in range(6):
        mu = friction[wheel]
        held = np.arctan(mu) if mu == mu else np.arctan(1.0)
        least_held = min(least_held, held)
        steep[wheel] = angle[wheel] < -max(held, MIN_ANGLE)
        if steep[wheel]:
            count += 1
        elif angle[wheel] == angle[wheel]:
            others += angle[wheel]
    if count > MAX_FALLING or others / max(6 - count, 1) < -0.5 * least_held:
        steep[:] = False


@exact_kernel
def _keep_short_runs(distance, radius, steep):
    """Clear runs in `steep` (k, 6) that touch an end of the path or are longer than a fall."""
    rows = distance.size
    for wheel in range(6):
        start = 0
        while start < rows:
            end = start
            while end < rows and steep[end, wheel]:
                end += 1
            inside = start > 0 and end < rows
            if not inside or distance[end] - distance[start - 1] > MAX_FALL_LENGTH * radius:
                steep[start:end, wheel] = False
            start = end + 1


@exact_kernel
def _extend_to_edges(falling, angle, distance, radius, extended):
    """Write `falling` (k, 6) into `extended`, with the rows before it while a wheel rolls over."""
    rows = distance.size
    for wheel in range(6):
        for row in range(rows):
            extended[row, wheel] = falling[row, wheel]
        for row in range(rows - 1):
            k = row if falling[row + 1, wheel] and not falling[row, wheel] else -1
            while (
                k >= 0 and angle[k, wheel] < ON_THE_EDGE and distance[row] - distance[k] <= radius
            ):
                extended[k, wheel] = True
                k -= 1


@exact_kernel
def _measure_drops(radius, height, steps, falling, fallen):
    """Add up the descent [m] of each falling wheel; a sudden descent at one place also counts.

    What a wheel rises meanwhile, such as when the one beside it falls, is subtracted.
    """
    for wheel in range(6):
        for k in range(1, steps.size):
            descent = height[k - 1, wheel] - height[k, wheel]
            if not abs(descent) >= ROUNDING:
                descent = 0.0
            sudden = descent > HEIGHT_JUMP * radius and steps[k] <= 2.0 * MIN_SPACING
            if falling[k - 1, wheel] or falling[k, wheel] or sudden:
                fallen[k, wheel] = max(fallen[k - 1, wheel] + descent, 0.0)
