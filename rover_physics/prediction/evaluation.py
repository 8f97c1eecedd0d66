# SPDX-License-Identifier: Apache-2.0
"""The full model at one pose, as kernels; `PackedModel.evaluate` sweeps it over many poses."""

from typing import Any

import numpy as np

from rover_physics.contact.clearance import belly_clearance
from rover_physics.contact.contact_record import CELL_SEARCH, CONTACTS, WHEEL_SAMPLES, hold_wheels
from rover_physics.contact.settling import settle
from rover_physics.forces.equilibrium import BALANCE, FREE_FORCES, balance_forces, tool_load
from rover_physics.forces.servo import balance_servos, write_servo_forces
from rover_physics.forces.servo_motion import SERVO_STATE
from rover_physics.forces.soil import SoilWheel, coulomb_slip, effective_friction, solve_wheel
from rover_physics.forces.soil_sharing import rolling_direction, share_forces_on_soil
from rover_physics.forces.stability import CORNERS, find_support, tip_over_angles
from rover_physics.forces.torques import TORQUE_SEARCH, apply_torques, minimise_friction
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import new_record, record_type
from rover_physics.prediction.halving import NEXT, ROWS, ask_middle, halve
from rover_physics.results.uses import find_broken
from rover_physics.rover.linkage import LINKAGE, PLACEMENT, place_masses
from rover_physics.rover.steered_drive import steer_wheels
from rover_physics.status import PoseStatus, Stall, TorquePolicy
from rover_physics.terrain.ground import GROUND, SOIL_NUMBERS, friction_at

CHUNK, MAX_CHUNKS = 16, 64
"""Least number of poses per chunk, and largest number of chunks, enough to keep all cores busy.
The poses of a chunk share one work space."""
NONE_HELD = np.empty((0, 6, 2))
"""Value of `held` if no wheel climbs a face."""
AHEAD = np.empty((0, 3))
"""Value of `motions` if the rover drives straight ahead, or straight back if this is its direction
of the settings."""

SETTINGS = record_type(
    ("policy", np.int64),  # a TorquePolicy
    ("friction", float),  # friction coefficient where the terrain has no friction layer
    ("friction_factor", float, (6,)),  # factor of the friction under each wheel
    ("max_torque", float),  # largest wheel torque [N m]
    ("allowed_torque", float),  # largest torque within safety limit and control margin [N m]
    ("allowed_friction", float),  # largest use of friction within safety limit and control margin
    ("control_margin", float),  # share of the limits of friction and torque left to the controller
    ("servo_droop", float),  # share of the nominal speed that a servo loses at full torque
    ("friction_limit", float),  # safety limit of the friction utilisation, as of the next two
    ("torque_limit", float),  # that of the torque saturation
    ("drop_limit", float),  # largest drop of a wheel [m]
    ("on_soil", np.bool_),  # whether the terrain or the options name soils; else Coulomb friction
    ("direction", float),  # 1 if the rover drives forwards, -1 if backwards
    ("held_steering", float, (6,)),  # angles of the wheels [rad]; NaN: those of the motion
    ("speed", float),  # speed of the wheels over the ground [m/s]
    ("max_wheel_speed", float),  # largest wheel speed [rad/s]
    ("flat_angle", float),  # tip-over angle on flat ground [rad]
    ("flat_measure", float),  # force-angle measure on flat ground [N m]
)
"""Options of a sweep, as kernels read them."""

MODEL = record_type(
    ("ground", GROUND),
    ("linkage", LINKAGE),
    ("samples", WHEEL_SAMPLES),
    ("settings", SETTINGS),
)
"""All inputs of the kernels: terrain, rover with arm and payload, wheel samples, options."""

WORK = record_type(
    ("pose", float, (3,)),  # x, y [m] and yaw [rad] of the body origin
    ("motion", float, (3,)),  # its nominal vx, vy [m/s] and yaw rate [rad/s], body frame, level
    ("rolling", float, (6,)),  # nominal speeds of the wheels along their headings [m/s]
    ("can_follow", np.bool_),  # whether all wheels can be steered along this motion
    ("q", float, (6,)),  # z [m], roll, pitch, right rocker, right and left bogie angle [rad]
    ("placement", PLACEMENT),  # positions of the parts at q
    ("contacts", CONTACTS),  # wheel contacts
    ("cells", CELL_SEARCH),  # search between the rims of a wheel
    ("balance", BALANCE),  # forces as linear functions of the torques
    ("search", TORQUE_SEARCH),  # the chosen forces
    ("servo", SERVO_STATE),  # forces and motion under policy SERVO
    ("J", float, (6, 6)),  # derivatives of the gaps by q
    ("step", float, (6, 1)),  # Newton step
    ("lifts", float, (6, 6)),  # changes of q, one column for each wheel, that raise this wheel
    ("start", float, (6,)),  # q before a lift
    ("unsettled", float, (6,)),  # q before the recoveries
    ("corners", float, (CORNERS, 3)),  # support polygon [m]
    ("centre", float, (3,)),  # centre of mass [m]
    ("force", float, (3,)),  # net force without that of the ground [N]
    ("moment", float, (3,)),  # net moment about the centre without that of the ground [N m]
    ("soils", float, (6, SOIL_NUMBERS)),  # soil under each wheel
    ("best", float, (3, 6)),  # best N, T, S so far, over the rover's weight
)
"""Work space of one thread: all that kernels write at one pose; map frame."""


def new_work() -> Any:
    """Return an empty WORK, no wheel held."""
    work = new_record(WORK)
    work.contacts.held_height = work.contacts.held_angle = np.nan
    return work


_NEW_WORK = np.array([new_work()], WORK).view(np.float64)
"""Empty WORK as floats, which numpy copies faster than records."""


def new_works(threads: int, poses: int) -> Any:
    """Return empty WORKs for a sweep, one for each chunk of poses."""
    chunks = 1 if threads == 1 else min(MAX_CHUNKS, -(-poses // CHUNK))
    return _NEW_WORK[None].repeat(chunks, axis=0).view(WORK)[:, 0]


@kernel
def evaluate_poses(
    models, limits, poses, motions, held, stretches, works, results, first_chunk, end_chunk
):
    """Evaluate the poses of some chunks into results, one chunk per work space.

    With stretches, it evaluates what they ask for, from the next row on and as long as there is
    space for more; all of it is one chunk.

    Args:
        models: (m, 1) or (m, 3) MODEL, the rows of which differ in friction, torques and masses
            alone: the rover settles in all of them as in the first; (1, 1) or (1, 3) with
            stretches.
        limits: (k,) LIMIT.
        poses: As for `PackedModel.evaluate`, as are motions and held.
        motions: Above.
        held: Above.
        stretches: Stretches, or NO_STRETCHES.
        works: (chunks,) WORK.
        results: RESULTs (n m,), those of a pose side by side, written.
        first_chunk: The first chunk.
        end_chunk: The one after the last.
    """
    n, chunks, divides = poses.shape[0], works.size, stretches.ends.shape[0] > 0
    for chunk in range(first_chunk, end_chunk):
        i, end = n * chunk // chunks, n * (chunk + 1) // chunks
        if divides:
            i, end = stretches.numbers[NEXT], stretches.numbers[ROWS]
        while i < end and (not divides or end + 2 <= n):
            if divides and not ask_middle(stretches, poses, motions, results, i):
                results[i].status = PoseStatus.NOT_SETTLED.value
            else:
                set_pose(models[0, 0], poses, motions, i, works[chunk])
                hold_wheels(held, i, works[chunk].contacts)
                _evaluate_rows(models, limits, works[chunk], results, i)
                if divides:
                    halve(stretches, models[0, 0], limits, poses, results, i)
                    end = stretches.numbers[ROWS]
            i += 1
        if divides:
            stretches.numbers[NEXT] = i


@kernel
def _evaluate_rows(models, limits, work, results, i):
    """Evaluate all models at pose i of the work space, into their rows; as `evaluate_poses`."""
    status, variants = stand(models[0, 0], work), models.shape[0]
    for k in range(variants):
        if k > 0 and status == PoseStatus.SETTLED:
            place_masses(models[k, 0].linkage, work.q, work.placement)
        _evaluate_row(models[k], limits, work, status, results[i * variants + k])


@kernel
def set_pose(model, poses, motions, i, work):
    """Write pose i, its motion and the steering of the wheels into the work space.

    `poses` and `motions` are as for `PackedModel.evaluate`.
    """
    motion = work.motion
    motion[0], motion[1], motion[2] = model.settings.direction * model.settings.speed, 0.0, 0.0
    for k in range(3):
        work.pose[k] = poses[i, k]
        if motions.shape[0] > 0:
            motion[k] = motions[i, k]
    angles, rolling = work.placement.steering, work.rolling
    work.can_follow = steer_wheels(model.linkage, motion, angles, rolling)
    held = model.settings.held_steering
    if held[0] == held[0]:
        work.can_follow = True
        for wheel in range(6):
            angles[wheel] = held[wheel]


@kernel
def _evaluate_row(models, limits, work, status, result):
    """Evaluate a rover for which `stand` has returned a status.

    If the rover does not settle or its forces do not balance, only motion, steering and status are
    written. If a number is none, the status says so: NaN would keep every limit.

    A control margin asks three models: optimal torques that leave the margin, equal torques, which
    need none, and optimal torques up to the physical limits. The first that passes counts, else
    the last, which shows by how much the margin is missed.

    Args:
        models: (1,) MODEL, or these three.
        limits: (k,) LIMIT.
        work: WORK.
        status: A PoseStatus.
        result: RESULT, written.
    """
    _write_motion(models[0].linkage, work, result)
    for k in range(models.size):
        evaluate_stance(models[k], work, status, result)
        if k + 1 == models.size or status != PoseStatus.SETTLED:
            break
        if result.status == PoseStatus.SETTLED and find_broken(result, limits)[0] < 0:
            break


@kernel
def stand(model, work):
    """Settle the rover at the pose and motion of `set_pose`; return a PoseStatus.

    What it writes depends on the rover and its ground, not on the torque policy.
    """
    status = settle(model, work) if work.can_follow else PoseStatus.STEERING
    if status == PoseStatus.SETTLED:
        place_masses(model.linkage, work.q, work.placement)
    return status


@kernel
def evaluate_stance(model, work, status, result):
    """Evaluate a rover for which `stand` has returned a status, without motion and steering."""
    linkage = model.linkage
    if status == PoseStatus.SETTLED and not _balance(model, work):
        status = PoseStatus.NO_EQUILIBRIUM
    result.status = status
    _write_no_path(result)
    if status != PoseStatus.SETTLED:
        result.q[:] = np.nan
        return
    result.time = result.energy = 0.0
    for k in range(6):
        result.q[k] = work.q[k]
    result.rocker_angle[0], result.rocker_angle[1] = work.q[3], -work.q[3]
    upright = np.cos(work.q[1]) * np.cos(work.q[2])
    result.tilt = np.arccos(min(max(upright, -1.0), 1.0))
    result.kept_share = 1.0 - model.settings.control_margin
    _write_geometry(work.placement, work.contacts, result)
    _write_forces(model, work, result)
    angle, measure = find_tip_over(linkage, work)
    result.tip_over_ratio = angle / model.settings.flat_angle
    result.tip_over_force_angle = measure / model.settings.flat_measure
    result.belly_clearance = belly_clearance(model.ground, linkage, work.placement)
    if not _is_computable(result):
        result.status = PoseStatus.NOT_COMPUTABLE
        result.time = result.energy = np.nan


@kernel
def find_tip_over(linkage, work):
    """Return tip-over angle [rad] and force-angle measure [N m] from placement and contacts."""
    centre, force, moment = work.centre, work.force, work.moment
    _write_centre_of_mass(linkage, work.placement, centre)
    force[0], force[1], force[2] = 0.0, 0.0, -linkage.mass * linkage.gravity
    moment[:] = 0.0
    if linkage.has_tool_load:
        _add_tool_load(linkage, work.placement, centre, force, moment)
    find_support(linkage, work.placement, work.contacts, work.corners)
    return tip_over_angles(work.corners, centre, force, moment)


@kernel
def _add_tool_load(linkage, placement, centre, force, moment):
    """Add the tool's force [N] and its moment [N m] about `centre` to `force` and `moment`."""
    origin, tool = placement.origin, linkage.tool
    fx, moment_x = tool_load(placement.R, tool, np.int64(0))
    fy, moment_y = tool_load(placement.R, tool, np.int64(1))
    fz, moment_z = tool_load(placement.R, tool, np.int64(2))
    rx, ry, rz = origin[0] - centre[0], origin[1] - centre[1], origin[2] - centre[2]
    force[0] += fx
    force[1] += fy
    force[2] += fz
    moment[0] += moment_x + ry * fz - rz * fy
    moment[1] += moment_y + rz * fx - rx * fz
    moment[2] += moment_z + rx * fy - ry * fx


@kernel
def _write_centre_of_mass(linkage, placement, centre):
    coms, centres = placement.part_coms, placement.centres
    for k in range(3):
        total = linkage.body_mass * coms[0, k]
        total += linkage.rocker_mass * (coms[1, k] + coms[2, k])
        total += linkage.bogie_mass * (coms[3, k] + coms[4, k])
        for wheel in range(6):
            total += linkage.wheel_mass * centres[wheel, k]
        centre[k] = total / linkage.mass


@kernel
def _balance(model, work):
    """Solve the equilibrium for the policy; return False if it is singular."""
    linkage, policy = model.linkage, model.settings.policy
    if policy == TorquePolicy.SERVO:
        return balance_servos(model, work)
    work.contacts.lean[:] = 0.0  # servos may have balanced the same pose before
    columns = 1 if policy == TorquePolicy.EQUAL else 1 + FREE_FORCES
    return balance_forces(linkage, work.placement, work.contacts, columns, work.balance)


@kernel
def _is_computable(result):
    """Return whether results are numbers; a lifted wheel may have infinite utilisation."""
    total = result.power
    for k in range(6):
        total += result.q[k]
        total += abs(result.wheel_loads[k]) + abs(result.tangential[k]) + abs(result.lateral[k])
        total += abs(result.torque[k]) + result.torque_saturation[k]
        total += result.contact_angle[k] + result.sinkage[k] + result.motion_resistance[k]
        if np.isnan(result.friction_utilisation[k]) or np.isnan(result.slip_ratio[k]):
            return False
    return not np.isnan(result.tip_over_ratio) and total - total == 0.0


@kernel
def _write_no_path(result):
    """Write what the path around a pose would decide, as at a pose that is on no path."""
    for wheel in range(6):
        result.wheel_drop[wheel] = result.falling[wheel] = result.lift_height[wheel] = 0.0
    result.drift[0] = result.drift[1] = result.distance = 0.0
    result.time = result.energy = np.nan


@kernel
def _write_motion(linkage, work, result):
    for k in range(3):
        result.motion[k] = work.motion[k]
    for wheel in range(6):
        result.steering_angle[wheel] = work.placement.steering[wheel]
        result.wheel_speed[wheel] = work.rolling[wheel] / linkage.radius


@kernel
def _write_geometry(placement, contacts, result):
    for wheel in range(6):
        result.contact_angle[wheel] = np.arctan2(contacts.sine[wheel], contacts.cosine[wheel])
        for k in range(3):
            result.wheel_centres[wheel, k] = placement.centres[wheel, k]
            result.contact_points[wheel, k] = contacts.point[wheel, k]


@kernel
def _write_forces(model, work, result):
    ground, linkage, settings = model.ground, model.linkage, model.settings
    if settings.policy == TorquePolicy.SERVO:
        write_servo_forces(model, work, result)
        return
    result.speed_share, result.stalls = 1.0, Stall.NONE.value
    result.friction_share = result.torque_share = result.deficit = 0.0
    result.deviation[:] = 0.0
    result.lift_rate[:] = 0.0
    result.slip_speed[:] = 0.0
    search, point = work.search, work.contacts.point
    weight = linkage.mass * linkage.gravity
    for wheel in range(6):
        mu = friction_at(ground, point[wheel, 0], point[wheel, 1], settings.friction)
        search.mu[wheel] = settings.friction_factor[wheel] * mu
    if settings.on_soil:
        share_forces_on_soil(model, work)
    elif settings.policy == TorquePolicy.EQUAL:
        apply_torques(work.balance, np.int64(0), search)
    else:
        minimise_friction(linkage, settings, work.balance, search)
    power = 0.0
    for wheel in range(6):
        N = weight * search.wheel_loads[wheel]
        T = weight * search.tangential[wheel]
        S = weight * search.lateral[wheel]
        mu = search.mu[wheel]
        sinkage, resistance = 0.0, 0.0
        direction = rolling_direction(work, wheel)
        if settings.on_soil:
            soil = work.soils[wheel]
            own = SoilWheel(linkage.radius, linkage.width, mu)
            solved = solve_wheel(soil, own, N, direction * T, S)
            slip, utilisation = solved.slip_ratio, solved.utilisation
            sinkage, resistance = solved.sinkage, solved.resistance
            torque = direction * solved.torque
            mu = effective_friction(soil, own, N)
        else:
            torque = linkage.radius * T
            utilisation = np.sqrt(T * T + S * S) / (mu * N) if N > 0.0 else np.inf
            slip = coulomb_slip(utilisation)
        result.wheel_loads[wheel] = N
        result.tangential[wheel] = T
        result.lateral[wheel] = S
        result.torque[wheel] = torque
        result.friction[wheel] = mu
        result.friction_utilisation[wheel] = utilisation
        result.slip_ratio[wheel] = slip
        result.torque_saturation[wheel] = abs(torque) / settings.max_torque
        result.sinkage[wheel] = sinkage
        result.motion_resistance[wheel] = resistance
        rolled = abs(work.rolling[wheel])
        most = settings.max_wheel_speed
        power += max(direction * torque, 0.0) * _spin(linkage.radius, slip, rolled, most)
    result.power = power


@kernel
def _spin(radius, slip, rolled, most):
    """Return the rate [rad/s], at most `most`, of a wheel that rolls at `rolled` [m/s]."""
    if slip >= 1.0:
        return most
    return min(rolled / (radius * (1.0 - slip)), most)
