# SPDX-License-Identifier: Apache-2.0
"""Wheels that roll off an edge: where they fall, how far they drop, and what else that decides.

A wheel falls where its contact is behind it, and neither friction nor the motors balance it there.
All wheels that are beyond their limits must be such wheels: else the rover cannot drive on. Where
the forces balance, the wheel rolls down, held by the others. Down a FACE it falls in any case: it
would have to go down faster than the rover drives. Until it lands no balance is required; the
height of the drop is a result. A wheel that would come down farther than its limit without a WALL
does not fall: it slips on a slope, and friction is what is missing. More friction or torque lets
more wheels balance, so it never refuses a path that passes with less.

A wheel that rolls off an edge needs no equilibrium. So a pose at which one may do so may keep
limits that it breaks; other poses that break a limit fail, whatever the path around them decides.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import view_read_only
from rover_physics.numerics.kernels import allocating_kernel, exact_kernel
from rover_physics.prediction.path_kernels import (
    ANGLE_JUMP,
    FACE,
    HEIGHT_JUMP,
    MIN_SPACING,
    ROUNDING,
    Crossings,
    angle_ahead,
    distance_between,
    force_limit,
)
from rover_physics.results.uses import find_broken
from rover_physics.status import PoseStatus, TorquePolicy

MIN_ANGLE = np.radians(15.0)
"""Least steepness [rad] of a contact behind a wheel from which it falls."""
WALL = np.radians(60.0)
"""Steepness [rad] of such a contact from which the ground is no slope."""
MAX_ROLLING_OFF_EDGE = 2
"""Most wheels that can roll off an edge at once: one axle. If there are more, the rover slides
downhill."""


@dataclass(frozen=True, eq=False)
class Drops:
    """Wheels that roll off edges along a path, and how far they drop."""

    at_waypoints: np.ndarray
    """(n, 6) True for wheels that roll off an edge at a waypoint."""
    between: np.ndarray
    """(m, 6) True for wheels that do so at a pose between waypoints."""
    heights: np.ndarray
    """(n, 6) largest drop of each wheel at a waypoint or since the one before [m]."""
    decided: int
    """Number of waypoints, from the first, whose drops no later pose of the path can change."""
    starts: np.ndarray
    """(n,) True for those of them from which the drops can be found without waypoints before."""


def find_drops(models: np.ndarray, poses: np.ndarray, results: Any, crossings: Crossings) -> Drops:
    """Find where wheels roll off edges along a path, and how far they drop.

    Args:
        models: (1,) MODEL of the rover, or more, of which the first counts.
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints, map frame.
        results: (n,) RESULT of each waypoint.
        crossings: Poses between the waypoints.
    """
    path = view_read_only(poses), view_read_only(results)
    order = crossings.order_among(len(poses))
    return Drops(*_find_drops(models, *path, crossings.views, order))


@allocating_kernel
def _find_drops(models, poses, results, between, order):
    """Return the fields of `Drops`; `order` is that of `order_among`, of `between` Crossings."""
    model, n, m = models[0], len(poses), len(between.place)
    linkage = model.linkage
    steps = np.zeros(n + m)
    height, rolling_off_edge = np.empty((n + m, 6)), np.zeros((n + m, 6), np.bool_)
    angle, last = np.empty((n + m, 6)), poses[0]
    for k in range(n + m):
        i = order[k]
        here = poses[i] if i < n else between.poses[i - n]
        result = results[i] if i < n else between.results[i - n]
        steps[k] = distance_between(last, here, linkage.swing_radius)
        lowest, last = 0.0, here
        for wheel in range(6):
            angle[k, wheel] = angle_ahead(result, wheel)
            height[k, wheel] = result.wheel_centres[wheel, 2]
            lowest = min(lowest, angle[k, wheel])
        if lowest < -MIN_ANGLE:
            some, on_edges = _may_roll_off_edge(model, result)
            for wheel in range(6):
                rolls = some and _rolls_off_edge(model, result, wheel, on_edges)
                rolling_off_edge[k, wheel] = rolls
    first_open = _clear_open_runs(rolling_off_edge)
    _clear_slides(height, angle, model.settings.drop_limit, rolling_off_edge)
    descents, drops = np.zeros((n + m, 6)), np.zeros((n, 6))
    _measure_drops(linkage.radius, height, angle, steps, rolling_off_edge, descents)
    at_waypoints, at_between = np.empty((n, 6), np.bool_), np.empty((m, 6), np.bool_)
    decided, starts = 0, np.zeros(n, np.bool_)
    for k in range(n + m):
        i = order[k]
        if i < n and k < first_open:
            decided += 1
            some = False
            for wheel in range(6):
                some = some or rolling_off_edge[k, wheel] or descents[k, wheel] > 0.0
            starts[i] = not some
        owner = i if i < n else between.waypoint[i - n]
        for wheel in range(6):
            drops[owner, wheel] = max(drops[owner, wheel], descents[k, wheel])
            if i < n:
                at_waypoints[i, wheel] = rolling_off_edge[k, wheel]
            else:
                at_between[i - n, wheel] = rolling_off_edge[k, wheel]
    return at_waypoints, at_between, drops, decided, starts


@exact_kernel
def _is_held(model, result, wheel):
    """Return whether a wheel is on the ground, within the limits of friction and torque."""
    friction = force_limit(model.settings.friction_limit, result.kept_share)
    torque = force_limit(model.settings.torque_limit, result.kept_share)
    return (
        result.wheel_loads[wheel] >= 0.0
        and result.friction_utilisation[wheel] <= friction
        and result.torque_saturation[wheel] <= torque
    )


@exact_kernel
def _may_roll_off_edge(model, result):
    """Return whether some wheels may roll off an edge; the path around the pose decides.

    None does if the rover as a whole goes downhill: it then slides. Also return whether all wheels
    that are beyond their limits are at edges.
    """
    on_edges = True
    for wheel in range(6):
        if angle_ahead(result, wheel) >= -MIN_ANGLE and not _is_held(model, result, wheel):
            on_edges = False
    count, others, least_held = 0, 0.0, np.inf
    for wheel in range(6):
        mu, angle = result.friction[wheel], angle_ahead(result, wheel)
        least_held = min(least_held, np.arctan(mu) if mu == mu else np.arctan(1.0))
        if _rolls_off_edge(model, result, wheel, on_edges):
            count += 1
        elif angle == angle:
            others += angle
    slides = others / max(6 - count, 1) < -0.5 * least_held
    return 0 < count <= MAX_ROLLING_OFF_EDGE and not slides, on_edges


@exact_kernel
def _rolls_off_edge(model, result, wheel, on_edges):
    """Return whether a wheel goes down too steeply to roll, or is at an edge and not held."""
    angle = angle_ahead(result, wheel)
    slips = on_edges and angle < -MIN_ANGLE and not _is_held(model, result, wheel)
    return angle < -FACE or slips


@exact_kernel
def _clear_open_runs(rolling_off_edge):
    """Clear runs in `rolling_off_edge` (k, 6) at an end of the path: no edge, or no landing.

    Return the first row whose drops depend on poses after the last row: the first one of the runs
    that may still end with a landing.
    """
    rows = rolling_off_edge.shape[0]
    first_open = rows
    for wheel in range(6):
        k = 0
        while k < rows and rolling_off_edge[k, wheel]:
            rolling_off_edge[k, wheel] = False
            k += 1
        k = rows
        while k > 0 and rolling_off_edge[k - 1, wheel]:
            k -= 1
            rolling_off_edge[k, wheel] = False
        first_open = min(first_open, k)
    return first_open


@exact_kernel
def _clear_slides(height, angle, limit, rolling_off_edge):
    """Clear runs (k, 6) without a wall that go down by more than `limit` [m]."""
    rows = rolling_off_edge.shape[0]
    for wheel in range(6):
        start = 0
        while start < rows:
            end, walls = start, False
            while end < rows and rolling_off_edge[end, wheel]:
                walls = walls or angle[end, wheel] < -WALL
                end += 1
            if start < end < rows and start > 0 and not walls:
                so_far, most = 0.0, 0.0
                for k in range(start, end + 1):
                    so_far = max(so_far + height[k - 1, wheel] - height[k, wheel], 0.0)
                    most = max(most, so_far)
                if most > limit:
                    rolling_off_edge[start:end, wheel] = False
            start = end + 1


@exact_kernel
def _measure_drops(radius, height, angle, steps, rolling_off_edge, descents):
    """Add up the descent [m] of wheels that roll off edges; a sudden one at one place also counts.

    What a wheel rises meanwhile, such as when the one beside it falls, is subtracted. Where a fall
    begins or ends between two poses, the share of the step in which the wheel falls counts.
    Heights (k, 6) and steps (k,) are in [m], contact angles (k, 6) in [rad].
    """
    for wheel in range(6):
        so_far = 0.0
        for k in range(1, steps.size):
            descent = height[k - 1, wheel] - height[k, wheel]
            if not abs(descent) >= ROUNDING:
                descent = 0.0
            at_one_place = steps[k] <= 2.0 * MIN_SPACING * radius
            sudden = descent > HEIGHT_JUMP * radius and at_one_place
            before, here = rolling_off_edge[k - 1, wheel], rolling_off_edge[k, wheel]
            if not (before or here or sudden):
                so_far = 0.0
                continue
            share = 1.0
            if here != before and not sudden:
                share = _share_of_drop(angle[k - 1, wheel], angle[k, wheel])
            so_far = max(so_far + share * descent, 0.0)
            descents[k, wheel] = so_far
            if before and not here:
                so_far = 0.0


@exact_kernel
def _share_of_drop(angle, other):
    """Return the share of a step in which a wheel falls that falls at one of its ends only.

    It does from where its contact angle passes FACE, and for the whole step if the contact jumps
    there; else for half of it.
    """
    steep, flat = min(angle, other), max(angle, other)
    if flat >= -FACE > steep:
        return 1.0 if flat - steep > ANGLE_JUMP else (steep + FACE) / (steep - flat)
    return 0.5


@exact_kernel
def find_suspects(models, limits, results):
    """Return the first row that may break a limit, and the first that does so in any case; or -1.

    Args:
        models: (1,) MODEL, or more, of which the first counts.
        limits: (k,) LIMIT.
        results: (n,) RESULT; what the path around a row decides is not known yet.
    """
    suspect = -1
    for row in range(results.size):
        may_fail, fails = look_for_failure(models[0], limits, results[row])
        suspect = row if suspect < 0 and may_fail else suspect
        if fails:
            return suspect, row
    return suspect, -1


@exact_kernel
def look_for_failure(model, limits, result):
    """Return whether a RESULT may break a limit, and whether it does so in any case."""
    broken, in_any_case = 0, 0
    if result.status == PoseStatus.SETTLED:
        broken, in_any_case = find_broken(result, limits)
    if broken < 0:
        return False, False
    return True, in_any_case >= 0 or not _path_decides(model, result)


@exact_kernel
def _path_decides(model, result):
    """Return whether the path around a pose may decide that a wheel rolls off an edge there."""
    if model.settings.policy != TorquePolicy.SERVO:
        return _may_roll_off_edge(model, result)[0]
    steepest = 0.0
    for wheel in range(6):
        steepest = min(steepest, angle_ahead(result, wheel))
    return steepest < -MIN_ANGLE


@exact_kernel
def mark_failures(models, limits, results, fails):
    """Write True into fails (n,) for RESULTs (n,) that break a limit in any case."""
    for row in range(results.size):
        fails[row] = look_for_failure(models[0], limits, results[row])[1]
