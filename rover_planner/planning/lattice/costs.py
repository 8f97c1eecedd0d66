"""What a piece of path costs, in metres of level ground: time, energy and risk.

    cost = gear price x time x nominal speed
         + CLIMB x energy / weight
         + RISK x length x ((risk - SAFE) / (1 - SAFE))^2 where risk > SAFE

Energy over weight is the height [m] to which the energy would lift the rover. Risk is the used
share of the tightest safety limit on the piece, 1 at the limit.
"""

import math

from rover_physics.rover.model import Rover
from rover_physics.traversability.extremes import used_share
from rover_physics.traversability.pieces import PieceVerdict
from rover_planner.planning.lattice.primitives import Gear, Primitive

PRICES = {Gear.FORWARD: 1.0, Gear.BACKWARD: 1.5, Gear.ON_THE_SPOT: 1.5}
"""Price of time in each gear: sensors look ahead, and turning on the spot wears the wheels."""
CLIMB = 2.0
"""Metres of level ground that cost as much as the energy that lifts the rover by one metre."""
RISK = 2.0
"""Further cost of a metre at the limit, in metres of level ground."""
SAFE = 0.5
"""Used share of a limit up to which there is no risk."""


def least_cost(primitive: Primitive) -> float:
    """Return the cost [m] of a primitive on level ground, a bound from below on any ground."""
    return PRICES[primitive.gear] * primitive.length


def true_cost(rover: Rover, gear: Gear, piece: PieceVerdict) -> float:
    """Return the cost [m] of a piece of path, infinite if it fails."""
    if piece.code:
        return math.inf
    driven = piece.time * rover.nominal_speed
    excess = max(0.0, used_share(rover, piece.extremes) - SAFE) / (1.0 - SAFE)
    cost = PRICES[gear] * driven + CLIMB * max(0.0, piece.energy) / rover.weight
    return cost + RISK * driven * min(excess, 1.0) ** 2
