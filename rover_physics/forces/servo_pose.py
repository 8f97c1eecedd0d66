"""Policy "servo" at one pose: inputs from model and work space, results in SI units."""

import numpy as np

from rover_physics.forces.equilibrium import write_equations
from rover_physics.forces.servo import contact_velocity, solve_servo
from rover_physics.forces.servo_record import MOTIONS, ServoBalance
from rover_physics.forces.servo_wheel import S, T
from rover_physics.numerics.kernels import kernel
from rover_physics.terrain.ground import friction_at


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
        work.search.mu[wheel] = mu
        servo.mu[wheel] = settings.friction_share * mu
    return solve_servo(linkage, work, servo)


@kernel
def write_servo_forces(model, work, result):
    """Write forces, slip, torques, power and motion of the servo balance into a RESULT."""
    linkage, settings, servo = model.linkage, model.settings, work.servo
    weight = linkage.mass * linkage.gravity
    power = 0.0
    for wheel in range(6):
        N, mu = weight * servo.load[wheel], work.search.mu[wheel]
        result.lift_rate[wheel] = servo.rise[wheel] if servo.z[wheel] <= 0.0 else 0.0
        traction, lateral = weight * servo.force[wheel, T], weight * servo.force[wheel, S]
        torque = linkage.radius * traction
        result.wheel_loads[wheel], result.friction[wheel] = N, mu
        result.tangential[wheel], result.lateral[wheel] = traction, lateral
        result.torque[wheel] = torque
        result.friction_utilisation[wheel] = 0.0 if servo.speed_share > 0.0 else np.inf
        if N > 0.0:
            used = np.sqrt(traction * traction + lateral * lateral)
            result.friction_utilisation[wheel] = used / (mu * N)
        across = contact_velocity(servo, wheel, servo.z)[1] if N > 0.0 else 0.0
        along = servo.slip[wheel] if N > 0.0 else 0.0
        result.slip_speed[wheel] = settings.speed * np.sqrt(along * along + across * across)
        result.slip_ratio[wheel] = _slip_ratio(servo, wheel)
        result.torque_saturation[wheel] = abs(torque) / settings.max_torque
        result.sinkage[wheel] = result.motion_resistance[wheel] = 0.0
        power += max(torque * servo.rim_speed[wheel] * settings.speed / linkage.radius, 0.0)
    result.power = power
    result.speed_share = servo.speed_share
    result.stalls = 1.0 if servo.balance == ServoBalance.STALLS else 0.0
    for k in range(MOTIONS):
        result.deviation[k] = servo.deviation[k]


@kernel
def _slip_ratio(servo, wheel):
    """Return 1 - v / (r omega) of a driving wheel, (r omega) / v - 1 of a braking one.

    It is within -1 and 1, and positive if the rim is faster than the wheel's way, both in the
    commanded direction of turning.
    """
    rim, way = servo.rim_speed[wheel], contact_velocity(servo, wheel, servo.z)[0]
    largest = max(abs(rim), abs(way))
    if largest == 0.0:
        return 0.0
    slip = np.copysign((rim - way) / largest, (rim - way) * servo.command[wheel])
    return min(max(slip, -1.0), 1.0)
