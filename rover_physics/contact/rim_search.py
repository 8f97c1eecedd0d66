# SPDX-License-Identifier: Apache-2.0
"""Search of the part of a wheel's rim that lies in one cell; lengths are in cells."""

import numpy as np

from rover_physics.contact.intrusion import ROUNDING, take_rim_point
from rover_physics.numerics.kernels import kernel

LEVEL = 1e-9
"""Part of an edge along a direction [cells] below which it is across that direction."""
STEEPEST = 0.9999
"""Share of the radius up to which the wheel's slope is finite enough for Newton's method."""
FIRST = 0.8
"""Largest share of the radius at which the search begins."""
RIM_STEPS = 3
"""Steps of the search: the first bounds it, the others are of Newton's method."""


@kernel
def look_along_rim(search, rim, corner, heading, shape):
    """Search the part of a rim, -1 right or 1 left, that lies in a cell.

    A cambered rim is bent as seen from above. It is taken as straight at the best place so far.

    Args:
        search: CELL_SEARCH.
        rim: The rim.
        corner: s and t of a corner of the cell.
        heading: The heading along its sides u and v, which begin at the corner, u right of v.
        shape: (a, b, c, d) of the intrusion a + b u + c v + d u v, without the wheel's dome.
    """
    R, curl = search.radius, search.curl
    s0, t0 = corner
    ex, ey = heading
    a, b, c, d = shape
    s = min(max(s0 + 0.5 * (ex + ey), -FIRST * R), FIRST * R)
    bent = 2.0 * curl * abs(search.sine) * (abs(b) + abs(c))
    for step in range(RIM_STEPS):
        q = np.sqrt(R * R - s * s)
        turn, aside = -search.sine * s / q, rim * search.half_width + search.sine * q - t0
        u, v = (s - s0) * ex - aside * ey, (s - s0) * ey + aside * ex
        du, dv = ex - turn * ey, ey + turn * ex
        base, slope = a + b * u + c * v + d * u * v, b * du + c * dv + d * (u * dv + v * du)
        if step > 0 and abs(u - 0.5) < 0.5 + ROUNDING and abs(v - 0.5) < 0.5 + ROUNDING:
            take_rim_point(search, rim, s, base)
        low, high = _part_in_cell((u, v), (away_from_zero(du), away_from_zero(dv)))
        low, high = max(low, -STEEPEST * R - s), min(high, STEEPEST * R - s)
        if not low < high:
            return
        rest = -2.0 * d * du * dv
        if step > 0:
            slope -= s / (q * search.cosine)
            rest += R * R / (q * q * q * search.cosine)
        else:
            slope -= 2.0 * curl * s
            rest += 2.0 * curl
        at = high if slope - 0.5 * rest * (low + high) > 0.0 else low
        if rest > 0.0:
            at = min(max(slope / rest, low), high)
        if step == 0:
            most = base + 2.0 * curl * R * R - curl * s * s + (slope - 0.5 * rest * at) * at
            if most + bent <= search.best_on_rim:
                return
        s += at


@kernel
def _part_in_cell(place, direction):
    """Return the distances along a direction from (u, v) between which a line is in a cell."""
    (u, v), (du, dv) = place, direction
    one, other, right, left = -u / du, (1.0 - u) / du, -v / dv, (1.0 - v) / dv
    return max(min(one, other), min(right, left)), min(max(one, other), max(right, left))


@kernel
def away_from_zero(part):
    """Return part of a direction, at least so large that its inverse times a place is finite."""
    return part if abs(part) > LEVEL else LEVEL
