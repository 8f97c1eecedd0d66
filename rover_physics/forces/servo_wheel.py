# SPDX-License-Identifier: Apache-2.0
"""One wheel on a speed servo: its friction force from the velocity of its contact.

The wheel touches the ground along a line, its width, or at a point of it. A rigid cylinder on
rigid ground stands on the ends of that line, its rims; half the load is on each. Velocities are
over the nominal speed, forces over the rover's weight.

Friction opposes the sliding velocity s of a point on the tread: F = -mu N s / sqrt(s^2 + eps^2),
Coulomb friction with a creep eps. The servo turns the wheel at r omega = command - c T, where c is
the droop over the traction of full torque; at its torque limit the wheel slows down until
friction asks no more.
"""

import numpy as np

from rover_physics.numerics.kernels import kernel

MAX_STEPS = 40
"""Largest number of steps of the search for the slip of a wheel."""
SLIP_PRECISION = 1e-9
"""Last Newton step of a slip velocity, over the creep; the error is of the order of its square."""
T, S, D = range(3)
"""Forces of a wheel: traction, lateral force, and the difference of the two points' tractions."""
ALONG, ACROSS, SPIN, GRIP = range(4)
"""Inputs of these forces: velocity of the contact along and across the wheel, half the difference
of the two points' velocities, and mu N."""


@kernel
def roll_wheel(servo, wheel, grip, velocity):
    """Write forces, their derivatives and the slip of a wheel into a SERVO_STATE.

    Args:
        servo: SERVO_STATE with `command`, `droop`, `max_traction` and `creep`.
        wheel: Index of the wheel.
        grip: mu N; a wheel with none has no forces.
        velocity: (ALONG, ACROSS, SPIN) of the contact as if the wheel did not turn.
    """
    along, across, spin = velocity
    force, rate = servo.force[wheel], servo.force_rate[wheel]
    drawn = along - servo.command[wheel]
    if not grip > 0.0:
        force[:] = 0.0
        rate[:, :] = 0.0
        servo.slip[wheel] = drawn
        return
    wide = np.sqrt(across * across + servo.creep * servo.creep)
    half, c = 0.5 * grip, servo.droop / servo.full_traction
    slip = _slip_of_servo((drawn, servo.slip[wheel]), c * half, wide, spin)
    pull = half * (_share(slip + spin, wide) + _share(slip - spin, wide))
    held, gain = 1.0, c * half
    if abs(pull) > servo.max_traction:
        held, gain = 0.0, half
        limit = np.copysign(servo.max_traction, pull)
        slip = _slip_of_pull(limit / half, wide, spin)
    servo.slip[wheel] = slip
    _write_forces(servo, wheel, (half, gain, held), (slip, wide, across, spin))
    if held == 0.0:
        force[T] = -np.copysign(servo.max_traction, pull)


@kernel
def _share(slip, wide):
    return slip / np.sqrt(slip * slip + wide * wide)


@kernel
def _slip_of_servo(ends, gain, wide, spin):
    """Return the root s of s + gain (f(s + spin) + f(s - spin)) = drawn, f = `_share`.

    The left side rises with s. `ends` is (drawn, a first guess or NaN).
    """
    drawn, known = ends
    low, high = drawn - 2.0 * gain, drawn + 2.0 * gain
    if drawn >= 0.0:
        high = drawn
        low = max(low, 0.0)
    else:
        low = drawn
        high = min(high, 0.0)
    guess = drawn / (1.0 + 2.0 * gain / np.sqrt(drawn * drawn + wide * wide))
    if low < known < high:
        guess = known
    return _find_root((gain, 1.0, drawn), (low, high, guess), wide, spin)


@kernel
def _slip_of_pull(pull, wide, spin):
    """Return the root s of f(s + spin) + f(s - spin) = pull, -2 < pull < 2, f = `_share`."""
    share = 0.5 * pull
    middle = wide * share / np.sqrt(1.0 - share * share)
    away = abs(spin)
    return _find_root((1.0, 0.0, pull), (middle - away, middle + away, middle), wide, spin)


@kernel
def _find_root(equation, bracket, wide, spin):
    """Return the root s of line * s + gain (f(s + spin) + f(s - spin)) = target in a bracket.

    Newton's method, with bisection where it leaves the bracket or does not halve its step.
    """
    gain, line, target = equation
    low, high, s = bracket
    change = 2.0 * (high - low)
    for _ in range(MAX_STEPS):
        a, b = s + spin, s - spin
        ha, hb = np.sqrt(a * a + wide * wide), np.sqrt(b * b + wide * wide)
        value = line * s + gain * (a / ha + b / hb) - target
        slope = line + gain * wide * wide * (1.0 / (ha * ha * ha) + 1.0 / (hb * hb * hb))
        if value > 0.0:
            high = min(high, s)
        else:
            low = max(low, s)
        new = s - value / slope
        if not low < new < high or abs(new - s) > 0.5 * change:
            new = 0.5 * (low + high)
        change = abs(new - s)
        s = new
        if change <= SLIP_PRECISION * wide:
            break
    return s


@kernel
def _write_forces(servo, wheel, servo_line, state):
    """Write the forces, and their derivatives by the implicit function theorem for the slip.

    `servo_line` is (half of mu N, gain, 1 while the servo is not saturated, else 0); the slip s is
    the root of held (s - drawn) + gain (f(s + spin) + f(s - spin)) = const.
    """
    half, gain, held = servo_line
    slip, wide, across, spin = state
    force, rate = servo.force[wheel], servo.force_rate[wheel]
    a, b = slip + spin, slip - spin
    ha, hb = np.sqrt(a * a + wide * wide), np.sqrt(b * b + wide * wide)
    ia, ib = 1.0 / (ha * ha * ha), 1.0 / (hb * hb * hb)
    fa, fb, u = a / ha, b / hb, 1.0 / ha + 1.0 / hb
    force[T], force[S], force[D] = -half * (fa + fb), -half * across * u, -half * (fa - fb)
    pa, pb = wide * wide * ia, wide * wide * ib  # df/ds
    qa, qb = -a * wide * ia, -b * wide * ib  # df/dwide
    G_s = held + gain * (pa + pb)
    s_along = held / G_s
    s_spin = -gain * (pa - pb) / G_s
    s_wide = -gain * (qa + qb) / G_s
    s_grip = -0.5 * gain / half * (fa + fb) / G_s
    w_across = across / wide
    rate[T, ALONG] = -half * (pa + pb) * s_along
    rate[T, SPIN] = -half * ((pa + pb) * s_spin + pa - pb)
    rate[T, ACROSS] = -half * ((pa + pb) * s_wide + qa + qb) * w_across
    rate[T, GRIP] = -0.5 * (fa + fb) - half * (pa + pb) * s_grip
    rate[D, ALONG] = -half * (pa - pb) * s_along
    rate[D, SPIN] = -half * ((pa - pb) * s_spin + pa + pb)
    rate[D, ACROSS] = -half * ((pa - pb) * s_wide + qa - qb) * w_across
    rate[D, GRIP] = -0.5 * (fa - fb) - half * (pa - pb) * s_grip
    u_s = -across * (a * ia + b * ib)  # derivatives of across (1 / ha + 1 / hb)
    u_spin = -across * (a * ia - b * ib)
    u_wide = -across * wide * (ia + ib)
    rate[S, ALONG] = -half * u_s * s_along
    rate[S, SPIN] = -half * (u_s * s_spin + u_spin)
    rate[S, ACROSS] = -half * (u + (u_s * s_wide + u_wide) * w_across)
    rate[S, GRIP] = -0.5 * across * u - half * u_s * s_grip
