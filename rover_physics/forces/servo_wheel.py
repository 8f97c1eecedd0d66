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
    unused = 1.0 - servo.friction_share
    extra = unused * tread.resistance * facing
    held, gain = 1.0, servo.droop / servo.full_traction
    rim = _rim_of_servo(tread, velocity, gain, servo.command[wheel], extra, servo.slip[wheel])
    _write_shear(tread, velocity, rim, force, rate)
    way = np.copysign(1.0, force[T] + extra)
    limit = way * servo.max_traction
    if way * (force[T] + extra) > servo.max_traction:
        held, gain = 0.0, 1.0
        rim = _rim_of_pull(tread, velocity, limit - extra, rim, way)
        _write_shear(tread, velocity, rim, force, rate)
    servo.slip[wheel] = along - rim
    force[T] += extra
    rate[T, ALONG] += unused * tread.resistance * turning
    rate[T, LOAD] += unused * tread.resistance_rate * facing
    _follow_rim(rate, held, gain)
    if held == 0.0:
        force[T] = limit
        rate[T, :] = 0.0
    force[T] -= tread.resistance * facing
    rate[T, ALONG] -= tread.resistance * turning
    rate[T, LOAD] -= tread.resistance_rate * facing


@kernel
def _rim_of_servo(tread, velocity, droop, command, extra, slip):
    """Return the root r of r + droop (F_x(r) + extra) = command.

    `slip` is what it was in the last search, or NaN.
    """
    loaded = command - droop * (_thrust(tread, velocity, command)[0] + extra)
    low, high = min(command, loaded), max(command, loaded)
    known = velocity[ALONG] - slip
    guess = known if low < known < high else 0.5 * (low + high)
    return _find_root(tread, velocity, 1.0, droop, command - droop * extra, low, high, guess)


@kernel
def _rim_of_pull(tread, velocity, pull, rim, way):
    """Return the root r of F_x(r) = pull; at `rim` F_x is more in the direction `way`, 1 or -1."""
    still = velocity[ALONG] - way * abs(velocity[SPIN])  # F_x is 0, or against `way`
    far = min(still, rim - 1.0) if way > 0.0 else max(still, rim + 1.0)
    if way * (_thrust(tread, velocity, far)[0] - pull) > 0.0:
        far = -way * FASTEST
    low, high = min(far, rim), max(far, rim)
    return _find_root(tread, velocity, 0.0, 1.0, pull, low, high, 0.5 * (low + high))


@kernel
def _find_root(tread, velocity, held, gain, target, low, high, rim):
    """Return the root r of held r + gain F_x(r) = target between two bounds; `rim` is a guess.

    Newton's method, with bisection where it leaves the bounds or does not halve its step.
    """
    change = 2.0 * (high - low)
    for _ in range(MAX_STEPS):
        thrust, rate = _thrust(tread, velocity, rim)
        value, slope = held * rim + gain * thrust - target, held + gain * rate
        if value > 0.0:
            high = min(high, rim)
        else:
            low = max(low, rim)
        new = rim - value / slope if slope > 0.0 else low
        if not low < new < high or abs(new - rim) > 0.5 * change:
            new = 0.5 * (low + high)
        change = abs(new - rim)
        rim = new
        if change <= RIM_PRECISION:
            break
    return rim


@kernel
def _thrust(tread, velocity, rim):
    """Return the thrust F_x of a wheel whose rim moves at `rim`, and its derivative."""
    along, across, spin = velocity
    thrust, rate = 0.0, 0.0
    for sign in (1.0, -1.0):
        ahead = rim - along - sign * spin
        sigma = np.sqrt(ahead * ahead + across * across)
        secant, tangent, by_rim, _ = shear_stiffness(tread, rim, sigma)
        cosine = ahead / sigma if sigma > 0.0 else 1.0
        thrust += secant * ahead
        rate += secant + (tangent - secant) * cosine * cosine + by_rim * ahead
        if spin == 0.0:
            return 2.0 * thrust, 2.0 * rate
    return thrust, rate


@kernel
def _write_shear(tread, velocity, rim, force, rate):
    """Write forces (3,) of the shear on the two points, and derivatives (3, 5) at this rim speed.

    Along its sliding velocity a point has the tangent stiffness, and across it the secant one.
    """
    along, across, spin = velocity
    force[:] = 0.0
    rate[:, :] = 0.0
    for sign in (1.0, -1.0):
        ahead = rim - along - sign * spin
        sigma = np.sqrt(ahead * ahead + across * across)
        secant, tangent, by_rim, by_load = shear_stiffness(tread, rim, sigma)
        cosine, sine = 1.0, 0.0
        if sigma > 0.0:
            cosine, sine = ahead / sigma, across / sigma
        lengthwise = tangent * cosine * cosine + secant * sine * sine
        crosswise = tangent * sine * sine + secant * cosine * cosine
        skew = (tangent - secant) * cosine * sine
        pull, side = secant * ahead, -secant * across
        pull_rate = -lengthwise, skew, -sign * lengthwise, by_load * ahead
        side_rate = skew, -crosswise, sign * skew, -by_load * across
        force[T] += pull
        force[S] += side
        force[D] += sign * pull
        for k in range(RIM):
            rate[T, k] += pull_rate[k]
            rate[S, k] += side_rate[k]
            rate[D, k] += sign * pull_rate[k]
        rate[T, RIM] += lengthwise + by_rim * ahead
        rate[S, RIM] -= skew + by_rim * across
        rate[D, RIM] += sign * (lengthwise + by_rim * ahead)


@kernel
def _follow_rim(rate, held, gain):
    """Add to derivatives (3, 5) what the rim's speed r changes with ALONG, ACROSS, SPIN and LOAD.

    It is the root of held r + gain thrust = const. (implicit function theorem).
    """
    slope = held + gain * rate[T, RIM]
    if slope > 0.0:
        for k in range(RIM):
            change = -gain * rate[T, k] / slope
            for i in range(3):
                rate[i, k] += change * rate[i, RIM]
