# SPDX-License-Identifier: Apache-2.0
"""What a piece of path costs, in metres of level ground: time, energy and risk.

    cost = gear price x time x nominal speed
         + CLIMB x energy / weight
         + RISK x exposure x nominal speed

Energy over weight is the height [m] to which the energy would lift the rover. The exposure [s] is
the time at the limits: each moment counts by the square of ((used share of the tightest safety
limit) - 1/2) x 2, which is 0 up to half of a limit and 1 at it.
"""

import math

from rover_physics.rover.model import Rover
from rover_physics.traversability.pieces import PieceVerdict
from rover_planner.planning.lattice.primitives import Gear, Primitive

PRICES = {Gear.FORWARD: 1.0, Gear.BACKWARD: 1.5, Gear.ON_THE_SPOT: 1.5}
"""Price of time in each gear: sensors look ahead, and turning on the spot wears the wheels."""
CLIMB = 2.0
"""Metres of level ground that cost as much as the energy that lifts the rover by one metre."""
RISK = 2.0
"""Further cost of a metre at the limit, in metres of level ground."""


def least_cost(primitive: Primitive) -> float:
    """Return the cost [m] of a primitive on level ground, a bound from below on any ground."""
    return PRICES[primitive.gear] * primitive.length


def true_cost(rover: Rover, gear: Gear, piece: PieceVerdict) -> float:
    """Return the cost [m] of a piece of path, infinite if it fails."""
    if piece.code:
        return math.inf
    speed, climb = rover.nominal_speed, max(0.0, piece.energy) / rover.weight
    return PRICES[gear] * piece.time * speed + CLIMB * climb + RISK * piece.exposure * speed
