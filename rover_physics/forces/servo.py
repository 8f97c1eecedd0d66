# SPDX-License-Identifier: Apache-2.0
"""Policy "servo" at one pose: every wheel on a speed servo at the rate of the commanded motion.

This is what others call. `servo_balance` solves for loads and motion by the equilibrium of
`servo_motion`, with the forces of each wheel by `servo_wheel` or, on yielding soil, `servo_soil`.
"""

import numpy as np

from rover_physics.forces.equilibrium import write_equations
from rover_physics.forces.servo_balance import contact_velocity, solve_servo
from rover_physics.forces.servo_motion import MOTIONS
from rover_physics.forces.servo_soil import direction_of_travel
from rover_physics.forces.servo_wheel import S, T
from rover_physics.forces.soil import (
    BEKKER_WONG,
    SOIL_MODEL,
    SoilWheel,
    effective_friction,
    solve_wheel,
)
from rover_physics.limits.table import TOLERANCE
from rover_physics.numerics.kernels import kernel
from rover_physics.terrain.ground import copy_soil, friction_at, soil_row_at


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
