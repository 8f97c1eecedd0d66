"""The smallest friction utilisation of any torques, by independent linear programs."""

import numpy as np
from scipy.optimize import linprog

from support.rover_geometry import balance_matrix

SIDES_OF_THE_CONE = 64
"""Sides of the pyramid that replaces a friction cone."""


def can_stand(rover, prediction, i, utilisation, max_torque) -> bool:
    """Return whether forces within the friction cones of `utilisation` balance waypoint i.

    The unknowns are N (6), T (6), s0, s1. Each cone is replaced by a circumscribed pyramid, so
    that an infeasible program proves that the cones are infeasible too.
    """
    A, b, along = balance_matrix(rover, prediction, i)
    turns = 2.0 * np.pi * np.arange(SIDES_OF_THE_CONE) / SIDES_OF_THE_CONE
    rows = []
    for wheel in range(6):
        mu = prediction.friction[i, wheel]
        for c, s in zip(np.cos(turns), np.sin(turns), strict=True):
            row = np.zeros(14)
            row[wheel], row[6 + wheel] = -utilisation * mu, c
            row[12], row[13] = s, s * along[wheel]
            rows.append(row)
    pull = max_torque / (rover.wheel.radius * rover.weight)
    bounds = [(0.0, None)] * 6 + [(-pull, pull)] * 6 + [(None, None)] * 2
    program = np.zeros(14), np.array(rows), np.zeros(len(rows)), A, b, bounds
    for method in ("highs", "highs-ipm", "highs-ds"):  # the others where one does not decide
        answer = linprog(*program, method=method)
        if answer.status in (0, 2):
            break
    assert answer.status in (0, 2), answer.message
    return answer.status == 0


def least_utilisation(rover, prediction, i, max_torque, most=20.0) -> float:
    """Return a lower bound, within 0.3 %, of the friction utilisation that waypoint i needs."""
    low, high = 0.0, most
    if not can_stand(rover, prediction, i, most, max_torque):
        return np.inf
    while high - low > 1e-3 * high + 1e-5:
        middle = 0.5 * (low + high)
        if can_stand(rover, prediction, i, middle, max_torque):
            high = middle
        else:
            low = middle
    return low
