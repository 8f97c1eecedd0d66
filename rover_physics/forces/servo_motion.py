# SPDX-License-Identifier: Apache-2.0
"""Record of policy "servo", the motions that contacts allow, and the equilibrium by wheel forces.

A rover whose six wheels stay on the ground moves in three ways. The motions follow from the
equilibrium by virtual work: M is the matrix whose columns are the wheel loads and three base
forces, and row 6 + k of its inverse is a motion that lifts no wheel and on which base force l does
work 1 if l = k, else 0. A base force has the components of the level velocity of each wheel in a
unit motion, along the contact's tangents. On level ground the motions are thus forward, left and
turn by one unit; on a face, where the body cannot move ahead while its wheel climbs, they remain
regular: "one unit forward" means that the treads travel as far as on level ground.
"""

import numpy as np

from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_algebra import dot, solve_in_place
from rover_physics.numerics.records import record_type
from rover_physics.rover.linkage import rocker_sign
from rover_physics.terrain.ground import SOIL_NUMBERS

MOTIONS = 3
"""Motions of the rover on the ground: forward, to the left, and turning left."""
UNKNOWNS = 6 + MOTIONS
"""Unknowns of the servo balance: six wheel loads and the motion."""
WEIGHTS = 12
"""Column of X with the weights; before it are tractions and lateral forces, behind it scrub."""
SCRUB = 13
"""First column of X with scrub forces."""
COLUMNS = 19
"""Columns of X."""
TURN_DISTANCE = 10.0
"""Distance [wheel radii] per which turning counts: in a tight curve, a rover turns by about a
radian while it goes so far."""
GAUSS_POINT = 1.0 / np.sqrt(3.0)
"""Places of two points that stand for a uniform pressure, as of soil, over half the width."""
FLUSH = 0.02
"""Angle [rad] between axle and ground from which a wheel stands on its rim; a flush wheel has its
whole width on the ground."""
STEEPEST, TANGENT = 1.0, 3e-3
"""Slope of the ground, and angle [rad] between it and a rim, up to which the rim has its normal:
45 degrees, as for a face, and the precision of contacts."""

SERVO_STATE = record_type(
    ("X", float, (UNKNOWNS, COLUMNS)),  # loads and missing forces per unit of wheel force
    ("M", float, (UNKNOWNS, UNKNOWNS)),  # work space: loads and base forces in the equilibrium
    ("base", float, (6, 2, MOTIONS)),  # level velocity of wheels along and across for unit motions
    ("velocity", float, (6, 3, MOTIONS)),  # along, across, spin of contacts for unit motions
    ("nominal", float, (MOTIONS,)),  # commanded motion over the nominal speed
    ("command", float, (6,)),  # commanded rim speeds over the nominal speed
    ("spread", float, (6,)),  # distance of the two points of contact from their middle [m]
    ("mu", float, (6,)),  # friction coefficients within the friction share
    ("yields", np.int64, (6,)),  # 1 where a wheel is on yielding soil, 0 on Coulomb ground
    ("soil", float, (6, SOIL_NUMBERS)),  # this soil
    ("friction_share", float),  # share of the friction that may be used
    ("radius", float),  # wheel radius [m]
    ("width", float),  # wheel width [m]
    ("weight", float),  # weight of the rover [N]
    ("droop", float),  # share of the nominal speed that a servo loses at full torque
    ("full_traction", float),  # full torque over wheel radius and weight: where droop is `droop`
    ("max_traction", float),  # largest torque over wheel radius and weight
    ("creep", float),  # sliding velocity at which friction is 0.7 mu N, over the nominal speed
    ("z", float, (UNKNOWNS,)),  # loads, negative: speeds of lifting; motion of the rover
    ("trial", float, (UNKNOWNS,)),
    ("best", float, (UNKNOWNS,)),
    ("residual", float, (UNKNOWNS, 1)),
    ("step", float, (UNKNOWNS, 1)),
    ("J", float, (UNKNOWNS, UNKNOWNS)),  # derivatives of the residual by z
    ("force", float, (6, 3)),  # traction, lateral force, scrub force of each wheel
    ("force_rate", float, (6, 3, 4)),  # their derivatives, see servo_wheel
    ("softness", float),  # width of the transition from load to lifting; 0 in the solution
    ("load", float, (6,)),  # loads over the weight
    ("load_rate", float, (6,)),  # their derivatives by z
    ("pressing", float, (6,)),  # loads by which the ground gives friction: these loads, or held
    ("holds_loads", np.bool_),  # whether they are held
    ("rise", float, (6,)),  # speeds of lifting over the nominal speed; rise = load - z
    ("lifted", np.bool_),  # whether any wheel lifts
    ("slip", float, (6,)),  # sliding velocity along the wheel over the nominal speed
    ("rim_speed", float, (6,)),  # r omega over the nominal speed
    ("speed_share", float),  # share of the commanded motion that is made
    ("deviation", float, (MOTIONS,)),  # the motion less its share of the commanded one
    ("towed", float),  # speed share at which it is towed to find the deficit; 0: it is not
    ("deficit", float),  # force that is missing if the speed share is 0, negative: to brake
    ("stall", np.int64),  # what stops the rover if its speed share is 0: a Stall
)
"""Inputs, unknowns and results of `solve_servo`. Forces are over the rover's weight, velocities
over the nominal speed, turning rates in rad per TURN_DISTANCE of nominal distance."""


@kernel
def lean_on_rims(placement, contacts):
    """Let the normals of contacts on rims lean along the axle, with the normal of the ground.

    A rim is tangent to the ground, and has its normal, but on an edge, where the wheel's radius is
    the normal. It stays that of a wheel that meets a face: this stands on the ground below, too.
    """
    for wheel in range(6):
        contacts.lean[wheel] = 0.0
        slope_x, slope_y = contacts.slope[wheel, 0], contacts.slope[wheel, 1]
        across, s, c = contacts.across[wheel], contacts.sine[wheel], contacts.cosine[wheel]
        is_held = contacts.held_height[wheel] == contacts.held_height[wheel]
        is_face = slope_x * slope_x + slope_y * slope_y > STEEPEST * STEEPEST
        if across == 0.0 or contacts.inside[wheel] or is_held or is_face:
            continue
        axis, forward, up = placement.axis[wheel], placement.forward[wheel], placement.up[wheel]
        rise = slope_x * forward[0] + slope_y * forward[1]
        fall = up[2] - slope_x * up[0] - slope_y * up[1]
        upright = s * rise + c * fall
        along = axis[2] - slope_x * axis[0] - slope_y * axis[1]
        if abs(s * fall - c * rise) <= TANGENT * upright and along * across < 0.0:
            contacts.lean[wheel] = along / upright


@kernel
def find_motions(linkage, placement, contacts, balance, servo):
    """Write the motions and the equilibrium into a SERVO_STATE; return False if it is singular.

    Args:
        linkage: LINKAGE.
        placement: PLACEMENT.
        contacts: CONTACTS.
        balance: BALANCE with the equations of `write_equations`.
        servo: SERVO_STATE; `nominal` is read; X, base, velocity, command and spread are written.
    """
    X = servo.X
    _write_base(placement, TURN_DISTANCE * linkage.radius, servo)
    for row in range(UNKNOWNS):
        for wheel in range(6):
            servo.M[row, wheel] = balance.A[row, wheel]
        for k in range(MOTIONS):
            servo.M[row, 6 + k] = 0.0
        X[row, WEIGHTS] = balance.B[row, 0]
    for wheel in range(6):
        servo.spread[wheel] = _spread(linkage, placement, contacts, wheel)
        if servo.yields[wheel]:
            servo.spread[wheel] *= GAUSS_POINT
        for row in range(UNKNOWNS):
            X[row, wheel] = balance.units[wheel, 1, row]
            X[row, 6 + wheel] = balance.units[wheel, 2, row]
        _write_scrub(linkage, placement, balance.frames[wheel, 0], wheel, X)
    for wheel in range(6):
        for row in range(UNKNOWNS):
            X[row, SCRUB + wheel] *= servo.spread[wheel] / linkage.length
            for k in range(MOTIONS):
                servo.M[row, 6 + k] += (
                    servo.base[wheel, 0, k] * X[row, wheel]
                    + servo.base[wheel, 1, k] * X[row, 6 + wheel]
                )
    columns = SCRUB
    for wheel in range(6):
        if servo.spread[wheel] > 0.0:
            columns = COLUMNS
    if not solve_in_place(servo.M, X, UNKNOWNS, columns):
        return False
    _write_velocities(servo)
    return True


@kernel
def _write_base(placement, turn_distance, servo):
    """Write the level velocities of the wheels in unit motions, and the commanded rim speeds.

    A turning wheel rolls along its heading; one whose heading does not suit its motion slides. A
    unit turn is one radian per `turn_distance` [m].
    """
    R, origin = placement.R, placement.origin
    length = np.sqrt(R[0, 0] * R[0, 0] + R[1, 0] * R[1, 0])
    c, s = R[0, 0] / length, R[1, 0] / length
    for wheel in range(6):
        x = (placement.centres[wheel, 0] - origin[0]) / turn_distance
        y = (placement.centres[wheel, 1] - origin[1]) / turn_distance
        fx, fy = placement.forward[wheel, 0], placement.forward[wheel, 1]
        base = servo.base[wheel]
        base[0, 0], base[1, 0] = fx * c + fy * s, -fy * c + fx * s
        base[0, 1], base[1, 1] = -fx * s + fy * c, fy * s + fx * c
        base[0, 2], base[1, 2] = -fx * y + fy * x, fy * y + fx * x
        servo.command[wheel] = 0.0
        for k in range(MOTIONS):
            servo.command[wheel] += base[0, k] * servo.nominal[k]


@kernel
def _spread(linkage, placement, contacts, wheel):
    """Return the distance [m] of the ends of a contact line from its middle."""
    axis, slope = placement.axis[wheel], contacts.slope[wheel]
    rise = axis[2] - slope[0] * axis[0] - slope[1] * axis[1]
    tilt = abs(rise) / np.sqrt(1.0 + slope[0] * slope[0] + slope[1] * slope[1])
    return 0.5 * linkage.width * max(1.0 - tilt / FLUSH, 0.0)


@kernel
def _write_scrub(linkage, placement, normal, wheel, X):
    """Write the terms of the moment -1 about the contact normal (3,) of a wheel into X."""
    R, side, column = placement.R, wheel // 3, SCRUB + wheel
    for row in range(UNKNOWNS):
        X[row, column] = 0.0
    for i in range(3):
        X[3 + i, column] = -normal[i]
    about = -dot(normal, (R[0, 1], R[1, 1], R[2, 1]))
    X[8, column] = rocker_sign(side) * about
    if linkage.on_bogie[wheel]:
        X[6 + side, column] = about


@kernel
def _write_velocities(servo):
    """Write the velocities of the contacts in the motions that equal unit motions on level ground.

    The work of wheel i's forces on motion k of the inverse is in row 6 + k; a unit motion is the
    combination that has on the base forces the work of a level unit motion.
    """
    X, base, velocity = servo.X, servo.base, servo.velocity
    for motion in range(MOTIONS):
        for wheel in range(6):
            for kind in range(3):
                velocity[wheel, kind, motion] = 0.0
        for k in range(MOTIONS):
            work = level_work(base, k, motion)
            for wheel in range(6):
                velocity[wheel, 0, motion] += work * X[6 + k, wheel]
                velocity[wheel, 1, motion] += work * X[6 + k, 6 + wheel]
                velocity[wheel, 2, motion] += work * X[6 + k, SCRUB + wheel]


@kernel
def level_work(base, k, motion):
    """Return the work of base force k on a level unit motion."""
    work = 0.0
    for wheel in range(6):
        for i in range(2):
            work += base[wheel, i, k] * base[wheel, i, motion]
    return work
