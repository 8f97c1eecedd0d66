# SPDX-License-Identifier: Apache-2.0
"""Independent linear programs in the forces on the wheels, with pyramids for friction cones."""

import numpy as np
import scipy  # loads `optimize` where it is used: no worker of the tests waits for it

from support.rover_geometry import balance_matrix

SIDES = 96
"""Sides of the pyramid that replaces a friction cone."""
INSIDE = float(np.cos(np.pi / SIDES))
"""Share of the friction at which a pyramid lies inside the cone; at 1 it is around the cone."""


def solve_forces(rover, prediction, i, cost, max_torque, friction_share=1.0, shared=True):
    """Minimise cost (12,) @ (N, T) over the forces that balance waypoint i; return the answer.

    Forces are in units of the weight. The unknowns are N (6), T (6) and the lateral forces, which
    are s0 + s1 along the rover where `shared`, else each wheel has its own. A share of the
    friction may be used. On soil, strength and resistance are in proportion to the load.
    """
    A, b, sideways = balance_matrix(rover, prediction, i, shared)
    turns = 2.0 * np.pi * np.arange(SIDES) / SIDES
    rows = np.zeros((6, SIDES, A.shape[1]))
    resistance = prediction.motion_resistance[i] / prediction.wheel_loads[i]
    strength = friction_share * (prediction.friction[i] + resistance)
    back = friction_share * np.sign(prediction.wheel_speed[i]) * resistance
    for wheel in range(6):
        rows[wheel, :, wheel] = np.cos(turns) * back[wheel] - strength[wheel]
        rows[wheel, :, 6 + wheel] = np.cos(turns)
        rows[wheel, :, 12:] = np.outer(np.sin(turns), sideways[wheel])
    rows = rows.reshape(-1, A.shape[1])
    pull = max_torque / (rover.wheel.radius * rover.weight)
    lateral = [(None, None)] * sideways.shape[1]
    bounds = [(0.0, None)] * 6 + [(-pull, pull)] * 6 + lateral
    program = np.append(cost, np.zeros(len(lateral))), rows, np.zeros(len(rows)), A, b, bounds
    for method in ("highs", "highs-ipm", "highs-ds"):  # the others where one does not decide
        answer = scipy.optimize.linprog(*program, method=method)
        if answer.status in (0, 2):
            break
    assert answer.status in (0, 2), answer.message
    return answer


def can_stand(rover, prediction, i, utilisation, max_torque) -> bool:
    """Return whether forces within the friction cones of `utilisation` balance waypoint i.

    The pyramids are around the cones: where they are infeasible, so are the cones.
    """
    answer = solve_forces(rover, prediction, i, np.zeros(12), max_torque, utilisation)
    return answer.status == 0
