# SPDX-License-Identifier: Apache-2.0
"""Effects of speed servos that only the whole path shows: lifts, momentum and drift.

A wheel may lift while the others drive the rover on, and touch down again. How high it gets is the
sum of its speeds of lifting.

Where forces are missing for a few millimetres, the rover's momentum carries it on.

The servos turn the wheels as the path asks, whatever the rover does. A controller that follows the
path corrects slow errors. What builds up within the length of the rover, the drift, is too fast
for it.
"""

from functools import cached_property
from typing import Any

import numpy as np

from rover_physics.limits.table import MIN_SPEED_SHARE, RUNAWAY
from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.packed_model import PackedModel
from rover_physics.prediction.path_kernels import (
    FACE,
    LONGEST_STEP,
    Crossings,
    distances_between,
)
from rover_physics.prediction.slots import stop_in_slots
from rover_physics.results.record import select_results
from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import swing_radius
from rover_physics.status import PoseStatus


def write_servo_path(
    model: PackedModel, poses: np.ndarray, results: Any, crossings: Crossings
) -> None:
    """Write what the path decides under policy "servo": speeds, drift and lifts.

    Args:
        model: The model.
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints, map frame.
        results: (n,) RESULT of each waypoint, written.
        crossings: Poses between the waypoints; their results are written.
    """
    course = _Course(model.rover, poses, results, crossings)
    _carry_by_momentum(course)
    stop_in_slots(results, crossings)
    results["drift"] = _find_drift(course)
    _write_lift_heights(course)


class _Course:
    """Waypoints and the poses between them, in the order of the path."""

    def __init__(self, rover: Rover, poses: Floats, results: Any, crossings: Crossings):
        self.rover, self.crossings = rover, crossings
        self.radius, self.swing_radius = rover.wheel.radius, swing_radius(rover)
        self.waypoints, self.results = poses, results
        self.order = crossings.order_among(len(poses))
        self.poses = np.concatenate([poses, crossings.poses])[self.order]

    @cached_property
    def distances(self) -> Floats:
        """Distances from each pose to the next [m]."""
        return distances_between(self.swing_radius, self.poses)

    def values(self, name: str) -> Floats:
        """Return a field of RESULT at all poses."""
        parts = [self.results[name], self.crossings.results[name]]
        return np.asarray(np.concatenate(parts)[self.order])

    def write(self, name: str, values: Floats) -> None:
        """Write a field of RESULT at all poses."""
        n, unsorted = len(self.results), np.empty_like(values)
        unsorted[self.order] = values
        self.results[name], self.crossings.results[name] = unsorted[:n], unsorted[n:]


def _carry_by_momentum(course: _Course) -> None:
    """Let the rover roll on where its kinetic energy covers what is missing to drive or to brake.

    Where no speed balances, speed share and shares of friction and torque become those with which
    it rolls. A rover that stands, as while its wheels turn or climb, or runs against a face, has
    no momentum. On the spot, speed and way are those of the outermost wheel.
    """
    deficits = course.values("deficit")
    if not deficits.any():
        return
    share, motion = course.values("speed_share"), course.values("motion")
    ahead = course.values("contact_angle") * np.sign(course.values("wheel_speed"))
    speed = np.hypot(motion[:, 0], motion[:, 1])
    speed = np.where(speed > 0.0, speed, course.swing_radius * np.abs(motion[:, 2]))
    nominal = speed**2 / (2.0 * course.rover.gravity)
    distances = np.append(0.0, course.distances)
    is_waypoint = course.order < len(course.waypoints)
    repeated = is_waypoint & np.append(False, is_waypoint[:-1])
    stands = ((distances == 0.0) & ~repeated) | (ahead.max(axis=1) > FACE)
    head, carried, most = 0.0, np.zeros(len(deficits)), RUNAWAY * course.radius
    for k in np.flatnonzero(deficits).tolist():
        if k > 0 and deficits[k - 1] == 0.0:
            head = 0.0 if stands[k - 1] else share[k - 1] ** 2 * nominal[k - 1]
        if deficits[k] < 0.0:
            head = max(head, nominal[k])
        before = deficits[k - 1] if (deficits[k - 1] < 0.0) == (deficits[k] < 0.0) else 0.0
        head -= 0.5 * (before + deficits[k]) * distances[k] if distances[k] else 0.0
        head = 0.0 if stands[k] and deficits[k] > 0.0 else max(head, 0.0)
        if MIN_SPEED_SHARE**2 * nominal[k] < head <= most:
            carried[k] = head
    rolls = carried > 0.0
    share[rolls] = np.sqrt(carried[rolls] / nominal[rolls])
    course.write("speed_share", share)
    for name in ("friction_share", "torque_share"):
        values = course.values(name)
        course.write(name, np.where(rolls, np.minimum(values, 1.0), values))


def _write_lift_heights(course: _Course) -> None:
    """Write the heights [m] to which wheels have lifted, at waypoints and between.

    Poses at one place, as while a wheel climbs a face, add nothing.
    """
    rate = course.values("lift_rate")
    heights = np.zeros(rate.shape)
    if (rate > 0.0).any():
        share = course.values("speed_share")
        rate = rate / np.where(share > 0.0, share, 1.0)[:, None]
        for k in 1 + np.flatnonzero((rate[1:] > 0.0).any(axis=1)):  # height is 0 at the others
            rise = 0.5 * (rate[k] + np.fmax(rate[k - 1], 0.0)) * course.distances[k - 1]
            heights[k] = np.where(rate[k] > 0.0, heights[k - 1] + rise, 0.0)
    course.write("lift_height", heights)


def climb_costs(poses: np.ndarray, results: Any, crossings: Crossings) -> Floats:
    """Return time [s] and energy [J] (n, 2) that climbs take beside what `add_up` counts.

    A wheel that climbs takes its time while the body hardly moves. The distance that the rover
    goes is the mean of those of its wheel centres; a wheel that goes down more steeply than 45
    degrees falls, which takes no time. Meanwhile the others slip: that energy is their power in
    the time. Both are sums since the first waypoint, over the steps between settled waypoints that
    have poses between them.

    Args:
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints, map frame.
        results: (n,) RESULT of each waypoint.
        crossings: Poses between the waypoints.
    """
    extra = np.zeros((len(poses), 2))
    between = crossings.place > crossings.waypoint - 1  # where the wheels turn, none is between
    settled = crossings.results["status"] == PoseStatus.SETTLED
    for i in np.unique(crossings.waypoint[between]):
        speed = float(np.hypot(results["motion"][i, 0], results["motion"][i, 1]))
        unsettled = (results["status"][i - 1 : i + 1] != PoseStatus.SETTLED).any()
        if i == 0 or unsettled or not speed > 0.0:
            continue
        rows = (crossings.waypoint == i) & between & settled
        inside = select_results(crossings.results, rows)
        share, power, centres = (
            np.concatenate([results[name][i - 1 : i], inside[name], results[name][i : i + 1]])
            for name in ("speed_share", "power", "wheel_centres")
        )
        share = np.where(share > 0.0, share, 1.0)
        moved = np.diff(centres, axis=0)
        level = np.hypot(moved[..., 0], moved[..., 1])
        distances = np.where(moved[..., 2] < -level, level, np.linalg.norm(moved, axis=2))
        durations = distances.mean(axis=1) / (0.5 * speed * (share[1:] + share[:-1]))
        if not durations.sum() > 0.0:
            continue
        energy = 0.5 * (power[1:] + power[:-1]) * durations
        rise = results["q"][i, 0] - results["q"][i - 1, 0]
        level_distance = np.hypot(*(poses[i, :2] - poses[i - 1, :2]))
        counted = np.hypot(level_distance, rise) / (0.5 * speed * (share[0] + share[-1]))
        extra[i, 0] = max(durations.sum() - counted, 0.0)
        extra[i, 1] = max(energy.sum() - 0.5 * (power[0] + power[-1]) * counted, 0.0)
    return np.asarray(np.cumsum(extra, axis=0))


def _find_drift(course: _Course) -> Floats:
    """Return the drift (n, 2) at waypoints: the turn [rad] and the slide [m] that built up.

    They do within a wheelbase before each waypoint, of the body or, where it turns, of its
    outermost wheel. In long turns, the largest drift of a waypoint and of the poses on the way to
    it counts; elsewhere waypoints are enough.
    """
    poses, crossings = course.waypoints, course.crossings
    steps = distances_between(course.swing_radius, poses)
    long_steps = np.append(False, steps > LONGEST_STEP * course.radius)
    turns = crossings.select(long_steps[crossings.waypoint] & ~crossings.climbing)
    course = _Course(course.rover, poses, course.results, turns)
    share, deviation = course.values("speed_share"), course.values("deviation")
    drives = (course.values("status") == PoseStatus.SETTLED) & (share > 0.0)
    rate = np.where(drives[:, None], deviation, 0.0)
    rate /= np.where(drives, share, 1.0)[:, None]
    c, s = np.cos(course.poses[:, 2]), np.sin(course.poses[:, 2])
    x, y = c * rate[:, 0] - s * rate[:, 1], s * rate[:, 0] + c * rate[:, 1]
    rate = np.column_stack([x, y, rate[:, 2]])
    sums = np.zeros(rate.shape)
    sums[1:] = np.cumsum(0.5 * (rate[1:] + rate[:-1]) * course.distances[:, None], axis=0)
    place = np.append(0.0, np.cumsum(course.distances))
    begin = place - course.rover.wheelbase
    built_up = sums - np.column_stack([np.interp(begin, place, one) for one in sums.T])
    n = len(poses)
    owner = np.append(np.arange(n), turns.waypoint)[course.order]
    found = np.column_stack([np.abs(built_up[:, 2]), np.hypot(built_up[:, 0], built_up[:, 1])])
    return np.asarray(np.maximum.reduceat(found, np.searchsorted(owner, np.arange(n))))
