"""Contact angles from motion: a wheel moves along the ground where it touches.

The centre of a wheel that rolls without slip moves at its rolling speed along its contact
tangent, and the links say how the centres move relative to one another: the wheels of a bogie turn
about each other at the bogie's rate, the rocker carries bogie and last wheel, the body both
rockers. That makes ten equations in six contact angles, which an extended Kalman filter solves as
the rover moves. Where all parts only shift, as on an even slope, the equations cannot tell the
angles; then what is left is the slope of the lines between neighbouring wheels, towards which the
angles drift as the rover rolls away from where they were found.

Source: Iagnemma and Dubowsky, "Vehicle wheel-ground contact angle estimation: with application to
mobile robot traction control", Advances in Robot Kinematics, 2000.
"""

from dataclasses import dataclass

import numpy as np

from rover_physics.names import WHEELS
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import array_of, new_record, record_type
from rover_physics.rover.linkage import pack_linkage, rocker_sign
from rover_physics.rover.manipulator import body_mass_and_com
from rover_physics.rover.model import Rover

WHEEL_COUNT = len(WHEELS)
EQUATIONS = 5
"""Pairs of wheels, or of rocker pivots, whose velocities are compared along body x and z."""
MEMORY = 1.5
"""Distance after which an angle is forgotten, in wheel radii."""
SPREAD = 0.35
"""Standard deviation of a contact angle about the slope between its neighbours [rad]."""
SLIP = 0.1
"""Standard deviation of a wheel's speed from its rolling speed, as a share of it."""
GYRO_NOISE = 0.005
"""Standard deviation of a turning rate [rad/s]."""
MIN_SPEED = 0.02
"""Rolling speed below which nothing is learnt, as a share of a wheel radius a second."""
MAX_ANGLE = 1.7
"""Largest angle [rad]: a wheel on a face, and a little more."""
DOUBT = 3.0
"""Standard deviations beyond which an equation counts less: a wheel that slips obeys none."""


@dataclass(frozen=True, eq=False)
class ContactEstimate:
    """Contact angles and how well they are known."""

    angles: np.ndarray
    """(6,) contact angles [rad], positive where a wheel climbs."""
    covariance: np.ndarray
    """(6, 6) their covariance [rad^2]."""
    source: str
    """"map", "motion" or "zero"."""


@dataclass(frozen=True, eq=False)
class Motion:
    """What is measured of a moving rover."""

    roll: float
    """[rad]"""
    pitch: float
    """[rad], positive with the nose down."""
    rocker_angle: float
    """Of the right rocker [rad]."""
    bogie_angles: np.ndarray
    """(2,) right and left [rad]."""
    rocker_rate: float
    """Of the right rocker [rad/s]."""
    bogie_rates: np.ndarray
    """(2,) right and left [rad/s]."""
    wheel_rates: np.ndarray
    """(6,) of the wheel joints [rad/s]."""
    body_rates: np.ndarray
    """(3,) angular velocity, body frame [rad/s]."""


def level_estimate() -> ContactEstimate:
    """Return zero angles, for where nothing is known but that the ground may be uneven."""
    return ContactEstimate(np.zeros(WHEEL_COUNT), SPREAD**2 * np.eye(WHEEL_COUNT), "zero")


FILTER = record_type(
    ("angles", float, (6,)),  # contact angles [rad]
    ("covariance", float, (6, 6)),  # their covariance [rad^2]
    ("prior", float, (6,)),  # angles before a correction [rad]
    ("places", float, (6, 2)),  # wheel centres, body x and z [m]
    ("bogies", float, (2, 2)),  # bogie pivots, body x and z [m]
    ("turning", float, (6,)),  # turning rate of the link that carries each wheel [rad/s]
    ("speeds", float, (6,)),  # rolling speeds [m/s]
    ("slopes", float, (6,)),  # slopes of the lines between neighbouring wheels [rad]
    ("first", np.int64, (EQUATIONS,)),  # wheel whose velocity counts positive
    ("second", np.int64, (EQUATIONS,)),  # wheel whose velocity counts negative
    ("known", float, (EQUATIONS, 2)),  # difference of their velocities by the links [m/s]
    ("row", float, (6,)),  # an equation's coefficients, times the covariance
)
"""State and work space of the filter."""

MOTION = record_type(
    ("attitude", float, (2,)),  # roll and pitch [rad]
    ("joints", float, (3,)),  # right rocker, right and left bogie [rad]
    ("joint_rates", float, (3,)),  # of the same [rad/s]
    ("wheel_rates", float, (6,)),  # [rad/s]
    ("body_rates", float, (3,)),  # [rad/s]
)
"""A `Motion` as the kernels read it."""


class MotionContactEstimator:
    """The filter; start it anew where the rover was moved by other means than its wheels."""

    def __init__(self, rover: Rover):
        """Prepare for a rover on level ground."""
        self._linkages = array_of(pack_linkage(rover, *body_mass_and_com(rover)))
        names = ("rear", "middle", "front")
        low, high = (names.index(name) for name in rover.suspension.bogie_wheels)
        own = names.index(rover.suspension.rocker_wheel)
        self._filters = array_of(
            new_record(
                FILTER,
                covariance=SPREAD**2 * np.eye(WHEEL_COUNT),
                first=[high, own, 3 + high, 3 + own, 3 + own],
                second=[low, low, 3 + low, 3 + low, own],
            )
        )
        self._motions = array_of(new_record(MOTION))
        # Looking up a field of a record takes as long as writing it.
        state, motion = self._filters[0], self._motions[0]
        self._angles, self._covariance = state.angles, state.covariance
        self._attitude, self._joints = motion.attitude, motion.joints
        self._joint_rates = motion.joint_rates
        self._wheel_rates, self._body_rates = motion.wheel_rates, motion.body_rates

    @property
    def estimate(self) -> ContactEstimate:
        """The estimate so far."""
        return ContactEstimate(self._angles.copy(), self._covariance.copy(), "motion")

    def update(self, motion: Motion, duration: float) -> ContactEstimate:
        """Take a measurement into account.

        Args:
            motion: All finite.
            duration: Time since the last measurement [s].
        """
        self._attitude[:] = motion.roll, motion.pitch
        self._joints[0], self._joints[1:] = motion.rocker_angle, motion.bogie_angles
        self._joint_rates[0], self._joint_rates[1:] = motion.rocker_rate, motion.bogie_rates
        self._wheel_rates[:], self._body_rates[:] = motion.wheel_rates, motion.body_rates
        _update(self._linkages, self._motions, duration, self._filters)
        return self.estimate


@kernel
def _update(linkages, motions, duration, filters):
    """Place the wheels, let the angles drift, and correct them if the rover moves."""
    linkage, motion, state = linkages[0], motions[0], filters[0]
    roll, pitch = motion.attitude[0], motion.attitude[1]
    level = np.arctan2(np.sin(pitch), np.cos(pitch) * np.cos(roll))
    _place(linkage, motion, state)
    fastest = 0.0
    for wheel in range(6):
        rate = motion.wheel_rates[wheel] + state.turning[wheel]
        state.speeds[wheel] = linkage.radius * rate
        fastest = max(fastest, abs(state.speeds[wheel]))
    if fastest > MIN_SPEED * linkage.radius:
        _drift(linkage.radius, level, duration, state)
        _correct(linkage.length, level, state)


@kernel
def _place(linkage, motion, state):
    """Write places, turning rates, slopes, and the differences of velocity that links make."""
    wheels, places, known = linkage.wheels, state.places, state.known
    for side in range(2):
        angle = rocker_sign(side) * motion.joints[0]
        rocker_rate = motion.body_rates[1] + rocker_sign(side) * motion.joint_rates[0]
        bogie_rate = rocker_rate + motion.joint_rates[1 + side]
        px, pz = linkage.rocker_pivots[side, 0], linkage.rocker_pivots[side, 2]
        bx, bz = linkage.bogie_pivots[side, 0], linkage.bogie_pivots[side, 2]
        dx, dz = _rotate(angle, bx - px, bz - pz)
        state.bogies[side, 0], state.bogies[side, 1] = px + dx, pz + dz
        for wheel in range(3 * side, 3 * side + 3):
            if linkage.on_bogie[wheel]:
                turn = angle + motion.joints[1 + side]
                dx, dz = _rotate(turn, wheels[wheel, 0] - bx, wheels[wheel, 2] - bz)
                dx, dz = dx + state.bogies[side, 0], dz + state.bogies[side, 1]
                state.turning[wheel] = bogie_rate
            else:
                dx, dz = _rotate(angle, wheels[wheel, 0] - px, wheels[wheel, 2] - pz)
                dx, dz = dx + px, dz + pz
                state.turning[wheel] = rocker_rate
            places[wheel, 0], places[wheel, 1] = dx, dz
        _write_slopes(places, side, state.slopes)
        low, high = state.second[2 * side], state.first[2 * side]
        own = state.first[2 * side + 1]
        for i, sign in ((0, 1.0), (1, -1.0)):
            j, pivot = 1 - i, state.bogies[side, 1 - i]
            known[2 * side, i] = sign * bogie_rate * (places[high, j] - places[low, j])
            known[2 * side + 1, i] = sign * (
                bogie_rate * (pivot - places[low, j]) + rocker_rate * (places[own, j] - pivot)
            )
            arm = places[own, j] - (pz if i == 0 else px)
            known[4, i] = sign * rocker_rate * arm - (known[4, i] if side == 1 else 0.0)
    width = linkage.rocker_pivots[1, 1] - linkage.rocker_pivots[0, 1]
    known[4, 0] -= width * motion.body_rates[2]
    known[4, 1] += width * motion.body_rates[0]


@kernel
def _rotate(angle, x, z):
    """Return the vector (x, z) of body x and z turned about body +y."""
    c, s = np.cos(angle), np.sin(angle)
    return c * x + s * z, c * z - s * x


@kernel
def _write_slopes(places, side, slopes):
    """Write for each wheel of a side the slope of the lines to its neighbours, in their middle."""
    rear = 3 * side
    behind = np.arctan2(
        places[rear + 1, 1] - places[rear, 1], places[rear + 1, 0] - places[rear, 0]
    )
    before = np.arctan2(
        places[rear + 2, 1] - places[rear + 1, 1], places[rear + 2, 0] - places[rear + 1, 0]
    )
    slopes[rear], slopes[rear + 1], slopes[rear + 2] = behind, 0.5 * (behind + before), before


@kernel
def _drift(radius, level, duration, state):
    """Let the angles tend to the slopes between wheels over the way that each has rolled."""
    P = state.covariance
    for i in range(6):
        kept = np.exp(-abs(state.speeds[i]) * duration / (MEMORY * radius))
        slope = state.slopes[i] - level
        state.angles[i] = slope + kept * (state.angles[i] - slope)
        for j in range(6):
            P[i, j] *= kept
            P[j, i] *= kept
        P[i, i] += SPREAD * SPREAD * (1.0 - kept * kept)


@kernel
def _correct(reach, level, state):
    """Correct the angles by each equation in turn, all linearised at the same angles."""
    angles, prior, speeds = state.angles, state.prior, state.speeds
    for i in range(6):
        prior[i] = angles[i]
    for pair in range(EQUATIONS):
        a, b = state.first[pair], state.second[pair]
        noise = SLIP * SLIP * (speeds[a] * speeds[a] + speeds[b] * speeds[b])
        noise += GYRO_NOISE * GYRO_NOISE * reach * reach
        for axis in range(2):
            va, sa = _resolve(speeds[a], prior[a] + level, axis)
            vb, sb = _resolve(speeds[b], prior[b] + level, axis)
            residual = state.known[pair, axis] - (va - vb)
            residual -= sa * (angles[a] - prior[a]) - sb * (angles[b] - prior[b])
            _take_equation(a, sa, b, -sb, residual, noise, state)
    for i in range(6):
        angles[i] = min(max(angles[i], -MAX_ANGLE), MAX_ANGLE)


@kernel
def _resolve(speed, direction, axis):
    """Return the velocity along body x (axis 0) or z, and how it changes with the direction."""
    along, up = speed * np.cos(direction), speed * np.sin(direction)
    if axis == 0:
        return along, -up
    return up, along


@kernel
def _take_equation(a, ha, b, hb, residual, noise, state):
    """Correct by one equation ha angle_a + hb angle_b = residual, doubted if far from it."""
    P, row = state.covariance, state.row
    for i in range(6):
        row[i] = P[i, a] * ha + P[i, b] * hb
    spread = ha * row[a] + hb * row[b]
    doubt = residual * residual / (DOUBT * DOUBT * (spread + noise))
    spread += noise * max(doubt, 1.0)
    for i in range(6):
        state.angles[i] += row[i] * residual / spread
    for i in range(6):
        for j in range(6):
            P[i, j] -= row[i] * row[j] / spread
