# SPDX-License-Identifier: Apache-2.0
"""Search for the highest ground under the whole width of a wheel.

The wheel is nowhere below a parabola along its heading, and a cell bends above its corners by no
more than an eighth of that. So a cell whose highest corner is too low is left out unseen, and a
cell or edge is searched from its nearest corner only: where the ground is straight, along an edge,
the largest intrusion has a closed form; within a cell it can be larger if the ground is twisted,
or where a rim cuts the cell. `cell_peaks.py` explains the terms; lengths are in cells.
"""

import numpy as np
from numba import int64

from rover_physics.contact.cell_peaks import (
    LEVEL,
    ROUNDING,
    away_from_zero,
    begin_search,
    is_below,
    is_beside,
    look_along_rim,
    look_into_cell,
    take_point,
)
from rover_physics.contact.contact_record import NOTICED
from rover_physics.contact.tracking import keep_contact, search_circle, take_circle
from rover_physics.numerics.kernels import kernel
from rover_physics.status import PoseStatus
from rover_physics.terrain.ground import elevation_of

BEND = 0.126
"""Intrusion in a cell above that of its corners, over the curvature of the wheel's parabola: 1/8,
with a margin for rounding."""
STEEP = 0.95
"""Share of the radius from which on the wheel's parabola bounds the intrusion, not its circle."""
LEAST_UPRIGHT = 0.1
"""Cosine of the camber below which a wheel lies on its side and is not searched."""


@kernel
def look_everywhere(model, work, wheel, tops):
    """Replace the contact of a wheel by that with the highest ground below it, if that is higher.

    Args:
        model: A record with `ground` GROUND and `samples` WHEEL_SAMPLES.
        work: A record with `placement` PLACEMENT, `contacts` CONTACTS with the contact so far, and
            `cells` CELL_SEARCH, work space.
        wheel: Index of the wheel.
        tops: Highest ground [m] below the rear half and below the front half; infinite if unknown.

    Returns:
        UNKNOWN_GROUND if ground below the wheel is unknown, else SETTLED.
    """
    contacts, search = work.contacts, work.cells
    if not work.placement.up[wheel, 2] > LEAST_UPRIGHT:
        return PoseStatus.SETTLED
    begin_search(model, work, wheel)
    status = _look_at_vertices(model.ground, search, tops)
    if search.found:
        keep_contact(contacts, wheel)
        _take_peak(model.ground, search, contacts, wheel)
    noticed = NOTICED * search.radius if search.found else 0.0
    if search.rim != 0 and search.best_on_rim > search.best + noticed:
        keep_contact(contacts, wheel)
        _take_rim(model, work, wheel)
    return status


@kernel
def _take_peak(ground, search, contacts, wheel):
    """Take the best point between the rims as the contact."""
    s, t, radius, cell = search.best_s, search.best_t, search.radius, search.cell
    q = np.sqrt(max(radius * radius - s * s, 0.0))
    contacts.gap[wheel], contacts.inside[wheel] = -search.best * cell, 1
    contacts.across[wheel] = (t / search.cosine - search.tangent * q) * cell
    contacts.sine[wheel], contacts.cosine[wheel] = s / radius, q / radius
    peak = contacts.peak[wheel]
    peak[0] = (search.x + s * search.ahead_x - t * search.ahead_y) * cell + ground.x0
    peak[1] = (search.y + s * search.ahead_y + t * search.ahead_x) * cell + ground.y0
    peak[2] = search.z + (search.best + search.tangent * t - q / search.cosine) * cell


@kernel
def _take_rim(model, work, wheel):
    """Take the best point of the rims as the contact, after a search of the rim from there on."""
    contacts, search = work.contacts, work.cells
    contacts.across[wheel] = search.rim * model.samples.half_width
    sine = search.rim_s / search.radius
    turn = sine, np.sqrt(1.0 - sine * sine)
    circle = wheel, contacts.across[wheel]
    take_circle(contacts, wheel, search_circle(model, work, circle, turn, np.inf))


@kernel
def _look_at_vertices(ground, search, tops):
    """Look at all vertices of cells that may come near, and around those that do."""
    ex, ey, R = search.ahead_x, search.ahead_y, search.radius
    cosine, tangent, scale = search.cosine, search.tangent, ground.inverse_resolution
    top = R / cosine + 2.0 * BEND * search.curl
    curl = search.curl
    lean = search.sine * R
    low_t = -search.half_width + min(lean, 0.0)
    high_t = search.half_width + max(lean, 0.0)
    rear, front = tops
    tilt = abs(tangent) * (max(high_t, -low_t) + 1.0)
    low_s = -_find_extent(search, rear, tilt, scale)
    high_s = _find_extent(search, front, tilt, scale)
    if not low_s < high_s:
        return PoseStatus.SETTLED
    # A cell more on all sides: cells extend beyond the footprint.
    more = abs(ex) + abs(ey)
    low_s, high_s, low_t, high_t = low_s - more, high_s + more, low_t - more, high_t + more
    high_y = max(low_s * ey, high_s * ey) + max(low_t * ex, high_t * ex)
    low_y = min(low_s * ey, high_s * ey) + min(low_t * ex, high_t * ex)
    status = PoseStatus.SETTLED
    first = max(int64(np.ceil(search.y + low_y)), 0)
    last = min(int64(np.floor(search.y + high_y)), ground.rows - 1)
    slant_x, slant_y = 1.0 / away_from_zero(ex), 1.0 / away_from_zero(ey)
    x, y, z = search.x, search.y, search.z
    for i in range(first, last + 1):
        dy = i - y
        one, other = (low_s - dy * ey) * slant_x, (high_s - dy * ey) * slant_x
        right, left = (dy * ex - low_t) * slant_y, (dy * ex - high_t) * slant_y
        start = max(int64(np.ceil(x + max(min(one, other), min(right, left)))), 0)
        end = min(int64(np.floor(x + min(max(one, other), max(right, left)))), ground.columns - 1)
        for j in range(start, end + 1):
            dx = j - x
            s, t = dx * ex + dy * ey, dy * ex - dx * ey
            base = (elevation_of(ground, i, j) - z) * scale - tangent * t
            if base + (top - curl * s * s) > search.best:
                _look_around(ground, search, (i, j), (s, t, base))
            elif base != base and abs(s) < R and is_below(search, s, t):
                status = PoseStatus.UNKNOWN_GROUND
    return status


@kernel
def _find_extent(search, top, tilt, scale):
    """Return the largest s at which ground of height `top` [m] may touch the wheel."""
    if not top < np.inf:
        return search.radius
    least = (search.best - (top - search.z) * scale - tilt) * search.cosine
    if least >= search.radius:
        return 0.0
    return np.sqrt(search.radius**2 - max(least, 0.0) ** 2)


@kernel
def _look_around(ground, search, vertex, there):
    """Search a vertex (i, j), and the edges and cells around it of which it is the nearest corner.

    `there` is s, t and the intrusion of the vertex without the wheel's dome.
    """
    i, j = vertex
    s, t, base = there
    R, curl, tangent = search.radius, search.curl, search.tangent
    q = np.sqrt(max(R * R - s * s, 0.0))
    most, fall = base + 2.0 * curl * R * R - curl * s * s, 2.0 * curl * s
    if abs(s) < STEEP * R:
        most, fall = base + q / search.cosine, s / (q * search.cosine)
    if q > 0.0 and is_below(search, s, t):
        take_point(search, s, t, base)
    here = elevation_of(ground, i, j)
    # The sides of a cell: u along (di, dj) and v to its left; the heading along them.
    di, dj, ex, ey = 0, 1, search.ahead_x, search.ahead_y
    rise = _rise_to(ground, here, i, j + 1)
    for _ in range(4):
        beside = _rise_to(ground, here, i + dj, j - di)
        twist = _rise_to(ground, here, i + di + dj, j + dj - di) - rise - beside
        b, c = rise + tangent * ey, beside - tangent * ex
        if b <= curl * ex * (2.0 * s + ex) + ROUNDING:
            gain = _bound_side(b - fall * ex, curl * ex * ex)
            if most + gain > search.best and not is_beside(
                search, t - max(ey, 0.0), t - min(ey, 0.0)
            ):
                look_along_edge(search, (s, t, base), (ex, -ey, b))
            if (
                c <= curl * ey * (2.0 * s + ey) + ROUNDING
                and b + c + twist <= curl * (ex + ey) * (2.0 * s + ex + ey) + ROUNDING
                and most + _bound_cell(curl, (ex, ey), (b - fall * ex, c - fall * ey, twist))
                > search.best
            ):
                _look_at_cell(search, (s, t), (ex, ey), (base, b, c, twist))
        di, dj, ex, ey, rise = dj, -di, ey, -ex, beside


@kernel
def _look_at_cell(search, corner, heading, shape):
    """Search the rims in a cell, and its inside if it is twisted; as `look_along_rim` does."""
    (ex, ey), d, t = heading, shape[3], corner[1]
    low, high = t + min(ex, 0.0) - max(ey, 0.0), t + max(ex, 0.0) - min(ey, 0.0)
    if is_beside(search, low, high):
        return
    for rim in (-1, 1):
        lean, side = search.sine * search.radius, rim * search.half_width
        if low < side + max(lean, 0.0) and high > side + min(lean, 0.0):
            look_along_rim(search, rim, corner, heading, shape)
    if d * ex * ey * 0.5 > NOTICED * search.radius:
        look_into_cell(search, corner, heading, shape)


@kernel
def _rise_to(ground, here, i, j):
    """Return the height of a vertex above `here` [m], in cells; NaN off the map."""
    if i < 0 or j < 0 or i >= ground.rows or j >= ground.columns:
        return np.nan
    return (elevation_of(ground, i, j) - here) * ground.inverse_resolution


@kernel
def _bound_side(slope, bend):
    """Return the largest value of slope u - bend u^2 for 0 <= u <= 1."""
    if slope > 2.0 * bend:
        return slope - bend
    return 0.25 * slope * slope / bend if slope > 0.0 else 0.0


@kernel
def _bound_cell(curl, heading, rates):
    """Return a bound of b u + c v + d u v - curl (ex u + ey v)^2 in a cell; `rates` is b, c, d."""
    (ex, ey), (b, c, d) = heading, rates
    bend_u, bend_v, bulge = curl * ex * ex, curl * ey * ey, d - 2.0 * curl * ex * ey
    if bulge <= 0.0:
        return _bound_side(b, bend_u) + _bound_side(c, bend_v)
    ahead, aside = b - bend_u, c - bend_v
    highest = max(max(ahead, aside), max(ahead + aside + bulge, 0.0))
    return highest + 2.0 * BEND * curl


@kernel
def look_along_edge(search, start, along):
    """Search an edge where the wheel is as steep as the edge.

    Args:
        search: CELL_SEARCH.
        start: s, t and the intrusion without the wheel's dome, at the start of the edge.
        along: Their changes to the end of the edge.
    """
    s, t, base = start
    along_s, along_t, rise = along
    R = search.radius
    share = 2.0 if rise > 0.0 else -1.0
    if abs(along_s) > LEVEL:
        steep = rise * search.cosine / along_s
        share = (R * steep / np.sqrt(1.0 + steep * steep) - s) / along_s
    share = min(max(share, 0.0), 1.0)
    best_s, best_t = s + share * along_s, t + share * along_t
    if abs(best_s) < R and is_below(search, best_s, best_t):
        if share > 0.0:
            take_point(search, best_s, best_t, base + share * rise)
        return
