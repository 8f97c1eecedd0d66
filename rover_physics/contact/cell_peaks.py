# SPDX-License-Identifier: Apache-2.0
"""Intrusion of the ground into a wheel: begin of a search, and its peaks in a cell.

Lengths are in cells here. A point of the ground is at s along the wheel's heading and t to the
left of its centre. The lower side of the cylinder is the surface tan(camber) t - sqrt(R^2 - s^2) /
cos(camber) above the centre. Its distance below the ground is the intrusion. It peaks on a rim, or
inside a twisted cell.
"""

import numpy as np

from rover_physics.contact.contact_record import NOTICED
from rover_physics.numerics.kernels import kernel
from rover_physics.terrain.ground import to_cells

ROUNDING = 1e-9
"""Bound of rounding errors of places and intrusions [cells]."""
LEVEL = 1e-9
"""Part of an edge along a direction [cells] below which it is across that direction."""
LEAST_Q = 0.01
"""Least height below the axle [radii]."""
FIRST = 0.95
"""Largest share of the radius at which a search begins."""
RIM_STEPS = 4
"""Largest number of places of a rim that this search looks at."""
FOUND = 1e-4
"""Turn [rad] at which it stops."""
MISSED = 0.1
"""Turn [rad] by which a straight line may miss a cell that the bent rim crosses."""
BEYOND = 1e-4
"""Distance from the cell [cells] up to which a place counts as in it."""
INTERIOR_STEPS, FLAT_RATE = 8, 3e-3
"""Largest number of steps of the search inside a cell, and change of the intrusion along the
heading at which it stops."""
LEAST_CHANGE = 0.3
"""Lower bound of the derivative in both searches, where the ground bends almost like the wheel."""


@kernel
def begin_search(model, work, wheel):
    """Write what the search needs of the wheel's place into `work.cells`."""
    ground, samples, placement = model.ground, model.samples, work.placement
    search, centres = work.cells, placement.centres
    scale = ground.inverse_resolution
    search.cell = 1.0 / scale
    search.radius = samples.radius * scale
    search.x, search.y = to_cells(ground, centres[wheel, 0], centres[wheel, 1])
    search.z = centres[wheel, 2]
    search.ahead_x, search.ahead_y = placement.forward[wheel, 0], placement.forward[wheel, 1]
    search.cosine, search.sine = placement.up[wheel, 2], placement.axis[wheel, 2]
    search.tangent = search.sine / search.cosine
    search.half_width = samples.half_width * scale * search.cosine
    lean = search.sine * search.radius
    search.right = min(lean, 0.0) - search.half_width
    search.left = max(lean, 0.0) + search.half_width
    search.found = search.rim = 0
    search.curl = 0.5 / (search.radius * search.cosine)
    search.best = -work.contacts.gap[wheel] * scale + NOTICED * search.radius
    search.best_on_rim = search.best


@kernel
def is_below(search, s, t):
    """Return whether the point (s, t) is below the wheel; |s| must be below R."""
    lean = search.sine * np.sqrt(search.radius * search.radius - s * s)
    return abs(t - lean) <= search.half_width


@kernel
def is_beside(search, low, high):
    """Return whether all that is at places `low` <= t <= `high` is beside the wheel for sure."""
    return low > search.left + ROUNDING or high < search.right - ROUNDING


@kernel
def take_point(search, s, t, base):
    """Keep a point between the rims if it is the best of them so far.

    `base` is its intrusion without the wheel's dome.
    """
    dome = np.sqrt(max(search.radius * search.radius - s * s, 0.0)) / search.cosine
    if base + dome > search.best:
        search.best, search.best_s, search.best_t, search.found = base + dome, s, t, 1
        if search.best > search.best_on_rim:
            search.best_on_rim, search.rim = search.best, 0


@kernel
def take_rim_point(search, rim, s, intrusion):
    """Keep a point of a rim, -1 right or 1 left, if it is the best of all so far."""
    if intrusion > search.best_on_rim + ROUNDING:
        search.best_on_rim, search.rim_s, search.rim = intrusion, s, rim


@kernel
def look_into_cell(search, corner, heading, shape):
    """Search a twisted cell for a peak of the intrusion in its inside.

    Across the wheel the ground bends down, so for each s there is a best t in closed form. What is
    left is a quadratic function of s plus the wheel's dome. Arguments are as for `look_along_rim`.
    """
    (s0, t0), (ex, ey), (a, b, c, d) = corner, heading, shape
    R, cosine, half = search.radius, search.cosine, 0.5 / (d * ex * ey)
    slope_t, skew, gain = c * ex - b * ey, d * (ex * ex - ey * ey), d * d * half * cosine
    level, rate = a + 0.5 * slope_t * slope_t * half, b * ex + c * ey + slope_t * skew * half
    rise = rate * cosine - gain * s0
    low, high = s0 + min(ex, 0.0) + min(ey, 0.0), s0 + max(ex, 0.0) + max(ey, 0.0)
    low, high = max(low, -FIRST * R), min(high, FIRST * R)
    # There u = (s - s0 - place) / (2 ex) and v = (s - s0 + place) / (2 ey), from 0 to 1.
    place = slope_t / d
    low = max(low, s0 + max(place + min(2.0 * ex, 0.0), min(2.0 * ey, 0.0) - place))
    high = min(high, s0 + min(place + max(2.0 * ex, 0.0), max(2.0 * ey, 0.0) - place))
    if not low <= high:
        return
    starts = 0.5 * (low + high), np.nan
    if gain * R > 1.0:  # The wheel bends less than the ground: peaks are on its steep sides.
        starts = low, high
    else:  # It bends at least as at its bottom.
        at = min(max(rise / (1.0 / R - gain), low), high)
        along = at - s0
        most = (level + rate * along) * cosine + 0.5 * gain * along * along + R - 0.5 * at * at / R
        if most <= search.best * cosine:
            return
    for start in starts:
        if not abs(start) < R:
            break
        # The unknown is the wheel's slope s / q, which makes steep contacts well-behaved.
        s, slope = start, start / np.sqrt(R * R - start * start)
        for _ in range(INTERIOR_STEPS):
            inverse_length = 1.0 / np.sqrt(1.0 + slope * slope)
            s = R * slope * inverse_length
            error = rise + gain * s - slope
            if abs(error) < FLAT_RATE:
                break
            change = 1.0 - gain * R * inverse_length * inverse_length * inverse_length
            slope += error / max(change, LEAST_CHANGE)
        aside = (slope_t + skew * (s - s0)) * half
        u, v = ex * (s - s0) - ey * aside, ey * (s - s0) + ex * aside
        if min(u, v) >= 0.0 and max(u, v) <= 1.0 and is_below(search, s, t0 + aside):
            take_point(search, s, t0 + aside, a + b * u + c * v + d * u * v)


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
    low, high = s0 + min(ex, 0.0) + min(ey, 0.0), s0 + max(ex, 0.0) + max(ey, 0.0)
    low, high = max(low, -R), min(high, R)
    s, turn = min(max(0.5 * (low + high), -FIRST * R), FIRST * R), 0.0
    q = np.sqrt(R * R - s * s)
    for step in range(RIM_STEPS):
        aside = rim * search.half_width + sine * q - t0
        u, v = (s - s0) * ex - aside * ey, (s - s0) * ey + aside * ex
        along_u, along_v = b + d * v, c + d * u
        ahead, up = along_u * ex + along_v * ey, sine * (along_v * ex - along_u * ey) + inverse
        intrusion = a + b * u + c * v + d * u * v + q * inverse
        if step == 0:
            most = intrusion + _gain_on_rim(R, (s, q), (ahead, up), (low, high))
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
