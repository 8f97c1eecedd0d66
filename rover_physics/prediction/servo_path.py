# SPDX-License-Identifier: Apache-2.0
"""Effects of speed servos that only the whole path shows: lifts, wedged wheels, and drift.

A wheel may lift while the others drive the rover on, and touch down again. How high it gets is the
sum of its speeds of lifting.

Where forces are missing for a few millimetres, the rover's momentum carries it on.

A wheel that falls into a slot as narrow as itself is wedged between its faces. The forces on it
are not determined there: friction at both faces may lock it, whatever the motors do.

The servos turn the wheels as the path asks, whatever the rover does. A controller that follows the
path corrects slow errors. What builds up within the length of the rover, the drift, is too fast
for it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rover_physics.limits.table import MIN_SPEED_SHARE, RUNAWAY
from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.path_kernels import FACE, Crossings, Wheels
from rover_physics.status import PoseStatus, Stall

WEDGED = np.radians(140.0)
"""Angle [rad] between contacts in front of and behind a wheel from which it is wedged. The line
between them is then within 20 degrees of both normals, less than the friction angle of any ground
that a rover drives on, so friction at the two faces can hold any force."""


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
        target["stalls"][row if row < n else row - n] = Stall.WEDGED


def carry_by_momentum(
    wheels: Wheels, gravity: float, poses: np.ndarray, results: Any, crossings: Crossings
) -> None:
    """Let the rover roll on where its kinetic energy covers what is missing to drive or to brake.

    Where no speed balances, speed share and shares of friction and torque become those with which
    it rolls, in both RESULTs. A rover that stands, as while its wheels turn or climb, or runs
    against a face, has no momentum.

    Args:
        wheels: Sizes of wheels and rover.
        gravity: Gravity [m/s^2].
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints, map frame.
        results: (n,) RESULT of each waypoint.
        crossings: Poses between the waypoints.
    """
    n = len(poses)
    deficits = np.concatenate([results["deficit"], crossings.results["deficit"]])
    if not (deficits != 0.0).any():
        return
    order = _in_order(n, crossings.place)
    deficits, share, motion, angles, speeds = (
        np.concatenate([results[name], crossings.results[name]])[order]
        for name in ("deficit", "speed_share", "motion", "contact_angle", "wheel_speed")
    )
    nominal = (motion[:, 0] ** 2 + motion[:, 1] ** 2) / (2.0 * gravity)
    distances = distances_between(wheels, np.concatenate([poses, crossings.poses])[order])
    distances = np.append(0.0, distances)
    stands = (distances == 0.0) | ((angles * np.sign(speeds)).max(axis=1) > FACE)
    head = 0.0
    for k, row in enumerate(order):
        if deficits[k] == 0.0:
            head = 0.0 if stands[k] else share[k] ** 2 * nominal[k]
            continue
        if deficits[k] < 0.0:
            head = max(head, nominal[k])
        before = deficits[k - 1] if (deficits[k - 1] < 0.0) == (deficits[k] < 0.0) else 0.0
        head -= 0.5 * (before + deficits[k]) * distances[k] if distances[k] else 0.0
        head = 0.0 if stands[k] and deficits[k] > 0.0 else max(head, 0.0)
        if MIN_SPEED_SHARE**2 * nominal[k] < head <= RUNAWAY:
            one = results[row : row + 1] if row < n else crossings.results[row - n : row - n + 1]
            one["speed_share"] = np.sqrt(head / nominal[k])
            for name in ("friction_share", "torque_share"):
                one[name] = np.minimum(one[name], 1.0)


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
        distances = distances_between(wheels, np.concatenate([poses, crossings.poses])[order])
        for k in 1 + np.flatnonzero((rate[1:] > 0.0).any(axis=1)):  # height is 0 at the others
            lifted = rate[k] > 0.0
            rise = 0.5 * (rate[k] + np.fmax(rate[k - 1], 0.0)) * distances[k - 1]
            heights[order[k]] = np.where(lifted, heights[order[k - 1]] + rise, 0.0)
    return heights[:n], heights[n:]


def climb_costs(poses: np.ndarray, results: Any, crossings: Crossings) -> Floats:
    """Return time [s] and energy [J] (n, 2) by which climbs exceed what `add_up` counts.

    A wheel that climbs takes its time while the body hardly moves. Both are sums since the first
    waypoint.

    Args:
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints, map frame.
        results: (n,) RESULT of each waypoint.
        crossings: Poses between the waypoints.
    """
    extra = np.zeros((len(poses), 2))
    for step in _steps_with_crossings(results, crossings):
        i, power, share = step.waypoint, step.values("power"), step.speed_shares()
        energy = 0.5 * (power[1:] + power[:-1]) * step.durations
        rise = results["q"][i, 0] - results["q"][i - 1, 0]
        level_distance = np.hypot(*(poses[i, :2] - poses[i - 1, :2]))
        counted = np.hypot(level_distance, rise) / (0.5 * step.speed * (share[0] + share[-1]))
        extra[i] = max(step.durations.sum() - counted, 0.0), 0.0
        extra[i, 1] = max(energy.sum() - 0.5 * (power[0] + power[-1]) * counted, 0.0)
    return np.asarray(np.cumsum(extra, axis=0))


@dataclass(frozen=True, eq=False)
class _Step:
    """The step to a waypoint over poses between it and the one before."""

    waypoint: int
    """Index of the waypoint at its end."""
    rows: np.ndarray
    """Rows of the crossings between these waypoints."""
    speed: float
    """Nominal speed of the body [m/s]."""
    results: Any
    crossings: Crossings

    def values(self, name: str) -> Floats:
        """Return a field of RESULT at both ends and at the poses between them."""
        ends = self.results[name][self.waypoint - 1 : self.waypoint + 1]
        return np.concatenate([ends[:1], self.crossings.results[name][self.rows], ends[1:]])

    def speed_shares(self) -> Floats:
        """Return the shares of the speed, 1 where the rover does not drive."""
        share = self.values("speed_share")
        return np.where(share > 0.0, share, 1.0)

    @cached_property
    def durations(self) -> Floats:
        """Time [s] from each of these poses to the next.

        The distance that the rover goes is the mean of those of its wheel centres. A wheel that
        goes down more steeply than 45 degrees falls, which takes no time.
        """
        moved, share = np.diff(self.values("wheel_centres"), axis=0), self.speed_shares()
        level = np.hypot(moved[..., 0], moved[..., 1])
        distances = np.where(moved[..., 2] < -level, level, np.linalg.norm(moved, axis=2))
        return np.asarray(distances.mean(axis=1) / (0.5 * self.speed * (share[1:] + share[:-1])))


def _steps_with_crossings(results: Any, crossings: Crossings) -> Iterator[_Step]:
    """Yield the steps between settled waypoints that have poses between them.

    Poses at a waypoint itself, where the wheels turn, are not between.
    """
    between = crossings.place > crossings.waypoint - 1
    for i in np.unique(crossings.waypoint[between]):
        if i == 0 or (results["status"][i - 1 : i + 1] != PoseStatus.SETTLED).any():
            continue
        rows = np.flatnonzero((crossings.waypoint == i) & between)
        rows = rows[crossings.results["status"][rows] == PoseStatus.SETTLED]
        speed = float(np.hypot(results["motion"][i, 0], results["motion"][i, 1]))
        if speed > 0.0:
            step = _Step(int(i), rows, speed, results, crossings)
            if step.durations.sum() > 0.0:
                yield step


def find_drift(
    wheels: Wheels, window: float, poses: np.ndarray, results: Any, crossings: Crossings
) -> Floats:
    """Return the drift (n, 2) at waypoints: the turn [rad] and the slide [m] that built up.

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
    if not wheels.on_servos:
        return np.zeros((n, 2))
    long_steps = np.append(False, distances_between(wheels, poses) > wheels.radius)
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
    distances = distances_between(wheels, at)
    sums = np.zeros(rate.shape)
    sums[1:] = np.cumsum(0.5 * (rate[1:] + rate[:-1]) * distances[:, None], axis=0)
    place = np.append(0.0, np.cumsum(distances))
    built_up = sums - sums[np.searchsorted(place, place - window)]
    owner = np.append(np.arange(n), turns.waypoint)[order]
    found = np.column_stack([np.abs(built_up[:, 2]), np.hypot(built_up[:, 0], built_up[:, 1])])
    return np.asarray(np.maximum.reduceat(found, np.searchsorted(owner, np.arange(n))))


def _in_order(n: int, place: np.ndarray) -> np.ndarray:
    """Return n waypoints and the poses at places between them, numbered one after the other."""
    places = np.append(np.arange(n), place)
    return np.lexsort((np.arange(len(places)) >= n, places))


def distances_between(wheels: Wheels, poses: np.ndarray) -> Floats:
    """Return the distances (n - 1,) between poses [m]: of the body or, if it turns, of a wheel."""
    steps = np.diff(poses, axis=0)
    swing = wheels.swing_radius * np.abs((steps[:, 2] + np.pi) % (2.0 * np.pi) - np.pi)
    return np.maximum(np.hypot(steps[:, 0], steps[:, 1]), swing)
