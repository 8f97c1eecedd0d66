# SPDX-License-Identifier: Apache-2.0
"""Residual and Jacobian of the nine equations of policy "servo", by loads and motion."""

import numpy as np

from rover_physics.forces.servo_motion import MOTIONS, SCRUB, UNKNOWNS, WEIGHTS, level_work
from rover_physics.forces.servo_wheel import ACROSS, ALONG, LOAD, SPIN, D, S, T, roll_wheel
from rover_physics.numerics.kernels import kernel

STRETCH = 0.05
"""Speed share by which a force of the weight stretches the tow."""


@kernel
def write_residual(servo, z):
    """Write residual and Jacobian of the nine equations at z; return the residual's length.

    Rows 0 to 5 are the loads less those that balance the forces; rows 6 to 8 the base forces that
    are missing. A negative load is no load, but the speed at which the wheel lifts.
    """
    X, J, residual = servo.X, servo.J, servo.residual
    for i in range(UNKNOWNS):
        residual[i, 0] = -X[i, WEIGHTS]
        for k in range(UNKNOWNS):
            J[i, k] = 0.0
    split_loads(servo, z)
    for wheel in range(6):
        residual[wheel, 0] += servo.load[wheel]
        J[wheel, wheel] = servo.load_rate[wheel]
    for wheel in range(6):
        velocity = contact_velocity(servo, wheel, z)
        if not servo.holds_loads:
            servo.pressing[wheel] = servo.load[wheel]
        roll_wheel(servo, wheel, velocity)
        if servo.pressing[wheel] > 0.0:
            _add_wheel(servo, wheel)
    if servo.towed > 0.0:
        _add_tow(servo, z)
    total = 0.0
    for i in range(UNKNOWNS):
        total += residual[i, 0] * residual[i, 0]
    return np.sqrt(total)


@kernel
def _add_tow(servo, z):
    """Add the tow to the base forces: its power in the whole commanded motion is its force."""
    made, asked = motion_made(servo, z)
    for k in range(MOTIONS):
        share = servo.nominal[k] / (STRETCH * asked)
        servo.residual[6 + k, 0] += share * (servo.towed - made / asked)
        for j in range(MOTIONS):
            for i in range(MOTIONS):
                work = level_work(servo.base, i, j) * servo.nominal[i]
                servo.J[6 + k, 6 + j] -= share * work / asked


@kernel
def split_loads(servo, z):
    """Write loads and speeds of lifting: load - rise = z, load rise = softness^2."""
    soft = servo.softness
    servo.lifted = soft > 0.0
    for i in range(6):
        load, rate = max(z[i], 0.0), 1.0 if z[i] > 0.0 else 0.0
        if soft > 0.0:
            root = np.sqrt(z[i] * z[i] + 4.0 * soft * soft)
            load, rate = 0.5 * (z[i] + root), 0.5 * (1.0 + z[i] / root)
        servo.load[i], servo.load_rate[i], servo.rise[i] = load, rate, load - z[i]
        if not z[i] > 0.0:
            servo.lifted = True


@kernel
def contact_velocity(servo, wheel, z):
    """Return velocity along, across and spin of a contact in the motion of z."""
    velocity = servo.velocity[wheel]
    along, across, spin = 0.0, 0.0, 0.0
    for k in range(MOTIONS):
        along += velocity[0, k] * z[6 + k]
        across += velocity[1, k] * z[6 + k]
        spin += velocity[2, k] * z[6 + k]
    for i in range(6 if servo.lifted else 0):
        rise = servo.rise[i]  # row i of X is the motion that lifts wheel i alone
        along += rise * servo.X[i, wheel]
        across += rise * servo.X[i, 6 + wheel]
        spin += rise * servo.X[i, SCRUB + wheel]
    return along, across, spin


@kernel
def _add_wheel(servo, wheel):
    """Add the forces of a wheel to the residual, and their derivatives to the Jacobian."""
    X, J, force, rate = servo.X, servo.J, servo.force[wheel], servo.force_rate[wheel]
    velocity = servo.velocity[wheel]
    load_rate = 0.0 if servo.holds_loads else servo.load_rate[wheel]
    for i in range(UNKNOWNS):
        x_T, x_S, x_D = X[i, wheel], X[i, 6 + wheel], X[i, SCRUB + wheel]
        servo.residual[i, 0] += x_T * force[T] + x_S * force[S] + x_D * force[D]
        J[i, wheel] += load_rate * (
            x_T * rate[T, LOAD] + x_S * rate[S, LOAD] + x_D * rate[D, LOAD]
        )
        along = x_T * rate[T, ALONG] + x_S * rate[S, ALONG] + x_D * rate[D, ALONG]
        across = x_T * rate[T, ACROSS] + x_S * rate[S, ACROSS] + x_D * rate[D, ACROSS]
        spin = x_T * rate[T, SPIN] + x_S * rate[S, SPIN] + x_D * rate[D, SPIN]
        for k in range(MOTIONS):
            J[i, 6 + k] += along * velocity[0, k] + across * velocity[1, k] + spin * velocity[2, k]
        for k in range(6 if servo.lifted else 0):
            moved = along * X[k, wheel] + across * X[k, 6 + wheel] + spin * X[k, SCRUB + wheel]
            J[i, k] += (servo.load_rate[k] - 1.0) * moved


@kernel
def motion_made(servo, z):
    """Return what the level work with the commanded motion is of the motion in z and of itself."""
    made, asked = 0.0, 0.0
    for k in range(MOTIONS):
        for j in range(MOTIONS):
            work = level_work(servo.base, k, j) * servo.nominal[k]
            made += work * z[6 + j]
            asked += work * servo.nominal[j]
    return made, asked
