# SPDX-License-Identifier: Apache-2.0
"""Search for the highest ground under the whole width of a wheel.

Along the edge of a cell the ground is straight, so the largest intrusion has a closed form. Within
a cell the intrusion can only be larger if the ground is twisted. So vertices are looked at first,
then the edges and cells next to those that come near. Where an edge leaves the footprint, it
crosses a rim. `intrusion.py` explains the terms; lengths are in cells.
"""

import numpy as np
from numba import int64

from rover_physics.contact.cell_peaks import GENTLE, look_into_cells
from rover_physics.contact.intrusion import begin_search, is_below, is_beside, take_point
from rover_physics.contact.rim_search import LEVEL, RIM_BEND, cross_rim, look_along_rims
from rover_physics.contact.tracking import keep_contact
from rover_physics.numerics.kernels import kernel
from rover_physics.status import ContactStatus
from rover_physics.terrain.ground import elevation_of, is_cell_on_map

BEND = 0.19
"""Intrusion of an edge above that of its ends, over the curvature of the wheel: 1/8 for a
parabola, with a margin for a circle."""
STEEP = 0.64
"""(s / R)^2 beyond which the wheel's curvature is too large for that estimate."""
MIN_COSINE = 0.3
"""Cosine of the contact angle below which no bound is tried."""
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
        UNKNOWN_GROUND if ground below the wheel is unknown, else IN_CONTACT.
    """
    contacts, search = work.contacts, work.cells
    if not work.placement.up[wheel, 2] > LEAST_UPRIGHT:
        return ContactStatus.IN_CONTACT
    begin_search(model, work, wheel)
    status = _look_at_vertices(model.ground, search, tops)
    if search.found:
        _take_peak(model.ground, search, contacts, wheel)
    look_along_rims(model, work, wheel)
    return status


@kernel
def _take_peak(ground, search, contacts, wheel):
    """Take the best point between the rims as the contact."""
    keep_contact(contacts, wheel)
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
def _look_at_vertices(ground, search, tops):
    """Look at all vertices of cells that may come near, and around those that do."""
    ex, ey, R = search.ahead_x, search.ahead_y, search.radius
    cosine, tangent, scale = search.cosine, search.tangent, ground.inverse_resolution
    inverse = 1.0 / cosine
    lean = search.sine * R
    low_t = -search.half_width + min(lean, 0.0)
    high_t = search.half_width + max(lean, 0.0)
    rear, front = tops
    tilt = abs(tangent) * (max(high_t, -low_t) + 1.0)
    low_s = -_find_extent(search, rear, tilt, scale)
    high_s = _find_extent(search, front, tilt, scale)
    if not low_s < high_s:
        return ContactStatus.IN_CONTACT
    # One cell more on all sides: edges extend beyond the footprint.
    low_s, high_s, low_t, high_t = low_s - 1.0, high_s + 1.0, low_t - 1.0, high_t + 1.0
    high_y = max(low_s * ey, high_s * ey) + max(low_t * ex, high_t * ex)
    low_y = min(low_s * ey, high_s * ey) + min(low_t * ex, high_t * ex)
    status = ContactStatus.IN_CONTACT
    first = max(int64(np.ceil(search.y + low_y)), 0)
    last = min(int64(np.floor(search.y + high_y)), ground.rows - 1)
    slant_x, slant_y = 1.0 / _away_from_zero(ex), 1.0 / _away_from_zero(ey)
    flat, x, y, z = 1.0 / (R * R), search.x, search.y, search.z
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
            if base + _bound_dome(s, R, flat) * inverse > search.best:
                _look_around(ground, search, (i, j), (s, t, base))
            elif base != base and abs(s) < R and is_below(search, s, t):
                status = ContactStatus.UNKNOWN_GROUND
    return status


@kernel
def _away_from_zero(part):
    """Return part of a direction, at least so large that its inverse times a place is finite."""
    return part if abs(part) > LEVEL else LEVEL


@kernel
def _bound_dome(s, R, flat):
    """Return an upper bound of sqrt(R^2 - s^2), and of what an edge next to s may add to it.

    `flat` is 1 / R^2. A parabola is above the circle; the polynomial is above the curvature of the
    circle over that at the bottom.
    """
    x = s * s * flat
    if x < STEEP:
        return R * (1.0 - 0.5 * x) + BEND * (1.0 + x * (1.5 + 6.5 * x)) / R
    inward = max(abs(s) - 1.0, 0.0)
    return R * (1.0 - 0.5 * inward * inward * flat)


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
    """Search a vertex (i, j), those of its edges that may pay, and its cells if they are twisted.

    `there` is s, t and the intrusion of the vertex without the wheel's dome.
    """
    i, j = vertex
    s, t, base = there
    ex, ey, R = search.ahead_x, search.ahead_y, search.radius
    scale, inverse = ground.inverse_resolution, 1.0 / search.cosine
    q = np.sqrt(max(R * R - s * s, 0.0))
    intrusion = base + q * inverse
    if intrusion > search.best and q > 0.0 and is_below(search, s, t):
        take_point(search, s, t, base)
    steep, curl, gentle_s = q < MIN_COSINE * R, 0.5 * inverse / R, GENTLE * R
    lean = search.sine * q
    inside = abs(t - lean) <= search.half_width
    rim_bend = 0.0
    if not steep:
        rim_bend = RIM_BEND * R * R / (q * q * q * max(ex * ex, ey * ey)) * inverse
    fall = 0.0 if steep else s / q * inverse
    here = elevation_of(ground, i, j)
    for edge in range(4):
        di, dj = 0, 1
        along_s, along_t = ex, -ey
        if edge >= 2:
            di, dj = 1, 0
            along_s, along_t = ey, ex
        if edge % 2 == 1:
            di, dj, along_s, along_t = -di, -dj, -along_s, -along_t
        if is_beside(search, t + min(along_t, 0.0), t + max(along_t, 0.0)):
            continue
        if not is_cell_on_map(ground, j + dj, i + di):
            continue
        rise = (elevation_of(ground, i + di, j + dj) - here) * scale - search.tangent * along_t
        # The end that comes nearer, by the wheel's parabola, owns the edge.
        crosses = inside != (abs(t + along_t - lean) <= search.half_width)
        if crosses and steep:
            cross_rim(search, (s, t, base), (along_s, along_t, rise))
        gentle = abs(s) < gentle_s and abs(s + along_s) < gentle_s
        if gentle and rise - curl * along_s * (2.0 * s + along_s) > 0.0:
            continue
        if not steep:
            # The wheel bends at least as at its bottom, so a parabola is above the intrusion.
            gain, bend = rise - fall * along_s, along_s * along_s * inverse / R
            if gain > bend:
                gain -= 0.5 * bend
            elif gain > 0.0:
                gain *= 0.5 * gain / bend
            most = intrusion + max(gain, 0.0)
            if crosses and most + rim_bend > search.best:
                cross_rim(search, (s, t, base), (along_s, along_t, rise))
            if not most > search.best:
                continue
        look_along_edge(search, (s, t, base), (along_s, along_t, rise))
    look_into_cells(ground, search, i, j)


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
