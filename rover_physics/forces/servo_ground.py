# SPDX-License-Identifier: Apache-2.0
"""What firm ground and yielding soil give the tread of a wheel on a speed servo, see servo_wheel.

On firm ground, the shear force on a point of the tread that slides with a velocity sigma is that
of Coulomb friction with a creep eps, mu N sigma / sqrt(sigma^2 + eps^2). On soil it is that of
Janosi and Hanamoto, as in soil: a point slides sigma while the rim moves r omega, so the slip is
j = sigma / |r omega|, at most 1, and the force is F(j). docs/soil.md has the formulas.

Slip is defined by the ratio of two velocities. Where both vanish, as in a wheel in the middle of a
turn, a creep takes the place of the rim's speed; it also is the least slip of hard soil.

Velocities are over the nominal speed, forces and loads over the rover's weight.
"""

from typing import NamedTuple

import numpy as np

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
SHORT = 0.02
"""Shear displacement, over the modulus, below which derivatives are taken from series."""
MOST_SLIP = 0.9
"""Largest slip ratio at the start of a search."""


class Tread(NamedTuple):
    """What the ground gives a wheel under its load; each rate is a derivative by the load."""

    yields: int
    """1 on yielding soil, 0 on firm ground."""
    creep: float
    """Sliding velocity by which that of a point counts: eps; on soil the least one."""
    strength: float
    """Largest shear force on one of the two points, within the friction share."""
    strength_rate: float
    length: float
    """Contact length over shear displacement modulus; 0 on firm ground, as all that follows."""
    length_rate: float
    resistance: float
    """Motion resistance R."""
    resistance_rate: float


@kernel
def tread_under(servo, wheel, load):
    """Return the Tread of a wheel of a SERVO_STATE under a load above 0."""
    yields = servo.yields[wheel]
    if not yields:
        strength = 0.5 * servo.mu[wheel]
        return Tread(yields, servo.creep, strength * load, strength, 0.0, 0.0, 0.0, 0.0)
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
    return Tread(
        yields,
        HARDEST * servo.creep,
        strength,
        strength_rate * weight,
        length / modulus,
        length_rate * weight / modulus,
        resistance / weight,
        resistance_rate,
    )


@kernel
def shear_stiffness(tread, rim, squared):
    """Return the shear force on a point over its sliding velocity sigma, with derivatives.

    They are by sigma^2, by the rim's speed and by the load.

    Args:
        tread: Tread.
        rim: Velocity of the rim, r omega.
        squared: sigma^2.
    """
    if not tread.yields:
        size = squared + tread.creep * tread.creep
        root = np.sqrt(size)
        stiffness = tread.strength / root
        return stiffness, -0.5 * stiffness / size, 0.0, tread.strength_rate / root
    sigma = np.sqrt(squared)
    slow = abs(rim) <= tread.creep * tread.length
    scale = tread.creep if slow else abs(rim) / tread.length
    if sigma >= scale * tread.length:  # slip 1: the whole contact has slid its length
        share, rate = _mobilise(tread.length)
        secant, tangent, by_rim, by_length = share / sigma, 0.0, 0.0, rate / sigma
    else:
        x = sigma / scale
        share, rate = _mobilise(x)
        secant = share / sigma if x > 1e-6 else 0.5 / scale
        tangent = rate / scale
        by_rim = 0.0 if slow else -tangent / rim  # the force depends on sigma / rim alone
        by_length = 0.0 if slow else tangent / tread.length
    by_squared = 0.5 * (tangent - secant) / squared if squared > 0.0 else 0.0
    by_load = tread.strength_rate * secant + tread.strength * tread.length_rate * by_length
    strength = tread.strength
    return strength * secant, strength * by_squared, strength * by_rim, by_load


@kernel
def _mobilise(x):
    """Return `mobilised_share` and its derivative."""
    if x < SHORT:
        return mobilised_share(x), 0.5 - x * (1.0 / 3.0 - x * (1.0 / 8.0 - x / 30.0))
    lost = np.expm1(-x)
    return 1.0 + lost / x, -(lost + x * (1.0 + lost)) / (x * x)


@kernel
def direction_of_travel(along, creep):
    """Return the direction of a wheel's travel, -1 to 1, and its derivative."""
    if abs(along) >= creep:
        return np.copysign(1.0, along), 0.0
    return along / creep, 1.0 / creep


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
