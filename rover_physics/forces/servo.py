# SPDX-License-Identifier: Apache-2.0
"""Policy "servo" at one pose: every wheel on a speed servo at the rate of the commanded motion.

The unknowns are the six wheel loads and the rover's motion (forward, left, turning) on its
contacts, see servo_motion. Where no load keeps a wheel down, its speed of lifting takes the place
of the load: the treads of the others then move so much differently that the forces balance. The
motion gives the sliding velocity of each wheel and with it the force of firm ground or yielding
soil, see servo_wheel. The nine equations are those of equilibrium. A wheel that has to travel
farther than its neighbours is dragged, and others push; a wheel at its friction or torque limit
leaves the rest to the others; wheels that cannot roll where they are moved skid.

servo_balance.py has the equations, servo_search.py the search of their solution.
"""

import numpy as np

from rover_physics.forces.equilibrium import write_equations
from rover_physics.forces.servo_balance import STRETCH, contact_velocity, motion_made
from rover_physics.forces.servo_ground import direction_of_travel
from rover_physics.forces.servo_motion import (
    MOTIONS,
    TURN_DISTANCE,
    WEIGHTS,
    find_motions,
    lean_on_rims,
)
from rover_physics.forces.servo_search import CREEP, find_drive, search_everywhere
from rover_physics.forces.servo_wheel import D, S, T
from rover_physics.forces.shares import write_shares
from rover_physics.forces.soil import (
    BEKKER_WONG,
    SOIL_FRICTION,
    SOIL_MODEL,
    SoilWheel,
    effective_friction,
    solve_wheel,
)
from rover_physics.limits.table import MIN_SPEED_SHARE, TOLERANCE
from rover_physics.numerics.kernels import kernel
from rover_physics.status import Stall
from rover_physics.terrain.ground import copy_soil, friction_at, soil_row_at

UNLIMITED = 1e3
"""Traction, over the weight, that no motor limits."""
TOWED_SLOWLY, TOWED_FAST = 0.1, 1.5
"""Speed shares at which a rover is towed, to find the force that is missing to drive or to brake:
with motors at their limits in either direction."""


@kernel
def balance_servos(model, work):
    """Solve the servo balance of a settled rover; return False if it is singular.

    Args:
        model: A record with `ground` GROUND, `linkage` LINKAGE and `settings` SETTINGS.
        work: WORK with motion, placement and contacts; `balance` and `servo` are written.
    """
    linkage, settings, servo = model.linkage, model.settings, work.servo
    columns = np.int64(1)  # a literal would be compiled as a type of its own
    write_shares(linkage, work.placement, work.balance.shares)
    lean_on_rims(work.placement, work.contacts, work.balance.lean)
    write_equations(linkage, work.placement, work.contacts, columns, work.balance)
    push = linkage.radius * linkage.mass * linkage.gravity
    servo.droop = settings.servo_droop
    servo.full_traction = settings.max_torque / push
    servo.max_traction = settings.allowed_torque / push
    for k in range(MOTIONS):
        servo.nominal[k] = work.motion[k] / settings.speed
    servo.nominal[2] *= TURN_DISTANCE * linkage.radius
    for wheel in range(6):
        x, y = work.contacts.point[wheel, 0], work.contacts.point[wheel, 1]
        mu = friction_at(model.ground, x, y, settings.friction)
        mu *= settings.friction_factor[wheel]
        servo.yields[wheel] = 0
        if settings.on_soil:
            soil = servo.soil[wheel]
            copy_soil(model.ground, soil_row_at(model.ground, x, y), soil)
            soil[SOIL_FRICTION] *= settings.friction_factor[wheel]
            servo.yields[wheel] = 1 if soil[SOIL_MODEL] == BEKKER_WONG else 0
            if not servo.yields[wheel]:
                own = SoilWheel(linkage.radius, linkage.width, mu)
                mu = effective_friction(soil, own, 0.0)
        work.search.mu[wheel] = mu
        servo.mu[wheel] = settings.friction_limit * mu
    servo.friction_share = settings.friction_limit
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
        largest, use = result.friction[wheel] * max(N, 0.0), result.friction_utilisation[wheel]
        if servo.yields[wheel] and N > 0.0:  # resistance is no shear
            shear += largest * (use if use < np.inf else 1.0)
        else:
            shear += np.sqrt(traction * traction + lateral * lateral)
        strength += largest
        saturation += result.torque_saturation[wheel]
        power += max(torque * servo.rim_speed[wheel] * settings.speed / linkage.radius, 0.0)
        _stand_upright(work.balance.lean[wheel], wheel, result)
    result.power = power
    result.speed_share = servo.speed_share
    result.stalls = servo.stall
    result.deficit = servo.deficit
    result.friction_share = shear / max(strength, TOLERANCE)
    result.torque_share = saturation / 6.0
    for k in range(MOTIONS):
        result.deviation[k] = servo.deviation[k]
    result.deviation[2] /= TURN_DISTANCE * linkage.radius


@kernel
def _stand_upright(lean, wheel, result):
    """Write load and lateral force of a wheel along its radius and axle, whatever the lean."""
    N, S = result.wheel_loads[wheel], result.lateral[wheel]
    upright = 1.0 / np.sqrt(1.0 + lean * lean)
    result.wheel_loads[wheel] = upright * (N - lean * S)
    result.lateral[wheel] = upright * (S + lean * N)


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
    """Find loads, forces and motion of a rover with speed servos; write them into a SERVO_STATE.

    Args:
        linkage: LINKAGE.
        work: WORK with placement, contacts and the equations of `write_equations`.
        servo: SERVO_STATE with nominal motion, friction or soils, droop, full_traction and
            max_traction.

    Returns:
        False if the equations are singular. `servo.speed_share` is above 0 if the rover drives.
        If not, loads and forces are those of equal tractions, the motion is zero,
        `servo.stall` says why, and `servo.deficit` is the force along the motion that is missing,
        over the weight: negative if it is missing to brake, infinite if none helps.
    """
    if not find_motions(linkage, work.placement, work.contacts, work.balance, servo):
        return False
    servo.creep, servo.stall, servo.towed, servo.deficit = CREEP, Stall.NONE, 0.0, 0.0
    share = find_drive(servo)
    if share < MIN_SPEED_SHARE:
        servo.deficit = _find_deficit(servo)
        if servo.deficit == np.inf:
            share = search_everywhere(servo)
    if share >= MIN_SPEED_SHARE:
        servo.deficit = 0.0
        _write_drive(servo, share)
        return True
    if servo.deficit < 0.0:
        servo.stall = Stall.RUNS_AWAY
        _write_standstill(servo)
        return True
    servo.max_traction, limit = UNLIMITED, servo.max_traction
    if find_drive(servo) >= MIN_SPEED_SHARE:
        servo.stall = Stall.STALLED
    servo.max_traction = limit
    _write_standstill(servo)
    return True


@kernel
def _find_deficit(servo):
    """Return the force that a rover without balance misses to drive, or, negative, to brake."""
    if not motion_made(servo, servo.z)[1] > 0.0:
        return np.inf
    force = np.inf
    servo.towed = TOWED_SLOWLY
    share = find_drive(servo)
    if share > -np.inf and TOWED_SLOWLY - share < 0.0:
        servo.towed = TOWED_FAST
        share = find_drive(servo)
    if share > -np.inf and (servo.towed - share > 0.0) == (servo.towed == TOWED_SLOWLY):
        force = (servo.towed - share) / STRETCH
    servo.towed = 0.0
    return force


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
