# SPDX-License-Identifier: Apache-2.0
"""Bounds on the belly clearance above ground whose heights are known within bounds."""

import numpy as np

from rover_physics.contact.clearance import POINTS, point_of_underside
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_algebra import cross, dot
from rover_physics.rover.linkage import pitch_axis
from rover_physics.terrain.ground import elevation_of, height_at_cell, look_up, to_cells


@kernel
def bound_clearance(uncertain, work, bounds):
    """Write the smallest and largest possible clearance [m] into bounds (2,); NaN if unknown.

    Above a cell, the underside is lowest if each wheel is at that end of its interval that lowers
    the underside there. Largest values of the second-order terms of the rotation, and of the shift
    of the outline by it, are added.

    Args:
        uncertain: UNCERTAIN.
        work: BOUNDS_WORK with `spread`, and the rover placed at its nominal configuration.
        bounds: (2,), written.
    """
    ground, belly = uncertain.nominal.ground, uncertain.nominal.linkage.belly
    placement, spread = work.rover.placement, work.spread
    R, origin = placement.R, placement.origin
    bounds[0] = bounds[1] = np.nan
    if not R[2, 2] > 0.0:
        return
    turn = max(spread.q_high[1] - spread.q[1], spread.q[1] - spread.q_low[1])
    turn += max(spread.q_high[2] - spread.q[2], spread.q[2] - spread.q_low[2])
    half = 0.5 * np.hypot(belly[2] - belly[1], belly[4] - belly[3])
    radius = np.hypot(half + max(abs(belly[1] + belly[2]), abs(belly[3] + belly[4])), belly[0])
    shift = turn * (abs(belly[0]) + radius * (np.hypot(R[0, 2], R[1, 2]) + turn))
    bend = turn * turn * radius
    slope_x, slope_y = -R[0, 2] / R[2, 2], -R[1, 2] / R[2, 2]
    cell = 1.0 / ground.inverse_resolution
    extent = np.hypot(half + radius, belly[0]) + shift
    first_j = max(int(np.ceil((origin[0] - extent - ground.x0) / cell)), 0)
    last_j = min(int(np.floor((origin[0] + extent - ground.x0) / cell)), ground.columns - 1)
    first_i = max(int(np.ceil((origin[1] - extent - ground.y0) / cell)), 0)
    last_i = min(int(np.floor((origin[1] + extent - ground.y0) / cell)), ground.rows - 1)
    least, most = np.inf, np.inf
    for i in range(first_i, last_i + 1):
        dy = ground.y0 + i * cell - origin[1]
        for j in range(first_j, last_j + 1):
            dx = ground.x0 + j * cell - origin[0]
            z = belly[0] / R[2, 2] + slope_x * dx + slope_y * dy
            along = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * z
            across = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * z
            inside = min(along - belly[1], belly[2] - along, across - belly[3], belly[4] - across)
            height = elevation_of(ground, i, j)
            if inside < -shift or height != height:
                continue
            above = origin[2] + z - height
            lowered, raised = _plane_change(R, spread, dx, dy, z)
            wrong = elevation_of(uncertain.error, i, j)
            least = min(least, above - wrong + lowered - bend)
            if inside >= shift:
                most = min(most, above + wrong + raised + bend)
    if most == np.inf:
        least, most = _bound_points(uncertain, work, shift, bend, least)
    if least < np.inf:
        bounds[0], bounds[1] = least, most


@kernel
def _bound_points(uncertain, work, shift, bend, least):
    """Return the bounds on the clearance at POINTS [m]; the lower one is at most `least`.

    It is for outlines without a known cell, where `belly_clearance` uses these points.
    """
    ground, belly = uncertain.nominal.ground, uncertain.nominal.linkage.belly
    R, origin = work.rover.placement.R, work.rover.placement.origin
    most = np.inf
    for k in range(POINTS):
        x, y, z = point_of_underside(R, origin, belly, k)
        height, slope_x, slope_y = look_up(ground, x, y)
        if height != height:
            continue
        gx, gy = to_cells(ground, x, y)
        wrong = height_at_cell(uncertain.error, gx, gy) + bend
        wrong = wrong + shift * (abs(slope_x) + abs(slope_y))
        lowered, raised = _plane_change(
            R, work.spread, x - origin[0], y - origin[1], z - origin[2]
        )
        least = min(least, z - height + lowered - wrong)
        most = min(most, z - height + raised + wrong)
    return least, most


@kernel
def _plane_change(R, spread, dx, dy, z):
    """Return largest fall and rise [m] of the underside's plane at (dx, dy, z) from the origin.

    A rotation by d about an axis a moves the plane's point p by (a x p) d. The rise of the plane
    above a fixed place is the component of this along the plane's normal, over the normal's z.
    """
    place, normal = (dx, dy, z), (R[0, 2] / R[2, 2], R[1, 2] / R[2, 2], 1.0)
    by_roll = dot(normal, cross((R[0, 0], R[1, 0], R[2, 0]), place))
    by_pitch = dot(normal, cross(pitch_axis(R), place))
    lowered, raised = 0.0, 0.0
    for wheel in range(6):
        rate = spread.response[0, wheel]
        rate += by_roll * spread.response[1, wheel] + by_pitch * spread.response[2, wheel]
        low, high = rate * spread.low[wheel], rate * spread.high[wheel]
        lowered += min(low, high)
        raised += max(low, high)
    return lowered, raised
