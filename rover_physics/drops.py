"""Wheels that roll off an edge: where they fall, and how far they drop.

A wheel whose contact lies behind it, steeper than friction holds, rolls and slides down whatever
the motors do. Where that is over within little more than a wheel's size it has rolled off an edge:
until it lands there is no equilibrium and none is needed, and how far it drops is a result. Where
it goes on for longer the wheel is on a slope too steep to stand on, and the slope is judged.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.crossing import HEIGHT_JUMP, SHORTEST, Crossings

LEAST_ANGLE = np.radians(15.0)
"""A wheel falls only from contacts at least this steep, however slippery they are."""
MOST_FALLING = 2
"""One axle at a time may fall; more is a rover sliding down a slope."""
ON_THE_EDGE = np.radians(-2.0)
"""Contact angle from which on a wheel turns over an edge."""
ROUNDING = 1e-9
"""Descents [m] that are none."""
LONGEST_FALL = 2.5
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
    n = len(poses)
    order = np.argsort(np.concatenate([np.arange(n), crossings.place]), kind="stable")

    def in_order(at_waypoints: np.ndarray, between: np.ndarray) -> np.ndarray:
        return np.concatenate([at_waypoints, between])[order]

    extra = crossings.results
    steps = np.hypot(*np.diff(in_order(poses, crossings.poses)[:, :2], axis=0).T)
    distance = np.concatenate([[0.0], np.cumsum(steps)])
    angle = direction * in_order(results["contact_angle"], extra["contact_angle"])
    steep = _find_steep(angle, in_order(results["friction"], extra["friction"]))
    falling = _keep_short_runs(steep, distance, radius)
    rolling_over = _extend_to_edges(falling, angle, distance, radius)
    heights = in_order(results["wheel_centres"], extra["wheel_centres"])[:, :, 2]
    owner = in_order(np.arange(n), crossings.waypoint)
    drops = _measure_drops(radius, heights, steps, rolling_over, owner, n)
    unordered = np.empty_like(falling)
    unordered[order] = falling
    return Falls(unordered[:n], unordered[n:], drops)


def _find_steep(contact_angle: np.ndarray, friction: np.ndarray) -> np.ndarray:
    """Return (k, 6) True where contacts behind a wheel are steeper than friction holds.

    Not where the rover as a whole goes downhill: then it slides, and no wheel falls by itself.
    """
    held_by_friction = np.arctan(np.nan_to_num(friction, nan=1.0))
    steep = contact_angle < -np.maximum(held_by_friction, LEAST_ANGLE)
    others = np.where(steep, np.nan, contact_angle)
    count = np.maximum((~steep).sum(axis=1), 1)
    downhill = np.nansum(others, axis=1) / count < -0.5 * held_by_friction.min(axis=1)
    steep[downhill | (steep.sum(axis=1) > MOST_FALLING)] = False
    return steep


def _keep_short_runs(steep: np.ndarray, distance: np.ndarray, radius: float) -> np.ndarray:
    """Return `steep` (k, 6) without runs that begin or end the path or are longer than a fall."""
    kept = np.zeros_like(steep)
    for wheel in range(6):
        padded = np.concatenate([[False], steep[:, wheel], [False]]).astype(int)
        starts, ends = np.flatnonzero(np.diff(padded) == 1), np.flatnonzero(np.diff(padded) == -1)
        for start, end in zip(starts, ends, strict=True):
            inside = start > 0 and end < len(steep)
            if inside and distance[end] - distance[start - 1] <= LONGEST_FALL * radius:
                kept[start:end, wheel] = True
    return kept


def _extend_to_edges(
    falling: np.ndarray, angle: np.ndarray, distance: np.ndarray, radius: float
) -> np.ndarray:
    """Return `falling` with the way on which a wheel turns over the edge before it falls."""
    extended = falling.copy()
    for row, wheel in np.argwhere(falling[1:] & ~falling[:-1]):
        k = row
        while k >= 0 and angle[k, wheel] < ON_THE_EDGE and distance[row] - distance[k] <= radius:
            extended[k, wheel] = True
            k -= 1
    return extended


def _measure_drops(
    radius: float,
    heights: np.ndarray,
    steps: np.ndarray,
    falling: np.ndarray,
    owner: np.ndarray,
    n: int,
) -> np.ndarray:
    """Add up the descent of each wheel while it falls; a sudden descent at one place is a fall."""
    descents = np.nan_to_num(np.maximum(-np.diff(heights, axis=0), 0.0))
    descents[descents < ROUNDING] = 0.0
    sudden = (descents > HEIGHT_JUMP * radius) & (steps[:, None] <= 2.0 * SHORTEST)
    dropping = falling[:-1] | falling[1:] | sudden
    drops = np.zeros((n, 6))
    for wheel in range(6):
        fallen, last = 0.0, -1
        for k in np.flatnonzero(dropping[:, wheel]).tolist():
            fallen = descents[k, wheel] + (fallen if k == last + 1 else 0.0)
            drops[owner[k + 1], wheel] = max(drops[owner[k + 1], wheel], fallen)
            last = k
    return drops
