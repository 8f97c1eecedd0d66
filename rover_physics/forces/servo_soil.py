# SPDX-License-Identifier: Apache-2.0
"""One wheel on a speed servo on yielding soil: its forces from the velocity of its contact.

The soil's shear stress opposes the sliding velocity of the tread, as in soil (Janosi and
Hanamoto): a tread point slides sigma while the rim moves r omega, so the slip is j = sigma / |r
omega|, at most 1, and the thrust is F(j) in the direction against sliding. What is left after the
motion resistance R pulls: T = F_x - R. As in servo_wheel, two points carry half the load each,
velocities are over the nominal speed, forces over the rover's weight. The servo turns the wheel at
r omega = command - c (T + R), because its torque is that of the thrust.

Slip is defined by the ratio of two velocities. Where both vanish, as in a wheel in the middle of a
turn, a creep takes the place of the rim's speed; it also is the least slip of hard soil.
"""

import numpy as np

from rover_physics.forces.servo_wheel import ACROSS, ALONG, SPIN, D, S, T
from rover_physics.forces.soil import (
    COHESION,
    EXPONENT,
    SHEAR_MODULUS,
    TAN_PHI,
    SoilWheel,
    contact_length,
    find_sinkage,
    mobilised_share,
    motion_resistance,
    shear_strength,
    solve_wheel,
)
from rover_physics.numerics.kernels import kernel

HARDEST = 0.3
"""Least shear displacement modulus, over contact length and creep: 0.7 of the strength is
mobilised at a slip of one creep, as on hard ground."""
MAX_STEPS = 60
"""Largest number of steps of the search for the speed of a rim."""
RIM_PRECISION = 1e-8
"""Last Newton step of this search, over the nominal speed; the error is of its square."""
SHORT = 0.02
"""Shear displacement, over the modulus, below which derivatives are taken from series."""
MOST_SLIP = 0.9
"""Largest slip ratio at the start of a search."""
FASTEST = 20.0
"""Bound of a rim's speed, over the nominal speed, in the search for a torque."""


@kernel
def roll_on_soil(servo, wheel, velocity):
    """Write forces, their derivatives and the slip of a wheel on soil into a SERVO_STATE.

    In the derivatives the load itself, over the rover's weight, takes the place of mu N.

    Args:
        servo: SERVO_STATE with `pressing`, the load of the wheel, `soil`, `command`, `droop` and
            `max_traction`.
        wheel: Index of the wheel.
        velocity: (ALONG, ACROSS, SPIN) of the contact as if the wheel did not turn.
    """
    along, across, spin = velocity
    load = servo.pressing[wheel]
    if not load > 0.0:
        servo.force[wheel, :] = 0.0
        servo.force_rate[wheel, :, :] = 0.0
        servo.slip[wheel] = along - servo.command[wheel]
        return
    strength, resistance = _bear_load(servo, wheel, load)
    facing, turning = direction_of_travel(along, servo.creep)
    push = 1.0 - servo.friction_share, resistance[0] * facing
    curve = strength[0], strength[2], HARDEST * servo.creep
    rim, held = _find_rim_speed(servo, wheel, (curve, push, velocity))
    servo.slip[wheel] = along - rim
    ends = (
        _shear_point(curve, rim, rim - along - spin, across),
        _shear_point(curve, rim, rim - along + spin, across),
    )
    signed = resistance[0] * facing, resistance[0] * turning, resistance[1] * facing
    _write_forces(servo, wheel, (strength, held), signed, ends)
    if held == 0.0:
        limit = np.copysign(servo.max_traction, servo.force[wheel, T] + signed[0])
        servo.force[wheel, T] = limit - signed[0]


@kernel
def _bear_load(servo, wheel, load):
    """Return what a soil gives under a load, with derivatives by the load.

    Returns:
        Strength of a point over the weight, within the friction share, its derivative, contact
        length over shear displacement modulus, its derivative; resistance over the weight, its
        derivative.
    """
    soil, radius, width, weight = servo.soil[wheel], servo.radius, servo.width, servo.weight
    N = load * weight
    sinkage = find_sinkage(soil, radius, width, N)
    resistance = motion_resistance(soil, width, sinkage)
    exponent = 2.0 / (2.0 * soil[EXPONENT] + 1.0)
    resistance_rate = (soil[EXPONENT] + 1.0) * exponent * resistance / N
    length = contact_length(radius, sinkage)
    half = 0.5 * servo.friction_share / weight
    if sinkage >= radius:  # sunk to its axle, a wheel has no thrust
        strength, strength_rate, length_rate = 0.0, 0.0, 0.0
    else:
        strength = half * shear_strength(soil, width * length, N)
        length_rate = radius / np.sqrt(sinkage * (2.0 * radius - sinkage))
        length_rate *= exponent * sinkage / N
        strength_rate = half * (width * length_rate * soil[COHESION] + soil[TAN_PHI])
    modulus = soil[SHEAR_MODULUS]
    return (
        (strength, strength_rate * weight, length / modulus, length_rate * weight / modulus),
        (resistance / weight, resistance_rate),
    )


@kernel
def speed_of_thrust(servo, wheel, load, traction):
    """Return the speed over the ground, for the start of a search, of a wheel that pulls so.

    Load and traction, positive in the commanded direction, are over the rover's weight.
    """
    own = SoilWheel(servo.radius, servo.width, 1.0)
    weight = servo.weight
    solved = solve_wheel(servo.soil[wheel], own, load * weight, traction * weight, 0.0)
    thrust = solved.torque / (servo.radius * weight)
    rim = 1.0 - servo.droop * min(thrust, servo.max_traction) / servo.full_traction
    return rim * (1.0 - min(solved.slip_ratio, MOST_SLIP))


@kernel
def direction_of_travel(along, creep):
    """Return the direction of a wheel's travel, -1 to 1, and its derivative."""
    if abs(along) >= creep:
        return np.copysign(1.0, along), 0.0
    return along / creep, 1.0 / creep


@kernel
def _find_rim_speed(servo, wheel, contact):
    """Return the speed r omega at which servo and soil agree, and 1.0, or 0.0 at full torque."""
    command, c = servo.command[wheel], servo.droop / servo.full_traction
    along, _, spin = contact[2]
    thrust, _ = _thrust(contact, command)
    low, high = min(command, command - c * thrust), max(command, command - c * thrust)
    known = along - servo.slip[wheel]
    guess = known if low < known < high else 0.5 * (low + high)
    rim = _find_root(contact, (1.0, c, command), (low, high, guess))
    thrust, _ = _thrust(contact, rim)
    limit = servo.max_traction
    if abs(thrust) <= limit:
        return rim, 1.0
    turned = along - np.copysign(abs(spin), thrust)  # where the soil gives no thrust
    if thrust > 0.0:
        low, high = min(turned, rim - 1.0), rim
        if _thrust(contact, low)[0] > limit:
            low = -FASTEST
    else:
        low, high = rim, max(turned, rim + 1.0)
        if _thrust(contact, high)[0] < -limit:
            high = FASTEST
    line = 0.0, 1.0, np.copysign(limit, thrust)
    return _find_root(contact, line, (low, high, 0.5 * (low + high))), 0.0


@kernel
def _find_root(contact, line, bracket):
    """Return the root r of a r + b thrust(r) = target in a bracket; `line` is (a, b, target).

    Newton's method, with bisection where it leaves the bracket or does not halve its step.
    """
    a, b, target = line
    low, high, rim = bracket
    change = 2.0 * (high - low)
    for _ in range(MAX_STEPS):
        thrust, rate = _thrust(contact, rim)
        value, slope = a * rim + b * thrust - target, a + b * rate
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
def _thrust(contact, rim):
    """Return the thrust T + R of a wheel whose rim moves at `rim`, and its derivative."""
    (strength, length, least), push, (along, across, spin) = contact
    pull, rate = 0.0, 0.0
    for sign in (1.0, -1.0):
        ahead = rim - along - sign * spin
        sigma = np.sqrt(ahead * ahead + across * across)
        share, by_sigma, by_rim, _ = _stiffness(length, least, rim, sigma)
        pull += share * ahead
        rate += share + ahead * by_rim
        if sigma > 0.0:
            rate += by_sigma * ahead * ahead / sigma
        if spin == 0.0:
            pull, rate = 2.0 * pull, 2.0 * rate
            break
    return strength * pull + push[0] * push[1], strength * rate


@kernel
def _shear_point(curve, rim, ahead, across):
    """Return the shear force on a point of the tread over its strength, with derivatives.

    Args:
        curve: (strength, contact length over shear modulus, least displacement).
        rim: r omega.
        ahead: How much faster than the ground the tread moves back.
        across: Its velocity across.

    Returns:
        Force along and across; the derivatives of the first by `ahead`, `across`, `rim` and
        contact length; those of the second.
    """
    _, length, least = curve
    sigma = np.sqrt(ahead * ahead + across * across)
    share, by_sigma, by_rim, by_length = _stiffness(length, least, rim, sigma)
    to_ahead, to_across = 0.0, 0.0
    if sigma > 0.0:
        to_ahead, to_across = by_sigma * ahead / sigma, by_sigma * across / sigma
    return (
        share * ahead,
        -share * across,
        share + ahead * to_ahead,
        ahead * to_across,
        ahead * by_rim,
        ahead * by_length,
        -across * to_ahead,
        -share - across * to_across,
        -across * by_rim,
        -across * by_length,
    )


@kernel
def _stiffness(length, least, rim, sigma):
    """Return the mobilised share over the sliding velocity sigma, with derivatives.

    They are by sigma, by the rim's speed and by the contact length. Arguments are as for
    `_shear_point`.
    """
    scale = max(abs(rim) / length, least)
    if sigma >= scale * length:  # slip 1: the whole contact has slid its length
        share, rate = _mobilise(length)
        return share / sigma, -share / (sigma * sigma), 0.0, rate / sigma
    x = sigma / scale
    share, rate = _mobilise(x)
    secant = share / x if x > 1e-6 else 0.5
    by_sigma = (rate - secant) / x if x >= SHORT else -1.0 / 6.0 + x * (1.0 / 12.0 - x / 40.0)
    by_sigma /= scale * scale
    if scale > least:
        by_rim = -np.copysign(rate, rim) / (scale * scale * length)
        return secant / scale, by_sigma, by_rim, rate / (scale * length)
    return secant / scale, by_sigma, 0.0, 0.0


@kernel
def _mobilise(x):
    """Return `mobilised_share` and its derivative."""
    if x < SHORT:
        return mobilised_share(x), 0.5 - x * (1.0 / 3.0 - x * (1.0 / 8.0 - x / 30.0))
    lost = np.expm1(-x)
    return 1.0 + lost / x, -(lost + x * (1.0 + lost)) / (x * x)


@kernel
def _write_forces(servo, wheel, state, signed, ends):
    """Write the forces, and their derivatives.

    A share of the soil's net force is what a wheel may use. The derivatives follow from the
    implicit function theorem for the rim's speed.

    Args:
        servo: SERVO_STATE.
        wheel: Index of the wheel.
        state: Strength of `_bear_load`, and 1.0 while the servo is not saturated, else 0.0.
        signed: Resistance against the travel, and its derivatives by travel and load.
        ends: `_shear_point` of both points.
    """
    (half, half_rate, _, length_rate), held = state
    one, two = ends
    force, rate, share = servo.force[wheel], servo.force_rate[wheel], servo.friction_share
    force[T] = half * (one[0] + two[0]) - share * signed[0]
    force[S] = half * (one[1] + two[1])
    force[D] = half * (one[0] - two[0])
    droop = servo.droop / servo.full_traction
    back = 1.0 - share
    by_rim = half * (one[2] + one[4] + two[2] + two[4])
    bend = 1.0 + droop * by_rim if held == 1.0 else by_rim
    side_rim = half * (one[6] + one[8] + two[6] + two[8])
    spin_rim = half * (one[2] + one[4] - two[2] - two[4])
    for k in range(4):
        if k == ALONG:
            thrust = -half * (one[2] + two[2]) + back * signed[1]
            side, turn = -half * (one[6] + two[6]), -half * (one[2] - two[2])
            resistance = signed[1]
        elif k == ACROSS:
            thrust, side = half * (one[3] + two[3]), half * (one[7] + two[7])
            turn, resistance = half * (one[3] - two[3]), 0.0
        elif k == SPIN:
            thrust, side = -half * (one[2] - two[2]), -half * (one[6] - two[6])
            turn, resistance = -half * (one[2] + two[2]), 0.0
        else:
            longer = half * length_rate
            thrust = half_rate * (one[0] + two[0]) + longer * (one[5] + two[5])
            thrust += back * signed[2]
            side = half_rate * (one[1] + two[1]) + longer * (one[9] + two[9])
            turn = half_rate * (one[0] - two[0]) + longer * (one[5] - two[5])
            resistance = signed[2]
        rim = 0.0
        if bend > 0.0:
            rim = -(droop * thrust if held == 1.0 else thrust) / bend
        rate[T, k] = thrust + by_rim * rim - resistance
        rate[S, k] = side + side_rim * rim
        rate[D, k] = turn + spin_rim * rim
        if held == 0.0:
            rate[T, k] = -resistance
