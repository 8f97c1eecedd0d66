# SPDX-License-Identifier: Apache-2.0
"""Search of the part of a wheel's rim that lies in one cell; lengths are in cells."""

import numpy as np

from rover_physics.contact.intrusion import take_rim_point
from rover_physics.numerics.kernels import kernel

LEVEL = 1e-9
"""Part of an edge along a direction [cells] below which it is across that direction."""
LEAST_Q = 0.01
"""Least height below the axle [radii]."""
FIRST = 0.95
"""Largest share of the radius at which the search begins."""
RIM_STEPS = 4
"""Largest number of places that the search looks at."""
FOUND = 1e-4
"""Turn [rad] at which the search stops."""
MISSED = 0.1
"""Turn [rad] by which a straight line may miss a cell that the bent rim crosses."""
BEYOND = 1e-4
"""Distance from the cell [cells] up to which a place counts as in it."""
LEAST_CHANGE = 0.3
"""Lower bound of the derivative in that search, where the ground bends almost like the wheel."""


@kernel
def look_along_rim(search, rim, corner, heading, shape):
    """Search the part of a rim, -1 right or 1 left, that lies in a cell.

    Newton's method turns the place on the rim: on a plane, one step finds it, however steep it is.
    A cambered rim is bent as seen from above: for its way out of the cell it is taken as straight
    at the last place.

    Args:
        search: CELL_SEARCH.
        rim: The rim.
        corner: s and t of a corner of the cell.
        heading: The heading along its sides u and v, which begin at the corner, u right of v.
        shape: (a, b, c, d) of the intrusion a + b u + c v + d u v, without the wheel's dome.
    """
    R, sine, inverse = search.radius, search.sine, 1.0 / search.cosine
    s0, t0 = corner
    ex, ey = heading
    a, b, c, d = shape
    s, turn = min(max(s0 + 0.5 * (ex + ey), -FIRST * R), FIRST * R), 0.0
    q = np.sqrt(R * R - s * s)
    for step in range(RIM_STEPS):
        aside = rim * search.half_width + sine * q - t0
        u, v = (s - s0) * ex - aside * ey, (s - s0) * ey + aside * ex
        along_u, along_v = b + d * v, c + d * u
        ahead, up = along_u * ex + along_v * ey, sine * (along_v * ex - along_u * ey) + inverse
        intrusion = a + b * u + c * v + d * u * v + q * inverse
        if step == 0:
            low, high = s0 + min(ex, 0.0) + min(ey, 0.0), s0 + max(ex, 0.0) + max(ey, 0.0)
            most = intrusion + _gain_on_rim(R, (s, q), (ahead, up), (max(low, -R), min(high, R)))
            bend = abs(d) * (0.5 + abs(u - 0.5)) * (0.5 + abs(v - 0.5))
            if most + bend <= search.best_on_rim:
                return
        elif abs(u - 0.5) < 0.5 + BEYOND and abs(v - 0.5) < 0.5 + BEYOND:
            take_rim_point(search, rim, s, intrusion)
            if abs(turn) < FOUND:
                return
        du, dv = q * ex + sine * s * ey, q * ey - sine * s * ex
        low, high = _part_in_cell((u, v), (away_from_zero(du), away_from_zero(dv)))
        if not low < high + MISSED:
            return
        rate, fall = ahead * q - up * s, ahead * s + up * q
        turn = high if rate > 0.0 else low
        if fall > 0.0:
            bend = d * (q * (dv * ex + du * ey) - s * sine * (du * ex - dv * ey))
            turn = min(max(rate / max(fall - bend, LEAST_CHANGE * fall), low), high)
        s, q = s + turn * q, max(q - turn * s, LEAST_Q * R)
        longer = R / np.sqrt(s * s + q * q)
        s, q = s * longer, q * longer


@kernel
def _gain_on_rim(R, place, slopes, span):
    """Return the largest gain of the intrusion over that at a place (s, q) of a rim on a plane.

    It is looked for at `span`, the least and largest s; `slopes` are the rates by s and q.
    """
    (s, q), (ahead, up), (low, high) = place, slopes, span
    if not up > 0.0:
        return np.inf
    at = min(max(R * ahead / np.sqrt(ahead * ahead + up * up), low), high)
    return ahead * (at - s) + up * (np.sqrt(max(R * R - at * at, 0.0)) - q)


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
