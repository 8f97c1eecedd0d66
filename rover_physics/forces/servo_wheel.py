# SPDX-License-Identifier: Apache-2.0
"""One wheel on a speed servo: its forces from the velocity of its contact.

The wheel touches the ground along a line, its width, or at a point of it. Two points of its tread
stand for that line, with half the load on each: on firm ground its ends, as a rigid cylinder
stands on its rims. Velocities are over the nominal speed, forces over the rover's weight.

The shear force on a point opposes its sliding velocity; servo_ground has its size. The sum F_x of
both along the wheel is its thrust; what is left of it after the motion resistance R of soil pulls,
T = F_x - R. The servo turns the wheel at r omega = command - c (T + R), where c is the droop over
the traction of full torque; at its torque limit the wheel slows down until the ground asks no
more.
"""

from typing import NamedTuple

import numpy as np

from rover_physics.forces.servo_ground import direction_of_travel, shear_stiffness, tread_under
from rover_physics.numerics.kernels import kernel

MAX_STEPS = 60
"""Largest number of steps of the search for the speed of a rim."""
RIM_PRECISION = 1e-8
"""Last Newton step of this search, over the nominal speed; the error is of its square."""
FASTEST = 20.0
"""Bound of a rim's speed, over the nominal speed, in the search for a torque."""
T, S, D = range(3)
"""Forces of a wheel: traction, lateral force, and the difference of the two points' tractions."""
ALONG, ACROSS, SPIN, LOAD, RIM = range(5)
"""What these forces depend on: velocity of the contact along and across the wheel, half the
difference of the two points' velocities, load, and r omega, which follows from the others."""


class Shear(NamedTuple):
    """Shear force on a point of the tread, and derivatives by ALONG to RIM, each of them alone."""

    pull: float
    """Force along the wheel."""
    side: float
    """Force across it."""
    pull_rate: tuple[float, float, float, float, float]
    side_rate: tuple[float, float, float, float, float]


@kernel
def roll_wheel(servo, wheel, velocity):
    """Write forces, their derivatives and the slip of a wheel into a SERVO_STATE.

    A share of the ground's net force is what a wheel may use.

    Args:
        servo: SERVO_STATE with `pressing`, the load of the wheel, `mu` or `soil`, `command`,
            `droop`, `max_traction` and `creep`.
        wheel: Index of the wheel.
        velocity: (ALONG, ACROSS, SPIN) of the contact as if the wheel did not turn.
    """
    along, load = velocity[ALONG], servo.pressing[wheel]
    force, rate = servo.force[wheel], servo.force_rate[wheel]
    if not load > 0.0:
        force[:] = 0.0
        rate[:, :] = 0.0
        servo.slip[wheel] = along - servo.command[wheel]
        return
    tread = tread_under(servo, wheel, load)
    facing, turning = direction_of_travel(along, servo.creep)
    resistance = tread.resistance * facing
    resistance_rate = tread.resistance * turning, 0.0, 0.0, tread.resistance_rate * facing
    unused = 1.0 - servo.friction_share
    held, gain = 1.0, servo.droop / servo.full_traction
    command = servo.command[wheel] - gain * unused * resistance
    known = along - servo.slip[wheel]
    rim, shear = _rim_of_servo(tread, velocity, gain, command, known)
    thrust = shear + unused * resistance
    if abs(thrust) > servo.max_traction:
        held, gain = 0.0, 1.0
        way = np.copysign(1.0, thrust)
        thrust = way * servo.max_traction
        rim = _rim_of_pull(tread, velocity, thrust - unused * resistance, way, rim, known)
    servo.slip[wheel] = along - rim
    one = _shear_on(tread, velocity, rim, 1.0)
    two = _shear_on(tread, velocity, rim, -1.0)
    force[T] = thrust - resistance
    force[S] = one.side + two.side
    force[D] = one.pull - two.pull
    # r omega is the root of held r + gain thrust = const. (implicit function theorem).
    slope = held + gain * (one.pull_rate[RIM] + two.pull_rate[RIM])
    share = gain / slope if slope > 0.0 else 0.0
    side_by_rim = one.side_rate[RIM] + two.side_rate[RIM]
    for k in range(RIM):
        back = unused * resistance_rate[k]
        rim_rate = -share * (one.pull_rate[k] + two.pull_rate[k] + back)
        first = one.pull_rate[k] + rim_rate * one.pull_rate[RIM]
        second = two.pull_rate[k] + rim_rate * two.pull_rate[RIM]
        rate[T, k] = held * (first + second + back) - resistance_rate[k]
        rate[S, k] = one.side_rate[k] + two.side_rate[k] + rim_rate * side_by_rim
        rate[D, k] = first - second


@kernel
def _rim_of_servo(tread, velocity, droop, command, known):
    """Return the root r of r + droop F_x(r) = command, and F_x(r); `known` is a guess, or NaN.

    Where the rim is as fast as the contact, F_x is 0.
    """
    most, along = 2.0 * droop * tread.strength, velocity[ALONG]
    low = max(min(command, along), command - most)
    high = min(max(command, along), command + most)
    guess = known if low < known < high else 0.5 * (low + high)
    return _find_root(tread, velocity, 1.0, droop, command, low, high, guess)


@kernel
def _rim_of_pull(tread, velocity, pull, way, rim, known):
    """Return the root r of F_x(r) = pull; `known` is a guess, or NaN.

    At `rim` F_x is more in the direction `way`, 1 or -1.
    """
    still = velocity[ALONG] - way * abs(velocity[SPIN])  # F_x is 0, or against `way`
    far = still if way * pull >= 0.0 else -way * FASTEST
    low, high = min(far, rim), max(far, rim)
    guess = known if low < known < high else 0.5 * (low + high)
    return _find_root(tread, velocity, 0.0, 1.0, pull, low, high, guess)[0]


@kernel
def _find_root(tread, velocity, held, gain, target, low, high, rim):
    """Return the root r of held r + gain F_x(r) = target between two bounds, and F_x(r).

    `rim` is a guess. Newton's method, with bisection where it leaves the bounds or does not halve
    its step.
    """
    change = 2.0 * (high - low)
    for _ in range(MAX_STEPS):
        thrust, rate = _thrust(tread, velocity, rim)
        value, slope = held * rim + gain * thrust - target, held + gain * rate
        if value > 0.0:
            high = min(high, rim)
        else:
            low = max(low, rim)
        new = rim - value / slope if slope > 0.0 else np.inf
        if not low <= new <= high or abs(new - rim) > 0.5 * change:
            new = 0.5 * (low + high)
        change = abs(new - rim)
        thrust += rate * (new - rim)
        rim = new
        if change <= RIM_PRECISION:
            break
    return rim, thrust


@kernel
def _thrust(tread, velocity, rim):
    """Return the thrust F_x of a wheel whose rim moves at `rim`, and its derivative."""
    along, across, spin = velocity
    thrust, rate = 0.0, 0.0
    for sign in (1.0, -1.0):
        ahead = rim - along - sign * spin
        squared = ahead * ahead + across * across
        stiffness, by_squared, by_rim, _ = shear_stiffness(tread, rim, squared)
        thrust += stiffness * ahead
        rate += stiffness + (2.0 * by_squared * ahead + by_rim) * ahead
        if spin == 0.0:
            return 2.0 * thrust, 2.0 * rate
    return thrust, rate


@kernel
def _shear_on(tread, velocity, rim, sign):
    """Return the Shear on a point; `sign` is 1 for the one with SPIN in its velocity, or -1."""
    along, across, spin = velocity
    ahead = rim - along - sign * spin
    squared = ahead * ahead + across * across
    stiffness, by_squared, by_rim, by_load = shear_stiffness(tread, rim, squared)
    lengthwise = stiffness + 2.0 * by_squared * ahead * ahead
    crosswise = stiffness + 2.0 * by_squared * across * across
    skew = 2.0 * by_squared * ahead * across
    return Shear(
        stiffness * ahead,
        -stiffness * across,
        (-lengthwise, skew, -sign * lengthwise, by_load * ahead, lengthwise + by_rim * ahead),
        (skew, -crosswise, sign * skew, -by_load * across, -skew - by_rim * across),
    )
