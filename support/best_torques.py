# SPDX-License-Identifier: Apache-2.0
"""Decides by independent linear programs if any torques keep to a friction utilisation."""

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
    rows = np.zeros((6, SIDES_OF_THE_CONE, 14))
    for wheel in range(6):
        rows[wheel, :, wheel] = -utilisation * prediction.friction[i, wheel]
        rows[wheel, :, 6 + wheel] = np.cos(turns)
        rows[wheel, :, 12:] = np.sin(turns)[:, None] * [1.0, along[wheel]]
    rows = rows.reshape(-1, 14)
    pull = max_torque / (rover.wheel.radius * rover.weight)
    bounds = [(0.0, None)] * 6 + [(-pull, pull)] * 6 + [(None, None)] * 2
    program = np.zeros(14), rows, np.zeros(len(rows)), A, b, bounds
    for method in ("highs", "highs-ipm", "highs-ds"):  # the others where one does not decide
        answer = linprog(*program, method=method)
        if answer.status in (0, 2):
            break
    assert answer.status in (0, 2), answer.message
    return answer.status == 0
