# SPDX-License-Identifier: Apache-2.0
"""Searches for loads and motion of policy "servo" at which the nine equations hold.

Newton's method starts from the loads of equal tractions and the commanded motion. If it fails, or
finds a rover that does not drive, the creep is raised until the problem is nearly linear and
lowered again in stages. Where nothing else is known, the loads that give friction are held for
some rounds and follow those that are found, from many starts: with held loads the problem is
convex on firm ground, and has one solution (Necas, Jarusek and Haslinger, Bollettino UMI 17-B,
1980).
"""

import numpy as np

from rover_physics.forces.servo_balance import motion_made, split_loads, write_residual
from rover_physics.forces.servo_ground import speed_of_thrust
from rover_physics.forces.servo_motion import MOTIONS, UNKNOWNS, WEIGHTS, level_work
from rover_physics.limits.table import MIN_SPEED_SHARE
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_algebra import solve_in_place

CREEP = 0.01
"""Sliding velocity, over the nominal speed, at which a wheel has 0.7 of its friction: elastic slip
of treads on hard ground is about a per cent."""
MAX_STEPS = 25
"""Largest number of Newton steps."""
MAX_HALVINGS = 12
"""Largest number of halvings of a Newton step."""
PRECISION = 1e-7
"""Residual of the nine equations, over the weight, at which they hold."""
MAX_MOTION = 6.0
"""Motion, over the commanded one, from which the rover slides away without balance."""
RAISED, LOWERED = (0.5, 3.0), 0.5
"""Creep at the beginning of each search that lowers it, and its factor from stage to stage."""
ROUNDS, FOLLOWED = 5, 1e-3
"""Largest number of rounds with held loads, and difference between these and the loads that are
found, over the weight, at which they are the same."""
SOFTNESS = 0.02
"""Width of the transition from load to lifting over the creep, in all but the first search; in the
end a load of less than a thousandth of the weight."""
LEAST_LOAD = 0.02
"""Least load, over the weight, at the start of a search."""
CHANGES = (0.2, 0.1, 0.4)
"""Standard deviations of the motion, forward, left [over the nominal speed] and turning [rad per
TURN_DISTANCE], at the starts of a search."""


def _draw_starts(count: int) -> np.ndarray:
    """Return starts (count, 10): loads over the weight, share of the commanded motion, changes."""
    rng = np.random.default_rng(3)
    loads, share = rng.dirichlet(np.full(6, 2.0), count), rng.uniform(0.05, 1.2, (count, 1))
    return np.hstack([loads, share, rng.normal(size=(count, MOTIONS)) * CHANGES])


STARTS, MOST_SLIDES = _draw_starts(32), 3
"""Starts of the search with held loads, and number of them from which a rover slides away that has
no balance."""


@kernel
def find_drive(servo):
    """Search motion and loads; return the speed share, -inf if no search has a result."""
    servo.softness = 0.0
    _start(servo)
    share = _share_if_found(servo, _take_newton_steps(servo))
    if share >= MIN_SPEED_SHARE:
        return share
    _copy(servo.z, servo.best)
    for creep in RAISED:
        found = _lower_creep(servo, creep)
        if found >= MIN_SPEED_SHARE:
            return found
        if found > share:
            share = found
            _copy(servo.z, servo.best)
    _copy(servo.best, servo.z)
    servo.creep, servo.softness = CREEP, 0.0
    write_residual(servo, servo.z)
    return share


@kernel
def search_everywhere(servo):
    """Search with held loads from many starts; return the speed share, -inf if nothing is found.

    A rover that slides away from MOST_SLIDES starts slides.
    """
    slides = 0
    for start in range(STARTS.shape[0]):
        _start_elsewhere(servo, STARTS[start])
        share = _hold_loads(servo)
        if share >= MIN_SPEED_SHARE:
            return share
        if not _is_near(servo):
            slides += 1
        if slides == MOST_SLIDES:
            break
    return -np.inf


@kernel
def _copy(source, target):
    for i in range(UNKNOWNS):
        target[i] = source[i]


@kernel
def _start(servo):
    """Write the start of a search: loads of equal tractions, commanded motion."""
    servo.holds_loads = False
    for i in range(6):
        servo.z[i] = max(servo.X[i, WEIGHTS], LEAST_LOAD)
        servo.slip[i] = np.nan
    along = np.copysign(servo.X[6, WEIGHTS], servo.X[6, WEIGHTS] * servo.nominal[0])
    share = min(max(1.0 - servo.droop * along / servo.full_traction, 0.5), 1.2)
    yielding, speed = 0, 0.0
    for i in range(6):
        if servo.yields[i]:
            yielding += 1
            speed += speed_of_thrust(servo, i, servo.z[i], along)
    if yielding > 0:
        share = max(speed / yielding, MIN_SPEED_SHARE)
    for k in range(MOTIONS):
        servo.z[6 + k] = share * servo.nominal[k]


@kernel
def _lower_creep(servo, creep):
    """Search with a creep that is lowered in stages; return the speed share, -inf if not found."""
    _start(servo)
    while True:
        servo.creep = max(creep, CREEP)
        servo.softness = SOFTNESS * servo.creep
        found = _take_newton_steps(servo)
        if not _is_near(servo):
            return -np.inf
        if creep <= CREEP:
            return _share_if_found(servo, found)
        creep *= LOWERED


@kernel
def _start_elsewhere(servo, start):
    """Write one of STARTS (10,) into z."""
    for i in range(6):
        servo.z[i], servo.slip[i] = start[i], np.nan
    for k in range(MOTIONS):
        servo.z[6 + k] = start[6] * servo.nominal[k] + start[7 + k]


@kernel
def _hold_loads(servo):
    """Search from z with held loads that follow those found; return the speed share.

    It is -inf if nothing is found.
    """
    servo.creep, servo.softness = CREEP, SOFTNESS * CREEP
    servo.holds_loads = True
    for i in range(6):
        servo.pressing[i] = servo.z[i]
    for _ in range(ROUNDS):
        _take_newton_steps(servo)
        if not _is_near(servo):
            break
        split_loads(servo, servo.z)
        largest = 0.0
        for i in range(6):
            largest = max(largest, abs(servo.load[i] - servo.pressing[i]))
            servo.pressing[i] = servo.load[i]
        if largest < FOLLOWED:
            break
    servo.holds_loads = False
    return _share_if_found(servo, _take_newton_steps(servo))


@kernel
def _take_newton_steps(servo):
    """Take damped Newton steps from z; return whether the nine equations hold."""
    z, trial, step, residual = servo.z, servo.trial, servo.step, servo.residual
    size = write_residual(servo, z)
    for _ in range(MAX_STEPS):
        if size <= PRECISION:
            return True
        for i in range(UNKNOWNS):
            step[i, 0] = residual[i, 0]
        if not solve_in_place(servo.J, step, UNKNOWNS, 1):
            return False
        longest = 1.0
        for k in range(MOTIONS):
            longest = max(longest, abs(step[6 + k, 0]))
        damping = 1.0 / longest
        lower = False
        for _ in range(MAX_HALVINGS):
            for i in range(UNKNOWNS):
                trial[i] = z[i] - damping * step[i, 0]
            new = write_residual(servo, trial)
            if new < size * (1.0 - 1e-4 * damping):
                lower = True
                break
            damping *= 0.5
        if not lower:
            return False
        _copy(trial, z)
        size = new
        if not _is_near(servo):
            return False
    return size <= PRECISION


@kernel
def _is_near(servo):
    """Return whether the motion is a number within MAX_MOTION."""
    scale = 0.0
    size = 0.0
    for k in range(MOTIONS):
        scale += level_work(servo.base, k, k) * servo.nominal[k] ** 2
        size += level_work(servo.base, k, k) * servo.z[6 + k] ** 2
    return size <= MAX_MOTION * MAX_MOTION * scale


@kernel
def _share_if_found(servo, found):
    return speed_share(servo) if found else -np.inf


@kernel
def speed_share(servo):
    """Return the share of the commanded motion in z, weighted by the distances of the wheels."""
    made, asked = motion_made(servo, servo.z)
    return made / asked if asked > 0.0 else 0.0
