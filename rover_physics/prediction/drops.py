"""Wheels that roll off an edge: where they fall, and how far they drop.

A wheel whose contact lies behind it, steeper than friction holds, rolls and slides down whatever
the motors do. Where that is over within little more than a wheel's size it has rolled off an edge:
until it lands there is no equilibrium and none is needed, and how far it drops is a result. Where
it goes on for longer the wheel is on a slope too steep to stand on, and the slope is judged.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.numerics.kernels import allocating_kernel, exact_kernel
from rover_physics.prediction.crossing import HEIGHT_JUMP, MIN_SPACING, Crossings

MIN_ANGLE = np.radians(15.0)
"""A wheel falls only from contacts at least this steep, however slippery they are."""
MAX_FALLING = 2
"""One axle at a time may fall; more is a rover sliding down a slope."""
ON_THE_EDGE = np.radians(-2.0)
"""Contact angle from which on a wheel turns over an edge."""
ROUNDING = 1e-9
"""Descents [m] that are none."""
MAX_FALL_LENGTH = 2.5
"""Way of the rover, in wheel radii, from before the edge to after the landing."""


@dataclass(frozen=True, eq=False)
class Falls:
    """Where wheels fall along a path."""

    at_waypoints: np.ndarray
    """(n, 6) True for wheels that fall at a waypoint."""
    between: np.ndarray
    """(m, 6) the same between waypoints."""
    drops: np.ndarray
    """(n, 6) how far each wheel has dropped when it comes to a waypoint [m]."""


def find_falls(
    radius: float,
    poses: np.ndarray,
    results: Any,
    crossings: Crossings,
    direction: float = 1.0,
) -> Falls:
    """Find where wheels of `radius` [m] fall along a path with its crossings.

    `direction` is 1 where the rover drives forwards along the path, -1 backwards.
    """
    found = _find_falls(float(radius), float(direction), poses, results, crossings.points)
    return Falls(*found)


@allocating_kernel
def _find_falls(radius, direction, poses, results, between):
    """Return the fields of `Falls`; `between` holds PathPoints."""
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
        steps[k] = np.hypot(here[0] - last[0], here[1] - last[1])
        distance[k] = steps[k] + (distance[k - 1] if k > 0 else 0.0)
        if _read_contacts(result, direction, angle[k], height[k]) < -MIN_ANGLE:
            _find_steep(angle[k], result.friction, steep[k])
        last = here
    _keep_short_runs(distance, radius, steep)
    _extend_to_edges(steep, angle, distance, radius, turning)
    fallen, drops = np.zeros((n + m, 6)), np.zeros((n, 6))
    _measure_drops(radius, height, steps, turning, fallen)
    at_waypoints, at_between = np.empty((n, 6), np.bool_), np.empty((m, 6), np.bool_)
    for k in range(n + m):
        i = order[k]
        owner = i if i < n else between.waypoint[i - n]
        for wheel in range(6):
            drops[owner, wheel] = max(drops[owner, wheel], fallen[k, wheel])
            if i < n:
                at_waypoints[i, wheel] = steep[k, wheel]
            else:
                at_between[i - n, wheel] = steep[k, wheel]
    return at_waypoints, at_between, drops


@exact_kernel
def _merge(n, place, order):
    """Write the waypoints 0 to n - 1 and then the m places, as n + i, in the order of the path."""
    i = 0
    for k in range(n + place.size):
        waypoint = k - i
        if i < place.size and (waypoint == n or place[i] < waypoint):
            order[k] = n + i
            i += 1
        else:
            order[k] = waypoint


@exact_kernel
def _read_contacts(result, direction, angle, height):
    """Write contact angles [rad] and heights [m] of the wheels; return the smallest angle."""
    smallest = 0.0
    for wheel in range(6):
        angle[wheel] = direction * result.contact_angle[wheel]
        height[wheel] = result.wheel_centres[wheel, 2]
        if angle[wheel] < smallest:
            smallest = angle[wheel]
    return smallest


@exact_kernel
def _find_steep(angle, friction, steep):
    """Write (6,) True where contacts behind a wheel are steeper than friction holds.

    Not where the rover as a whole goes downhill: then it slides, and no wheel falls by itself.
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
    """Drop from `steep` (k, 6) runs that begin or end the path or are longer than a fall."""
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
    """Write `falling` with the way on which a wheel turns over the edge before it falls."""
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
    """Add up the descent of each wheel while it falls; a sudden descent at one place is a fall."""
    for wheel in range(6):
        for k in range(1, steps.size):
            descent = height[k - 1, wheel] - height[k, wheel]
            if not descent >= ROUNDING:
                descent = 0.0
            sudden = descent > HEIGHT_JUMP * radius and steps[k] <= 2.0 * MIN_SPACING
            if falling[k - 1, wheel] or falling[k, wheel] or sudden:
                fallen[k, wheel] = fallen[k - 1, wheel] + descent
