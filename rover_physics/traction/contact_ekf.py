# SPDX-License-Identifier: Apache-2.0
"""Contact angles from motion, by an extended Kalman filter (EKF).

The centre of a wheel that rolls without slip moves at its rolling speed along its contact tangent.
The links determine the relative velocities of the centres: a bogie rotates at its own rate, a
rocker carries a bogie and the last wheel, and the body carries both rockers. This gives ten
equations in six contact angles, which the EKF solves as the rover moves. If no link rotates, as on
an even slope, the equations do not determine the angles. The angles then drift towards the slopes
of the lines between neighbouring wheels, as the rover rolls away from where they were found.

Source: Iagnemma and Dubowsky, "Vehicle wheel-ground contact angle estimation: with application to
mobile robot traction control", Advances in Robot Kinematics, 2000.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rover_physics.forces.shares import has_turned_wheels
from rover_physics.names import WHEEL_COUNT, WHEEL_POSITIONS
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import array_of, new_record, record_type
from rover_physics.rover.linkage import PLACEMENT, pack_linkage, place, rocker_sign
from rover_physics.rover.model import Rover

PAIRS = 5
"""Number of wheel pairs whose velocities are compared along body x and z.

Right side: both wheels of the bogie, then the rocker's wheel and the rear one of the bogie. Left
side: the same. Then the wheels of both rockers.
"""
ROCKER_PAIR = 4
"""Index of the last pair, which compares the velocities of the rocker pivots."""
MEMORY_DISTANCE = 1.5
"""Distance over which an angle decays towards the slope between wheels [wheel radii]."""
SLOPE_DEVIATION = 0.35
"""Standard deviation of a contact angle about the slope between its neighbours [rad]."""
SLIP_DEVIATION = 0.1
"""Standard deviation of a wheel's speed from its rolling speed, relative to it."""
GYRO_DEVIATION = 0.005
"""Standard deviation of a turning rate [rad/s]."""
MIN_ROLLING_RATE = 0.02
"""Rolling rate below which the angles stay as they are [rad/s]."""
MAX_ANGLE = 1.7
"""Largest contact angle [rad], slightly more than on a vertical face."""
MAX_RESIDUAL = 3.0
"""Residual [standard deviations] above which an equation counts less, as for a slipping wheel."""


@dataclass(frozen=True, eq=False)
class ContactEstimate:
    """Contact angles with their covariance."""

    angles: np.ndarray
    """(6,) contact angles [rad], positive where a wheel climbs."""
    covariance: np.ndarray
    """(6, 6) their covariance [rad^2]."""
    source: str
    """"map", "motion" or "zero"."""


class Motion(NamedTuple):
    """Measurements of a moving rover, all finite; the fields of MOTION."""

    attitude: np.ndarray
    """(2,) roll and pitch [rad], pitch positive with the nose down."""
    joints: np.ndarray
    """(3,) angles of right rocker, right and left bogie [rad]."""
    joint_rates: np.ndarray
    """(3,) rates of the same [rad/s]."""
    wheel_rates: np.ndarray
    """(6,) rates of the wheel joints [rad/s]."""
    body_rates: np.ndarray
    """(3,) angular velocity, body frame [rad/s]."""
    steering: np.ndarray
    """(6,) steering angles [rad], positive to the left."""


def level_estimate() -> ContactEstimate:
    """Return contact angles of 0 with the deviation of uneven ground."""
    covariance = SLOPE_DEVIATION**2 * np.eye(WHEEL_COUNT)
    return ContactEstimate(np.zeros(WHEEL_COUNT), covariance, "zero")


FILTER = record_type(
    ("angles", float, (WHEEL_COUNT,)),  # contact angles [rad]
    ("covariance", float, (WHEEL_COUNT, WHEEL_COUNT)),  # their covariance [rad^2]
    ("prior", float, (WHEEL_COUNT,)),  # angles before a correction [rad]
    ("pose", float, (3,)),  # of the body in its own frame: zeros
    ("q", float, (6,)),  # zeros, and the angles of right rocker, right and left bogie [rad]
    ("placement", PLACEMENT),  # of the links in the body frame
    ("turning", float, (WHEEL_COUNT,)),  # turning rate of the link that carries each wheel [rad/s]
    ("speeds", float, (WHEEL_COUNT,)),  # rolling speeds [m/s]
    ("slopes", float, (WHEEL_COUNT,)),  # slopes of the ground between wheels, see `_write_slopes`
    ("headings", float, (WHEEL_COUNT, 2)),  # cosine and sine of the steering angles
    ("levels", float, (WHEEL_COUNT,)),  # directions of the horizontal in the wheels' planes [rad]
    ("first", np.int64, (PAIRS,)),  # wheel whose velocity counts positive
    ("second", np.int64, (PAIRS,)),  # wheel whose velocity counts negative
    ("known", float, (PAIRS, 2)),  # difference of their velocities by the links [m/s]
    ("gain", float, (WHEEL_COUNT,)),  # covariance times an equation's coefficients
    ("started", np.bool_),  # whether the angles are known
)
"""State and work space of the filter."""

MOTION = record_type(
    *(
        (name, float, (size,))
        for name, size in zip(Motion._fields, (2, 3, 3, 6, 3, 6), strict=True)
    )
)
"""A `Motion`, for kernels."""


class MotionContactEstimator:
    """The filter; make a new one after the rover was moved by other means than its wheels."""

    def __init__(self, rover: Rover):
        """Prepare for a rover on level ground."""
        self._linkages = array_of(pack_linkage(rover))
        low, high = map(WHEEL_POSITIONS.index, rover.suspension.bogie_wheels)
        own = WHEEL_POSITIONS.index(rover.suspension.rocker_wheel)
        self._filters = array_of(
            new_record(
                FILTER,
                covariance=SLOPE_DEVIATION**2 * np.eye(WHEEL_COUNT),
                first=[high, own, 3 + high, 3 + own, 3 + own],
                second=[low, low, 3 + low, 3 + low, own],
            )
        )
        self._motions = array_of(new_record(MOTION))

    def update(self, motion: Motion, duration: float) -> ContactEstimate:
        """Correct the angles by a measurement, `duration` [s] after the last, and return them."""
        self._motions[0], state = motion, self._filters
        _update(self._linkages, self._motions, duration, state)
        angles, covariance = state["angles"][0].copy(), state["covariance"][0].copy()
        return ContactEstimate(angles, covariance, "motion")


@kernel
def _write_headings(motion, state):
    """Write the headings of the wheels, and the horizontal in the planes of heading and body z."""
    roll, pitch = motion.attitude[0], motion.attitude[1]
    for wheel in range(WHEEL_COUNT):
        angle = motion.steering[wheel]
        c, s = np.cos(angle), np.sin(angle)
        state.headings[wheel, 0], state.headings[wheel, 1] = c, s
        nose_down = np.sin(pitch) * c - np.cos(pitch) * np.sin(roll) * s
        state.levels[wheel] = np.arctan2(nose_down, np.cos(pitch) * np.cos(roll))


@kernel
def _update(linkages, motions, duration, filters):
    """Place the wheels; if the rover moves, let the angles drift and correct them.

    They start from the slopes between neighbouring wheels, which a rover at rest can measure.
    """
    linkage, motion, state = linkages[0], motions[0], filters[0]
    _write_headings(motion, state)
    _place(linkage, motion, state)
    if not state.started:
        for wheel in range(WHEEL_COUNT):
            state.angles[wheel] = state.slopes[wheel]
        state.started = True
    max_speed = 0.0
    for wheel in range(WHEEL_COUNT):
        # The link's rate about the axle.
        turning = state.headings[wheel, 0] * state.turning[wheel]
        turning -= state.headings[wheel, 1] * motion.body_rates[0]
        rate = motion.wheel_rates[wheel] + turning
        state.speeds[wheel] = linkage.radius * rate
        max_speed = max(max_speed, abs(state.speeds[wheel]))
    if max_speed > MIN_ROLLING_RATE * linkage.radius:
        _drift(linkage.radius, duration, state)
        _correct(linkage.length, state)


@kernel
def _place(linkage, motion, state):
    """Write places, turning rates, slopes and the velocity differences given by the links."""
    wheels, known, placement = linkage.wheels, state.known, state.placement
    centres, pivots = placement.centres, placement.bogie_pivots
    for k in range(3):
        state.q[3 + k] = motion.joints[k]
    for wheel in range(WHEEL_COUNT):
        placement.steering[wheel] = motion.steering[wheel]
    place(linkage, state.pose, state.q, placement)
    roll, pitch = motion.attitude[0], motion.attitude[1]
    level = np.arctan2(np.sin(pitch), np.cos(pitch) * np.cos(roll))  # in the body's x-z plane
    for side in range(2):
        rocker_rate = motion.body_rates[1] + rocker_sign(side) * motion.joint_rates[0]
        bogie_rate = rocker_rate + motion.joint_rates[1 + side]
        for wheel in range(3 * side, 3 * side + 3):
            state.turning[wheel] = bogie_rate if linkage.on_bogie[wheel] else rocker_rate
        _write_slopes(roll, level, side, state)
        low, high = state.second[2 * side], state.first[2 * side]
        own = state.first[2 * side + 1]
        for i, sign in ((0, 1.0), (1, -1.0)):
            j = 2 * (1 - i)
            pivot = pivots[side, j]
            known[2 * side, i] = sign * bogie_rate * (centres[high, j] - centres[low, j])
            known[2 * side + 1, i] = sign * (
                bogie_rate * (pivot - centres[low, j]) + rocker_rate * (centres[own, j] - pivot)
            )
            arm = centres[own, j] - linkage.rocker_pivots[side, j]
            known[ROCKER_PAIR, i] = sign * rocker_rate * arm - (
                known[ROCKER_PAIR, i] if side == 1 else 0.0
            )
    width = linkage.rocker_pivots[1, 1] - linkage.rocker_pivots[0, 1]
    known[ROCKER_PAIR, 1] += width * motion.body_rates[0]
    if not has_turned_wheels(placement):
        known[ROCKER_PAIR, 0] -= width * motion.body_rates[2]
        return
    # In a curve the yaw rate is more than noise: the places of the wheels themselves count.
    for pair in range(PAIRS):
        apart = wheels[state.first[pair], 1] - wheels[state.second[pair], 1]
        known[pair, 0] -= apart * motion.body_rates[2]


@kernel
def _write_slopes(roll, level, side, state):
    """Write for each wheel of a side the slope [rad] of the ground in its heading.

    Along the body it is the mean slope of the lines to the neighbouring wheels against the
    horizontal, `level`; across the body it is the roll.
    """
    centres, slopes, headings = state.placement.centres, state.slopes, state.headings
    rear = 3 * side
    back, middle, front = centres[rear], centres[rear + 1], centres[rear + 2]
    behind = np.arctan2(middle[2] - back[2], middle[0] - back[0])
    before = np.arctan2(front[2] - middle[2], front[0] - middle[0])
    slopes[rear], slopes[rear + 1], slopes[rear + 2] = behind, 0.5 * (behind + before), before
    for wheel in range(rear, rear + 3):
        slopes[wheel] = headings[wheel, 0] * (slopes[wheel] - level) + headings[wheel, 1] * roll


@kernel
def _drift(radius, duration, state):
    """Move the angles towards the slopes between wheels, by the distance each wheel has rolled."""
    P = state.covariance
    for i in range(WHEEL_COUNT):
        kept = np.exp(-abs(state.speeds[i]) * duration / (MEMORY_DISTANCE * radius))
        slope = state.slopes[i]
        state.angles[i] = slope + kept * (state.angles[i] - slope)
        for j in range(WHEEL_COUNT):
            P[i, j] *= kept
            P[j, i] *= kept
        P[i, i] += SLOPE_DEVIATION * SLOPE_DEVIATION * (1.0 - kept * kept)


@kernel
def _correct(length, state):
    """Correct the angles by each equation in turn, all linearised at the same angles.

    `length` is the rover's length [m].
    """
    angles, prior, speeds = state.angles, state.prior, state.speeds
    levels, headings = state.levels, state.headings
    for i in range(WHEEL_COUNT):
        prior[i] = angles[i]
    for pair in range(PAIRS):
        a, b = state.first[pair], state.second[pair]
        noise = SLIP_DEVIATION * SLIP_DEVIATION * (speeds[a] * speeds[a] + speeds[b] * speeds[b])
        noise += GYRO_DEVIATION * GYRO_DEVIATION * length * length
        for axis in range(2):
            va, sa = _resolve(speeds[a], prior[a] + levels[a], headings[a, 0], axis)
            vb, sb = _resolve(speeds[b], prior[b] + levels[b], headings[b, 0], axis)
            residual = state.known[pair, axis] - (va - vb)
            residual -= sa * (angles[a] - prior[a]) - sb * (angles[b] - prior[b])
            _take_equation((a, b), (sa, -sb), residual, noise, state)
    for i in range(WHEEL_COUNT):
        angles[i] = min(max(angles[i], -MAX_ANGLE), MAX_ANGLE)


@kernel
def _resolve(speed, direction, ahead, axis):
    """Return the velocity along body x (axis 0) or z (1), and its derivative by the direction.

    `direction` is in the plane of the wheel [rad], `ahead` the cosine of the steering angle.
    """
    along, up = speed * np.cos(direction), speed * np.sin(direction)
    if axis == 0:
        return ahead * along, -ahead * up
    return up, along


@kernel
def _take_equation(wheels, slopes, residual, noise, state):
    """Correct by the equation slopes[0] angle_a + slopes[1] angle_b = residual of two wheels.

    `noise` is the variance of the equation; it is increased if the residual is too large.
    """
    P, gain = state.covariance, state.gain
    a, b = wheels
    for i in range(WHEEL_COUNT):
        gain[i] = P[i, a] * slopes[0] + P[i, b] * slopes[1]
    variance = slopes[0] * gain[a] + slopes[1] * gain[b]
    excess = residual * residual / (MAX_RESIDUAL * MAX_RESIDUAL * (variance + noise))
    variance += noise * max(excess, 1.0)
    for i in range(WHEEL_COUNT):
        state.angles[i] += gain[i] * residual / variance
    for i in range(WHEEL_COUNT):
        for j in range(WHEEL_COUNT):
            P[i, j] -= gain[i] * gain[j] / variance
