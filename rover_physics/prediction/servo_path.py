"""What only the whole path shows of a rover with speed servos: lifts, wedged wheels, and drift.

A wheel may lift while the others drive the rover on, and touch down again. How high it gets is the
sum of its speeds of lifting.

A wheel that falls into a slot as narrow as itself is wedged between its faces. The forces on it
are not determined there: friction at both faces may lock it, whatever the motors do.

The servos turn the wheels as the path asks, whatever the rover does. A controller that follows the
path corrects slow errors. What builds up within the length of the rover, the drift, is too fast
for it.
"""

from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.crossing import Crossings
from rover_physics.prediction.path_kernels import Wheels
from rover_physics.status import PoseStatus

WEDGED = np.radians(140.0)
"""Angle [rad] between contacts in front of and behind a wheel from which it is wedged. The line
between them is then within 20 degrees of both normals, less than the friction angle of any ground
that a rover drives on, so friction at the two faces can hold any force."""
STOPPED, STALLED, LOCKED = 0.0, 1.0, 2.0
"""Values of `stalls` in a RESULT: wheels slide, motors stall, a wheel is wedged."""


def stop_in_slots(poses: np.ndarray, results: Any, crossings: Crossings) -> None:
    """Set the speed share to 0 where a wheel is wedged, in both RESULTs.

    Args:
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints, map frame.
        results: (n,) RESULT of each waypoint; `speed_share` and `stalls` are written.
        crossings: Poses between the waypoints; those of its results are written.
    """
    n = len(poses)
    order = _in_order(n, crossings.place)
    angles = np.concatenate([results["contact_angle"], crossings.results["contact_angle"]])[order]
    ahead = np.sign(np.concatenate([results["wheel_speed"], crossings.results["wheel_speed"]]))
    angles = angles * ahead[order]
    # The contact jumps from the face behind to the face in front.
    wedged = ((angles[1:] - angles[:-1] >= WEDGED) & (angles[:-1] < 0.0)).any(axis=1)
    for row in order[1:][wedged]:
        target = results if row < n else crossings.results
        target["speed_share"][row if row < n else row - n] = 0.0
        target["stalls"][row if row < n else row - n] = LOCKED


def find_lift_heights(
    wheels: Wheels, poses: np.ndarray, results: Any, crossings: Crossings
) -> tuple[Floats, Floats]:
    """Return the heights (n, 6), (m, 6) [m] to which wheels have lifted, at both RESULTs.

    Poses at one place, as while a wheel climbs a face, add nothing.

    Args:
        wheels: Sizes of wheels and rover.
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints, map frame.
        results: (n,) RESULT of each waypoint.
        crossings: Poses between the waypoints.
    """
    n = len(poses)
    rates = np.concatenate([results["lift_rate"], crossings.results["lift_rate"]])
    heights = np.zeros(rates.shape)
    if (rates > 0.0).any():
        order = _in_order(n, crossings.place)
        share = np.concatenate([results["speed_share"], crossings.results["speed_share"]])[order]
        rate = rates[order] / np.where(share > 0.0, share, 1.0)[:, None]
        way = _ways(wheels, np.concatenate([poses, crossings.poses])[order])
        for k in range(1, len(order)):
            lifted = rate[k] > 0.0
            rise = 0.5 * (rate[k] + np.fmax(rate[k - 1], 0.0)) * way[k - 1]
            heights[order[k]] = np.where(lifted, heights[order[k - 1]] + rise, 0.0)
    return heights[:n], heights[n:]


def climb_costs(poses: np.ndarray, results: Any, crossings: Crossings) -> Floats:
    """Return time [s] and energy [J] (n, 2) by which climbs of faces exceed what `add_up` counts.

    A wheel that climbs a face takes its time while the body hardly moves. On a stretch with a
    climb, the way of the rover is the mean way of its wheel centres from pose to pose. Both are
    sums since the first waypoint.

    Args:
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints, map frame.
        results: (n,) RESULT of each waypoint.
        crossings: Poses between the waypoints.
    """
    extra = np.zeros((len(poses), 2))
    for i in np.unique(crossings.waypoint[crossings.climbing]):
        rows = np.flatnonzero(crossings.waypoint == i)
        if i == 0 or (results["status"][i - 1 : i + 1] != PoseStatus.SETTLED).any():
            continue
        rows = rows[crossings.results["status"][rows] == PoseStatus.SETTLED]

        def along(name: str, i: int = i, rows: np.ndarray = rows) -> np.ndarray:
            ends = results[name][i - 1 : i + 1]
            return np.concatenate([ends[:1], crossings.results[name][rows], ends[1:]])

        centres, power, share = along("wheel_centres"), along("power"), along("speed_share")
        share = np.where(share > 0.0, share, 1.0)
        speed = np.hypot(results["motion"][i, 0], results["motion"][i, 1])
        if speed == 0.0:
            continue
        way = np.linalg.norm(np.diff(centres, axis=0), axis=2).mean(axis=1)
        duration = way / (0.5 * speed * (share[1:] + share[:-1]))
        energy = 0.5 * (power[1:] + power[:-1]) * duration
        rise = results["q"][i, 0] - results["q"][i - 1, 0]
        step = np.hypot(*(poses[i, :2] - poses[i - 1, :2]))
        counted = np.hypot(step, rise) / (0.5 * speed * (share[0] + share[-1]))
        extra[i] = max(duration.sum() - counted, 0.0), 0.0
        extra[i, 1] = max(energy.sum() - 0.5 * (power[0] + power[-1]) * counted, 0.0)
    return np.asarray(np.cumsum(extra, axis=0))


def find_drift(
    wheels: Wheels, window: float, poses: np.ndarray, results: Any, crossings: Crossings
) -> Floats:
    """Return the drift (n, 2) at waypoints: turn [rad] and way aside [m] that built up.

    Args:
        wheels: Sizes of wheels and rover.
        window: Way before each waypoint within which drift counts [m], of the body or, where it
            turns, of its outermost wheel.
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints, map frame.
        results: (n,) RESULT of each waypoint.
        crossings: Poses between the waypoints. In long turns, the largest drift of a waypoint and
            of the poses on the way to it counts; elsewhere waypoints are enough.
    """
    n = len(poses)
    if not (results["deviation"].any() or crossings.results["deviation"].any()):
        return np.zeros((n, 2))
    long_steps = np.append(False, _ways(wheels, poses) > wheels.radius)
    turns = crossings.select(long_steps[crossings.waypoint] & ~crossings.climbing)
    order = _in_order(n, turns.place)
    at = np.concatenate([poses, turns.poses])[order]
    share, deviation, status = (
        np.concatenate([results[name], turns.results[name]])[order]
        for name in ("speed_share", "deviation", "status")
    )
    drives = (status == PoseStatus.SETTLED) & (share > 0.0)
    rate = np.where(drives[:, None], deviation, 0.0)
    rate /= np.where(drives, share, 1.0)[:, None]
    c, s = np.cos(at[:, 2]), np.sin(at[:, 2])
    x, y = c * rate[:, 0] - s * rate[:, 1], s * rate[:, 0] + c * rate[:, 1]
    rate = np.column_stack([x, y, rate[:, 2]])
    way = _ways(wheels, at)
    sums = np.zeros(rate.shape)
    sums[1:] = np.cumsum(0.5 * (rate[1:] + rate[:-1]) * way[:, None], axis=0)
    place = np.append(0.0, np.cumsum(way))
    built_up = sums - sums[np.searchsorted(place, place - window)]
    drift = np.zeros((n, 2))
    owner = np.append(np.arange(n), turns.waypoint)[order]
    found = np.column_stack([np.abs(built_up[:, 2]), np.hypot(built_up[:, 0], built_up[:, 1])])
    np.maximum.at(drift, owner, found)
    return drift


def _in_order(n: int, place: np.ndarray) -> np.ndarray:
    """Return n waypoints and the poses at places between them, numbered one after the other."""
    places = np.append(np.arange(n), place)
    return np.lexsort((np.arange(len(places)) >= n, places))


def _ways(wheels: Wheels, poses: np.ndarray) -> Floats:
    """Return the ways (n - 1,) between poses [m]: of the body or, if it turns, of a wheel."""
    steps = np.diff(poses, axis=0)
    swing = wheels.reach * np.abs((steps[:, 2] + np.pi) % (2.0 * np.pi) - np.pi)
    return np.maximum(np.hypot(steps[:, 0], steps[:, 1]), swing)
