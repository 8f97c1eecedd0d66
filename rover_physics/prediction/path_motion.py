# SPDX-License-Identifier: Apache-2.0
"""Motions of the body along a path: speed forward and sideways and yaw rate at each waypoint.

The step from a waypoint to the next is a motion of constant speed and yaw rate, an arc. Waypoints
have the motion of the step that leads to them, the first one that of the first step. Poses are
sampled, and their headings may follow the chords of a curve. So a step counts as an arc without a
sideways part if its direction is within SIDEWAYS plus half its turn of the heading halfway; steps
on one straight line count together. Beyond this it is a sideways motion, a crab, if it hardly
turns.

Poses need not form a path. Long steps, and steps that turn and go sideways at once, are not
driven, and the wheels point ahead. If no more than half the steps can be driven, the poses are
taken one by one, all with their wheels ahead.
"""

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.errors import PoseError
from rover_physics.numerics.kernels import kernel
from rover_physics.prediction.packed_model import PackedModel
from rover_physics.prediction.path_kernels import bulge, turn_between
from rover_physics.rover.steered_drive import fastest_wheel

SIDEWAYS = np.radians(10.0)
"""Angle between heading and direction of travel [rad] up to which there is no sideways motion:
headings of a path may be rounded or noisy."""
MAX_TURN = np.radians(100.0)
"""Largest turn of a step [rad] that is driven as an arc; corners of a grid turn by 90 degrees."""
LONGEST = 0.5
"""Longest arc that is driven as one step [wheelbases]."""
CRAB_TURN, LONGEST_CRAB = np.radians(10.0), 0.25
"""Largest turn [rad] and length [wheelbases] of a step with a sideways part."""
ON_THE_SPOT = 0.02
"""Radius of a curve [distances of the outermost wheel] up to which it is a turn on the spot."""
AT_REST = 1e-6
"""Way of the wheels [wheelbases] up to which the rover rests."""
COLLINEAR = 1e-6
"""Angle between two steps [rad] up to which they are on one straight line."""
STRAIGHT = 1e-6
"""Curvature [rad per wheelbase] up to which a step is straight."""


def motions_of(
    model: PackedModel, poses: np.ndarray, curvature: ArrayLike | None = None
) -> np.ndarray:
    """Return the nominal motions (n, 3) at poses: vx, vy [m/s], yaw rate [rad/s].

    The body origin drives at the nominal speed, slower where a wheel would exceed its largest
    speed. In a turn on the spot the outermost wheel has the nominal speed. A straight path has
    exactly (nominal speed, 0, 0), negative backwards.

    Args:
        model: The model.
        poses: (n, 3) x, y [m] and yaw [rad] of the body origin, map frame.
        curvature: (n,) curvature of the body origin's path at each pose [1/m], positive to the
            left, infinite on the spot; None if the poses are the waypoints of one path.

    Raises:
        PoseError: Curvatures of wrong shape, or not numbers.
    """
    motions = np.empty((len(poses), 3))
    if curvature is None:
        write_path_motions(model.records, poses, motions)
    else:
        write_curvature_motions(model.records, check_curvature(curvature, len(poses)), motions)
    return motions


def check_curvature(curvature: ArrayLike, count: int) -> np.ndarray:
    """Return the curvatures of `count` poses as floats (n,).

    Raises:
        PoseError: Curvatures of wrong shape, or not numbers.
    """
    try:
        bends = np.array(curvature, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise PoseError(f"curvature is not numbers: {error}") from error
    if bends.shape != (count,):
        raise PoseError(f"curvature has shape {bends.shape}; it must be ({count},), as the poses")
    if np.isnan(bends).any():
        row = int(np.flatnonzero(np.isnan(bends))[0])
        raise PoseError(
            f"curvature of pose {row} is nan; it must be a number of 1/m, inf for on the spot"
        )
    return bends


@kernel
def write_curvature_motions(models, curvature, motions):
    """Write the motions of `motions_of` for curvatures (n,)."""
    linkage, settings = models[0].linkage, models[0].settings
    for i in range(curvature.size):
        bend, motion = curvature[i], motions[i]
        motion[0], motion[1], motion[2] = settings.direction, 0.0, 0.0
        if abs(bend) * ON_THE_SPOT * linkage.swing_radius >= 1.0:
            motion[0], motion[2] = 0.0, settings.direction * (1.0 if bend > 0.0 else -1.0)
        elif abs(bend) * linkage.length > STRAIGHT:
            motion[2] = settings.direction * bend
        _take_nominal_speed(linkage, settings, motion)


@kernel
def write_path_motions(models, poses, motions):
    """Write the motions of `motions_of` along a path."""
    linkage, settings = models[0].linkage, models[0].settings
    n, driven, open_steps, end, is_ahead = poses.shape[0], 0, 0, 0, False
    for i in range(1, n):
        if i > end:
            end = _end_of_line(poses, i)
            is_ahead = _is_line_ahead(poses[i - 1], poses[end])
        _find_motion(linkage, poses[i - 1], poses[i], is_ahead, motions[i])
        if _is_open(motions[i]):
            open_steps += 1
        elif motions[i, 0] == motions[i, 0]:
            driven += 1
    first = 0  # first waypoint that a motion leads to
    for i in range(1, n):
        motion = motions[i]
        if motion[0] != motion[0]:
            if first > 0:
                _copy(motions[i - 1], motion)
            continue
        if _is_open(motion) or driven <= open_steps:
            motion[0], motion[1], motion[2] = settings.direction, 0.0, 0.0
        _take_nominal_speed(linkage, settings, motion)
        if first == 0:
            first = i
    if first == 0:
        motions[0, 0], motions[0, 1], motions[0, 2] = settings.direction, 0.0, 0.0
        _take_nominal_speed(linkage, settings, motions[0])
        for i in range(1, n):
            _copy(motions[0], motions[i])
    for i in range(first):
        _copy(motions[first], motions[i])


@kernel
def _is_open(motion):
    """Return whether a step has no motion: none of the wheels leads from its start to its end."""
    return motion[0] == 0.0 and motion[1] == 0.0 and motion[2] == 0.0


@kernel
def _copy(motion, to):
    for k in range(3):
        to[k] = motion[k]


@kernel
def _end_of_line(poses, first):
    """Return the last waypoint of the straight line that leads to waypoint `first` and beyond."""
    dx, dy = poses[first, 0] - poses[first - 1, 0], poses[first, 1] - poses[first - 1, 1]
    length, end = np.hypot(dx, dy), first
    while end + 1 < poses.shape[0]:
        x, y = poses[end + 1, 0] - poses[end, 0], poses[end + 1, 1] - poses[end, 1]
        along, across = dx * x + dy * y, abs(dx * y - dy * x)
        if not along > 0.0 or across > COLLINEAR * length * np.hypot(x, y):
            break
        end += 1
    return end


@kernel
def _is_line_ahead(here, there):
    """Return whether a straight line leads ahead or back, for the mean of its first and last yaw.

    Headings may be interpolated along the line, such as between waypoints that are far apart.
    """
    dx, dy = there[0] - here[0], there[1] - here[1]
    turn = turn_between(here, there)
    c, s = np.cos(here[2] + 0.5 * turn), np.sin(here[2] + 0.5 * turn)
    aside = np.arctan2(abs(dy * c - dx * s), abs(dx * c + dy * s))
    return abs(turn) <= MAX_TURN and aside <= SIDEWAYS + 0.5 * abs(turn)


@kernel
def _find_motion(linkage, here, there, is_ahead, motion):
    """Write the motion of a step, of any speed: NaN at rest, zeros if it is open.

    `is_ahead` tells whether the line that the step is on leads ahead or back as a whole.
    """
    dx, dy = there[0] - here[0], there[1] - here[1]
    turn = turn_between(here, there)
    length, swing = np.hypot(dx, dy), linkage.swing_radius * abs(turn)
    motion[0] = motion[1] = motion[2] = 0.0
    if max(length, swing) <= AT_REST * linkage.length:
        motion[0] = np.nan
        return
    if length <= ON_THE_SPOT * swing:
        motion[2] = 1.0 if turn > 0.0 else -1.0
        return
    if length > LONGEST * linkage.length:
        return
    if linkage.length * abs(turn) <= STRAIGHT * length:
        turn = 0.0
    yaw = here[2] + 0.5 * turn
    c, s = np.cos(yaw), np.sin(yaw)
    ahead, aside = (dx * c + dy * s) / length, (dy * c - dx * s) / length
    rate = turn / (length * bulge(turn))
    if abs(turn) <= MAX_TURN and (is_ahead or _swings_out(linkage, (ahead, aside, rate), turn)):
        motion[0], motion[2] = (1.0 if ahead >= 0.0 else -1.0), rate
    elif abs(turn) <= CRAB_TURN and length <= LONGEST_CRAB * linkage.length:
        motion[0], motion[1], motion[2] = ahead, aside, rate


@kernel
def _swings_out(linkage, motion, turn):
    """Return whether the fixed wheels go ahead in a motion (vx, vy, rate) with a turn [rad].

    The body origin may then swing out, as in a car, whose rear axle follows the curve.
    """
    ahead, aside, rate = motion
    allowed = SIDEWAYS + 0.5 * abs(turn)
    x, fixed = 0.0, 0
    for wheel in range(6):
        if not linkage.steers[wheel]:
            x += linkage.wheels[wheel, 0]
            fixed += 1
    if fixed == 0 or fixed == 6:
        return False
    return np.arctan2(abs(aside + rate * x / fixed), abs(ahead)) <= allowed


@kernel
def _take_nominal_speed(linkage, settings, motion):
    """Scale a motion of any speed to the nominal one, see `motions_of`."""
    speed = np.hypot(motion[0], motion[1])
    if motion[1] == 0.0 and motion[2] == 0.0:
        motion[0] = settings.speed if motion[0] > 0.0 else -settings.speed
        return
    fastest = fastest_wheel(linkage, motion)
    factor = settings.speed / (speed if speed > 0.0 else fastest)
    factor = min(factor, settings.max_wheel_speed * linkage.radius / fastest)
    motion[0], motion[1], motion[2] = factor * motion[0], factor * motion[1], factor * motion[2]
