# SPDX-License-Identifier: Apache-2.0
"""Work space of policy "servo": wheels on speed servos, and the rover's motion that follows."""

from enum import IntEnum

import numpy as np

from rover_physics.numerics.records import record_type
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

SERVO = record_type(
    ("X", float, (UNKNOWNS, COLUMNS)),  # loads and missing forces per unit of wheel force
    ("M", float, (UNKNOWNS, UNKNOWNS)),  # work space: loads and base forces in the equilibrium
    ("base", float, (6, 2, MOTIONS)),  # level velocity of wheels along and across for unit motions
    (
        "velocity",
        float,
        (6, 3, MOTIONS),
    ),  # along, across and spin of the contacts for unit motions
    ("nominal", float, (MOTIONS,)),  # commanded motion over the nominal speed
    ("command", float, (6,)),  # commanded rim speeds over the nominal speed
    (
        "spread",
        float,
        (6,),
    ),  # distance of the Gauss points from the middle of the contact line [m]
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
    ("rise", float, (6,)),  # speeds of lifting over the nominal speed; rise = load - z
    ("lifted", np.bool_),  # whether any wheel lifts
    ("slip", float, (6,)),  # sliding velocity along the wheel over the nominal speed
    ("rim_speed", float, (6,)),  # r omega over the nominal speed
    ("speed_share", float),  # share of the commanded motion that is made
    ("deviation", float, (MOTIONS,)),  # the motion less its share of the commanded one
    ("balance", np.int64),  # a ServoBalance
)
"""Inputs, unknowns and results of `solve_servo`. Forces are over the rover's weight, velocities
over the nominal speed, turning rates in 1 / m: rad per metre of nominal way."""


class ServoBalance(IntEnum):
    """Result of `solve_servo`."""

    DRIVES = 0
    """The rover moves on."""
    SLIDES = 1
    """No forward speed balances: friction does not hold."""
    STALLS = 2
    """No forward speed balances: the torques do not suffice."""
