# SPDX-License-Identifier: Apache-2.0
"""Generates candidate paths in the plane between two poses: a direct curve and a fan around it.

Every candidate is driven forward, leaves the start along the start's heading and arrives along the
goal's heading. The direct connection is a cubic Hermite curve; it is a straight line if both
headings point along the chord. The fan adds cosine bumps across the chord. Their slope is zero at
both ends, so that both headings remain exact. Curves tighter than the smallest radius are dropped.
If the direct connection is too tight (opposite headings, a goal behind the rover), the arcs and
lines of Dubins (1957) are used instead. They connect any two poses with the smallest radius, so
that at least one candidate exists. A rover that turns on the spot may also turn, drive straight
ahead and turn again, if this is shorter than all curves.
"""

import numpy as np

from rover_physics.numerics.interruption import check_interruption
from rover_planner.angles import wrap
from rover_planner.errors import PlanningError
from rover_planner.planning.dubins import count_steps, dubins_paths
from rover_planner.planning.path_geometry import MAX_WAYPOINTS, path_length

MIN_RADIUS = 0.8
"""Default smallest radius of a candidate [m]: the wheelbase of the LSR-1 preset.

If the radius equals the wheelbase, the inner end wheels are steered by about 40 degrees.
"""

LEAST_TURN = 1e-3
"""Turn on the spot [rad] below which it is left out."""
_SAME_PLACE = 1e-9
"""Distance below which start and goal are the same position [m]."""
_LONG_WAY_ROUND = 1.5
"""Dubins paths longer than the shortest one by more than this factor are dropped."""
_FINE = np.linspace(0.0, 1.0, 1001)
"""Curve parameters at which a curve is measured, and from which its waypoints are interpolated."""
_SHARES = np.column_stack(
    [
        _FINE**2 * (3 - 2 * _FINE),
        _FINE * (1 - _FINE) ** 2,
        -(_FINE**2) * (1 - _FINE),
        0.5 * (1 - np.cos(2 * np.pi * _FINE)),
    ]
)
"""Shares (n, 4) of chord, end tangents and bump in a curve there."""
_TANGENT_SCALES = (1.0, 1.6, 2.4)
"""Lengths of the end tangents in chords; the first one whose direct curve is drivable is used."""


def generate_candidates(
    start,
    goal,
    *,
    count: int = 9,
    spacing: float = 0.3,
    waypoint_spacing: float = 0.02,
    min_radius: float = MIN_RADIUS,
    swing_radius: float | None = None,
) -> list[np.ndarray]:
    """Generate candidate paths from start to goal: the direct one first, then outwards.

    Args:
        start: x, y [m] and yaw [rad] of the body origin in the map frame.
        goal: x, y [m] and yaw [rad] of the body origin in the map frame.
        count: Largest number of candidates.
        spacing: Lateral distance between neighbouring candidates half-way [m].
        waypoint_spacing: Largest distance between waypoints along the path [m].
        min_radius: Radius of the tightest curve the rover may drive [m].
        swing_radius: Distance of the outermost wheel from the body origin [m] if the rover turns
            on the spot, None if not.

    Returns:
        One to `count` arrays (n, 3) of x, y [m] and yaw [rad, in -pi to pi], yaw along the
        tangent. The waypoints of a path are equidistant along it, at most `waypoint_spacing`
        apart; the first is the start and the last the goal. A path with turns on the spot comes
        last. A single pose if start and goal are the same.

    Raises:
        PlanningError: An argument is NaN or out of range, or the path has more than MAX_WAYPOINTS.
    """
    start, goal = check_pose("start", start), check_pose("goal", goal)
    if not (isinstance(count, int | np.integer) and count >= 1):
        raise PlanningError(f"count is {count!r}; it must be a whole number of at least 1")
    lengths = {"spacing": spacing, "waypoint_spacing": waypoint_spacing, "min_radius": min_radius}
    for name, value in lengths.items():
        if not (np.isfinite(value) and value > 0.0):
            raise PlanningError(f"{name} is {value!r}; it must be a finite number above 0")
    with np.errstate(over="ignore"):
        chord = float(np.hypot(*(goal[:2] - start[:2])))
    if not chord / waypoint_spacing < MAX_WAYPOINTS:
        raise PlanningError(
            f"the goal is {chord:.4g} m from the start: in steps of {waypoint_spacing} m that is "
            f"more than {MAX_WAYPOINTS} waypoints"
        )
    turn = abs(wrap(goal[2] - start[2]))
    if chord <= _SAME_PLACE and turn <= _SAME_PLACE:
        return [goal[None, :].copy()]

    paths = []
    if chord > _SAME_PLACE:
        paths = _build_fan(start, goal, count, spacing, waypoint_spacing, min_radius)
    if not paths:
        paths = dubins_paths(start, goal, min_radius, waypoint_spacing, count)
        longest = _LONG_WAY_ROUND * path_length(paths[0])
        paths = [path for path in paths if path_length(path) <= longest]
    if swing_radius is not None:
        turned, length = turn_and_drive(start, goal, swing_radius, waypoint_spacing)
        if length < min(path_length(path) for path in paths) - _SAME_PLACE:
            paths = [*paths[: count - 1], turned]
    for path in paths:
        path[0], path[-1] = start, goal  # without rounding errors
        path[:, 2] = wrap(path[:, 2])
    return paths


def _build_fan(start, goal, count, spacing, waypoint_spacing, min_radius) -> list[np.ndarray]:
    """Sample the direct curve and its neighbours; return [] if the direct one is too tight.

    A curve is the start plus shares of its chord, its end tangents and a bump across the chord.
    """
    chord, yaws = goal[:2] - start[:2], np.array([start[2], goal[2]])
    length = np.hypot(*chord)
    left = np.array([-chord[1], chord[0]]) / length
    for scale in _TANGENT_SCALES:
        tangents = scale * length * np.column_stack([np.cos(yaws), np.sin(yaws)])
        paths = []
        for k in range(count):  # to the left and to the right alternately
            offset = spacing * ((k + 1) // 2) * (1 if k % 2 else -1)
            places = _SHARES @ np.vstack([chord, tangents, offset * left])
            path = _sample(places, yaws, waypoint_spacing, min_radius)
            if path is not None:
                path[:, :2] += start[:2]
                paths.append(path)
            elif k == 0:
                break
        if paths:
            return paths
    return []


def _sample(
    places: np.ndarray, yaws: np.ndarray, waypoint_spacing: float, min_radius: float
) -> np.ndarray | None:
    """Sample equidistant poses of a curve; None if it is too tight to drive.

    Args:
        places: (n, 2) x, y of the curve at many places [m].
        yaws: (2,) its headings at both ends [rad].
        waypoint_spacing: Largest distance of the poses [m].
        min_radius: Smallest radius that is not too tight [m].
    """
    check_interruption()  # a question may have many long candidates
    steps = np.diff(places, axis=0)
    pieces = np.hypot(*steps.T)
    if pieces.min() <= 1e-6 * pieces.max():
        return None
    driven = np.concatenate([[0.0], np.cumsum(pieces)])
    # A piece of the curve has its mean heading half-way, both ends have their own.
    middles = np.concatenate([[0.0], driven[1:] - 0.5 * pieces, driven[-1:]])
    along = np.arctan2(steps[:, 1], steps[:, 0])
    yaw = np.unwrap(np.concatenate([yaws[:1], along, yaws[1:]]))
    if (np.abs(np.diff(yaw)) * min_radius > np.diff(middles) * (1 + 1e-9)).any():
        return None
    marks = np.linspace(0.0, driven[-1], 1 + count_steps(driven[-1], waypoint_spacing))
    x, y = (np.interp(marks, driven, values) for values in places.T)
    return np.column_stack([x, y, np.interp(marks, middles, yaw)])


def check_pose(name: str, pose) -> np.ndarray:
    """Return a pose (3,) x, y [m] and yaw [rad, in -pi to pi], checked.

    Raises:
        PlanningError: It is something else, or not finite.
    """
    try:
        values = np.array(pose, dtype=float)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.shape != (3,) or not np.isfinite(values).all():
        given = values.tolist() if values.size else repr(pose)
        raise PlanningError(f"{name} is {given}; it must be three finite numbers x, y, yaw")
    values[2] = wrap(values[2])
    return values


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
    shares = np.linspace(0.0, 1.0, 1 + count_steps(length, waypoint_spacing))
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
    count = 1 + count_steps(abs(turn), step)
    return np.column_stack([np.tile(place, (count, 1)), yaw + np.linspace(0.0, turn, count)])
