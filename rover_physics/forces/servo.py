# SPDX-License-Identifier: Apache-2.0
"""Policy "servo" at one pose: every wheel on a speed servo at the rate of the commanded motion.

The unknowns are the six wheel loads and the rover's motion (forward, left, turning) on its
contacts, see servo_motion. Where no load keeps a wheel down, its speed of lifting takes the place
of the load: the treads of the others then move so much differently that the forces balance. The
motion gives the sliding velocity of each wheel and with it the friction force, by servo_wheel or,
on yielding soil, by servo_soil. The nine equations are those of equilibrium. A wheel that has to
travel farther than its neighbours is dragged, and others push; a wheel at its friction or torque
limit leaves the rest to the others; wheels that cannot roll where they are moved skid.

Newton's method starts from the loads of equal tractions and the commanded motion. If it fails, or
finds a rover that does not drive, the creep is raised until the problem is nearly linear and
lowered again in stages.
"""

import numpy as np

from rover_physics.forces.equilibrium import write_equations
from rover_physics.forces.servo_motion import (
    MOTIONS,
    SCRUB,
    UNKNOWNS,
    WEIGHTS,
    find_motions,
    level_work,
)
from rover_physics.forces.servo_soil import direction_of_travel, roll_on_soil, speed_of_thrust
from rover_physics.forces.servo_wheel import ACROSS, ALONG, GRIP, SPIN, D, S, T, roll_wheel
from rover_physics.forces.soil import (
    BEKKER_WONG,
    SOIL_MODEL,
    SoilWheel,
    effective_friction,
    solve_wheel,
)
from rover_physics.limits.table import MIN_SPEED_SHARE, TOLERANCE
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_algebra import solve_in_place
from rover_physics.status import Stall
from rover_physics.terrain.ground import copy_soil, friction_at, soil_row_at

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
MODERATE_CREEP, LARGE_CREEP = 0.5, 3.0
"""Creep at the beginning of a search: of the first two, and of the last."""
SOFTNESS = 0.02
"""Width of the transition from load to lifting over the creep, in these searches; in the end a
load of less than a thousandth of the weight."""
UNLIMITED = 1e3
"""Traction, over the weight, that no motor limits."""
TOWED_SLOWLY, TOWED_FAST = 0.1, 1.5
"""Speed shares at which a rover is towed, to find the force that is missing to drive or to brake:
with motors at their limits in either direction."""
STRETCH = 0.05
"""Speed share by which a force of the weight stretches the tow."""
LEAST_LOAD = 0.02
"""Least load, over the weight, at the start of a search."""


@kernel
def balance_servos(model, work):
    """Solve the servo balance of a settled rover; return False if it is singular.

    Args:
        model: A record with `ground` GROUND, `linkage` LINKAGE and `settings` SETTINGS.
        work: WORK with motion, placement and contacts; `balance` and `servo` are written.
    """
    linkage, settings, servo = model.linkage, model.settings, work.servo
    columns = np.int64(1)  # a literal would be compiled as a type of its own
    write_equations(linkage, work.placement, work.contacts, columns, work.balance)
    push = linkage.radius * linkage.mass * linkage.gravity
    servo.droop = settings.servo_droop
    servo.full_traction = settings.max_torque / push
    servo.max_traction = settings.allowed_torque / push
    for k in range(MOTIONS):
        servo.nominal[k] = work.motion[k] / settings.speed
    for wheel in range(6):
        x, y = work.contacts.point[wheel, 0], work.contacts.point[wheel, 1]
        mu = friction_at(model.ground, x, y, settings.friction)
        mu *= settings.friction_factor[wheel]
        servo.yields[wheel] = 0
        if settings.on_soil:
            soil = servo.soil[wheel]
            copy_soil(model.ground, soil_row_at(model.ground, x, y), soil)
            servo.yields[wheel] = 1 if soil[SOIL_MODEL] == BEKKER_WONG else 0
            if not servo.yields[wheel]:
                own = SoilWheel(linkage.radius, linkage.width, mu)
                mu = effective_friction(soil, own, 0.0)
        work.search.mu[wheel] = mu
        servo.mu[wheel] = settings.friction_share * mu
    servo.friction_share = settings.friction_share
    servo.radius, servo.width = linkage.radius, linkage.width
    servo.weight = linkage.mass * linkage.gravity
    return solve_servo(linkage, work, servo)


@kernel
def write_servo_forces(model, work, result):
    """Write forces, slip, torques, power and motion of the servo balance into a RESULT."""
    linkage, settings, servo = model.linkage, model.settings, work.servo
    weight = linkage.mass * linkage.gravity
    power, shear, strength, saturation = 0.0, 0.0, 0.0, 0.0
    for wheel in range(6):
        N = weight * servo.load[wheel]
        result.lift_rate[wheel] = servo.rise[wheel] if servo.z[wheel] <= 0.0 else 0.0
        traction, lateral = weight * servo.force[wheel, T], weight * servo.force[wheel, S]
        result.wheel_loads[wheel] = N
        result.tangential[wheel], result.lateral[wheel] = traction, lateral
        torque = linkage.radius * _write_ground(servo, work.search.mu[wheel], wheel, result)
        result.torque[wheel] = torque
        across = contact_velocity(servo, wheel, servo.z)[1] if N > 0.0 else 0.0
        along = servo.slip[wheel] if N > 0.0 else 0.0
        result.slip_speed[wheel] = settings.speed * np.sqrt(along * along + across * across)
        result.slip_ratio[wheel] = _slip_ratio(servo, wheel)
        result.torque_saturation[wheel] = abs(torque) / settings.max_torque
        shear += np.sqrt(traction * traction + lateral * lateral)
        strength += result.friction[wheel] * max(N, 0.0)
        saturation += result.torque_saturation[wheel]
        power += max(torque * servo.rim_speed[wheel] * settings.speed / linkage.radius, 0.0)
    result.power = power
    result.speed_share = servo.speed_share
    result.stalls = servo.stall
    result.deficit = servo.deficit
    result.friction_share = shear / max(strength, TOLERANCE)
    result.torque_share = saturation / 6.0
    for k in range(MOTIONS):
        result.deviation[k] = servo.deviation[k]


@kernel
def _write_ground(servo, mu, wheel, result):
    """Write friction, its use, sinkage and resistance of a wheel; return its thrust [N].

    The RESULT has load and forces of the wheel; `mu` is the Coulomb friction of its ground.
    """
    N, traction = result.wheel_loads[wheel], result.tangential[wheel]
    lateral = result.lateral[wheel]
    result.sinkage[wheel] = result.motion_resistance[wheel] = 0.0
    result.friction[wheel] = mu
    result.friction_utilisation[wheel] = 0.0 if servo.speed_share > 0.0 else np.inf
    if not servo.yields[wheel]:
        if N > 0.0:
            used = np.sqrt(traction * traction + lateral * lateral)
            result.friction_utilisation[wheel] = used / (mu * N)
        return traction
    soil, own = servo.soil[wheel], SoilWheel(servo.radius, servo.width, mu)
    ahead = -1.0 if servo.command[wheel] < 0.0 else 1.0
    result.friction[wheel] = effective_friction(soil, own, N)
    if not N > 0.0:
        return traction
    solved = solve_wheel(soil, own, N, ahead * traction, lateral)
    result.friction_utilisation[wheel] = solved.utilisation
    result.sinkage[wheel], result.motion_resistance[wheel] = solved.sinkage, solved.resistance
    if servo.speed_share > 0.0:
        along = contact_velocity(servo, wheel, servo.z)[0]
        ahead = direction_of_travel(along, servo.creep)[0]
    return traction + ahead * solved.resistance


@kernel
def _slip_ratio(servo, wheel):
    """Return 1 - v / (r omega) of a driving wheel, (r omega) / v - 1 of a braking one.

    It is within -1 and 1, and positive if the rim is faster than the wheel travels, both in the
    commanded direction of turning. On yielding soil it is 1 - v / (r omega) when braking, too.
    """
    rim, along = servo.rim_speed[wheel], contact_velocity(servo, wheel, servo.z)[0]
    largest = abs(rim) if servo.yields[wheel] else max(abs(rim), abs(along))
    if largest == 0.0:
        return 0.0
    slip = np.copysign((rim - along) / largest, (rim - along) * servo.command[wheel])
    return min(max(slip, -1.0), 1.0)


@kernel
def solve_servo(linkage, work, servo):
    """Find loads, forces and motion of a rover with speed servos; write them into a SERVO.

    Args:
        linkage: LINKAGE.
        work: WORK with placement, contacts and the equations of `write_equations`.
        servo: SERVO with nominal motion, friction or soils, droop, full_traction and
            max_traction.

    Returns:
        False if the equations are singular. `servo.speed_share` is above 0 if the rover drives.
        If not, loads and forces are those of equal tractions, the motion is zero,
        `servo.stall` says why, and `servo.deficit` is the force along the motion that is missing,
        over the weight: negative if it is missing to brake, infinite if none helps.
    """
    if not find_motions(linkage, work.placement, work.contacts, work.balance, servo):
        return False
    servo.creep, servo.stall, servo.towed, servo.deficit = CREEP, Stall.SLIDING, 0.0, 0.0
    share = _find_drive(servo)
    if share >= MIN_SPEED_SHARE:
        _write_drive(servo, share)
        return True
    servo.deficit = _find_deficit(servo)
    if servo.deficit < 0.0:
        servo.stall = Stall.RUNS_AWAY
        _write_standstill(servo)
        return True
    servo.max_traction, limit = UNLIMITED, servo.max_traction
    if _find_drive(servo) >= MIN_SPEED_SHARE:
        servo.stall = Stall.STALLED
    servo.max_traction = limit
    _write_standstill(servo)
    return True


@kernel
def _find_deficit(servo):
    """Return the force that a rover without balance misses to drive, or, negative, to brake."""
    if not _motion_made(servo, servo.z)[1] > 0.0:
        return np.inf
    force = np.inf
    servo.towed = TOWED_SLOWLY
    share = _find_drive(servo)
    if share > -np.inf and TOWED_SLOWLY - share < 0.0:
        servo.towed = TOWED_FAST
        share = _find_drive(servo)
    if share > -np.inf and (servo.towed - share > 0.0) == (servo.towed == TOWED_SLOWLY):
        force = (servo.towed - share) / STRETCH
    servo.towed = 0.0
    return force


@kernel
def _find_drive(servo):
    """Search motion and loads; return the speed share, -inf if no search has a result."""
    _start(servo, np.int64(0))
    servo.softness = 0.0
    share = _share_if_found(servo, _take_newton_steps(servo))
    return share if share >= MIN_SPEED_SHARE else _search_further(servo, share)


@kernel
def _search_further(servo, share):
    """Search from other starts; write the motion with the largest speed share into z, return it.

    `share` is that of z, -inf if z is no solution.
    """
    best = share
    _copy(servo.z, servo.best)
    for search in range(3):
        if best >= MIN_SPEED_SHARE:
            break
        found = _lower_creep(servo, search)
        if found > best:
            best = found
            _copy(servo.z, servo.best)
    _copy(servo.best, servo.z)
    servo.creep = CREEP
    servo.softness = SOFTNESS * CREEP if best > share else 0.0
    write_residual(servo, servo.z)
    return best


@kernel
def _copy(source, target):
    for i in range(UNKNOWNS):
        target[i] = source[i]


@kernel
def _start(servo, search):
    """Write the start of a search: loads of equal tractions, or equal loads; commanded motion."""
    for i in range(6):
        servo.z[i] = 1.0 / 6.0 if search == 1 else max(servo.X[i, WEIGHTS], LEAST_LOAD)
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
def _lower_creep(servo, search):
    """Search with a creep that is lowered in stages; return the speed share, -inf if not found.

    The second of the three searches starts from equal loads.
    """
    creep = LARGE_CREEP if search == 2 else MODERATE_CREEP
    factor = 0.5 if search == 0 else 0.4
    _start(servo, search)
    found = False
    while True:
        servo.creep = max(creep, CREEP)
        servo.softness = SOFTNESS * servo.creep
        found = _take_newton_steps(servo)
        if not _is_near(servo):
            return -np.inf
        if creep <= CREEP:
            return _share_if_found(servo, found)
        creep *= factor


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
    made, asked = _motion_made(servo, servo.z)
    return made / asked if asked > 0.0 else 0.0


@kernel
def _motion_made(servo, z):
    """Return what the level work with the commanded motion is of the motion in z and of itself."""
    made, asked = 0.0, 0.0
    for k in range(MOTIONS):
        for j in range(MOTIONS):
            work = level_work(servo.base, k, j) * servo.nominal[k]
            made += work * z[6 + j]
            asked += work * servo.nominal[j]
    return made, asked


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
    _split_loads(servo, z)
    for wheel in range(6):
        residual[wheel, 0] += servo.load[wheel]
        J[wheel, wheel] = servo.load_rate[wheel]
    for wheel in range(6):
        velocity = contact_velocity(servo, wheel, z)
        if servo.yields[wheel]:
            roll_on_soil(servo, wheel, velocity)
        else:
            roll_wheel(servo, wheel, servo.mu[wheel] * servo.load[wheel], velocity)
        if servo.load[wheel] > 0.0:
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
    made, asked = _motion_made(servo, z)
    for k in range(MOTIONS):
        share = servo.nominal[k] / (STRETCH * asked)
        servo.residual[6 + k, 0] += share * (servo.towed - made / asked)
        for j in range(MOTIONS):
            for i in range(MOTIONS):
                work = level_work(servo.base, i, j) * servo.nominal[i]
                servo.J[6 + k, 6 + j] -= share * work / asked


@kernel
def _split_loads(servo, z):
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
    velocity, grip_rate = servo.velocity[wheel], servo.load_rate[wheel]
    if not servo.yields[wheel]:
        grip_rate *= servo.mu[wheel]
    for i in range(UNKNOWNS):
        x_T, x_S, x_D = X[i, wheel], X[i, 6 + wheel], X[i, SCRUB + wheel]
        servo.residual[i, 0] += x_T * force[T] + x_S * force[S] + x_D * force[D]
        J[i, wheel] += grip_rate * (
            x_T * rate[T, GRIP] + x_S * rate[S, GRIP] + x_D * rate[D, GRIP]
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
def _write_drive(servo, share):
    """Write rim speeds, speed share and deviation of a rover that drives."""
    servo.speed_share = share
    for k in range(MOTIONS):
        servo.deviation[k] = servo.z[6 + k] - share * servo.nominal[k]
    for wheel in range(6):
        along = contact_velocity(servo, wheel, servo.z)[0]
        servo.rim_speed[wheel] = along - servo.slip[wheel]


@kernel
def _write_standstill(servo):
    """Write the forces of equal tractions and no motion, for a rover that does not drive."""
    X = servo.X
    servo.speed_share = 0.0
    servo.deviation[:] = 0.0
    for wheel in range(6):
        servo.load[wheel] = servo.z[wheel] = max(X[wheel, WEIGHTS], 0.0)
        servo.rise[wheel] = 0.0
        along, across = 0.0, 0.0
        for k in range(MOTIONS):
            along += servo.base[wheel, 0, k] * X[6 + k, WEIGHTS]
            across += servo.base[wheel, 1, k] * X[6 + k, WEIGHTS]
        servo.force[wheel, T], servo.force[wheel, S], servo.force[wheel, D] = along, across, 0.0
        servo.rim_speed[wheel] = 0.0
        servo.slip[wheel] = 0.0
    for k in range(MOTIONS):
        servo.z[6 + k] = 0.0
