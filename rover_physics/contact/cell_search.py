"""Search for the highest ground under the whole width of a wheel.

Lengths are in cells here. A point of the ground is at s along the wheel's heading and t to the
left of its centre. The lower side of the cylinder is the surface tan(camber) t - sqrt(R^2 - s^2) /
cos(camber) above the centre. Its distance below the ground is the intrusion. Along the edge of a
cell the ground is straight, so the largest intrusion has a closed form. Within a cell the
intrusion can only be larger if the ground is twisted. So vertices are looked at first, then the
edges and cells next to those that come near. Where an edge leaves the footprint, it crosses a rim.
"""

import numpy as np
from numba import int64

from rover_physics.contact.circle_search import search_circle
from rover_physics.contact.contact_record import CROSSINGS, NOTICED
from rover_physics.contact.tracking import keep_contact, take_circle
from rover_physics.numerics.kernels import kernel
from rover_physics.status import ContactStatus
from rover_physics.terrain.ground import elevation_of, is_cell_on_map

BEND = 0.19
"""Intrusion of an edge above that of its ends, over the curvature of the wheel: 1/8 for a parabola,
with a margin for a circle."""
STEEP = 0.64
"""(s / R)^2 beyond which the wheel's curvature is too large for that estimate."""
INTERIOR_STEPS = 8
"""Newton steps in a cell."""
PROMISE = 0.75
"""A cell is left if so many times the gain of the first full Newton step, which is half of it for a
parabola, does not suffice."""
BESIDE_SHARE = 0.8
"""Share of the rise of the wheel: where the gap grows less, the ground is not a plane, and the rim
may touch elsewhere."""
STEEPEST = 0.9999
"""Share of the radius up to which the wheel's slope is finite enough for Newton's method."""
RIM_STEPS = 2
"""Steps for the place where an edge crosses a rim."""
RIM_BEND = 0.3
"""The same for a rim, which may cross a twisted cell along its diagonal."""
GENTLE = 0.8
"""Share of the radius up to which the wheel is close to a parabola."""
MIN_COSINE = 0.3
"""Cosine of the contact angle below which no bound is tried."""
LEAST_UPRIGHT = 0.1
"""Cosine of the camber below which a wheel lies on its side and is not searched."""
LEVEL = 1e-9
"""Part of an edge along a direction [cells] below which it is across that direction."""


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
    if not work.placement.up[2] > LEAST_UPRIGHT:
        return ContactStatus.IN_CONTACT
    _begin(model, work, wheel)
    status = _look_at_vertices(model.ground, search, tops)
    if search.found:
        _take_peak(model.ground, search, contacts, wheel)
    for k in range(min(search.crossings, CROSSINGS)):
        _search_rim(model, work, wheel, k)
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
def _search_rim(model, work, wheel, k):
    """Search a rim from crossing k, and take what is found if it is nearer."""
    contacts, search, samples = work.contacts, work.cells, model.samples
    s = search.crossing_s[k] / search.radius
    across = search.crossing_rim[k] * samples.half_width
    turn = s, np.sqrt(max(1.0 - s * s, 0.0))
    gap, turn, slope = search_circle(model, work, (wheel, across), turn)
    if gap < contacts.gap[wheel] - NOTICED * samples.radius:
        keep_contact(contacts, wheel)
        contacts.across[wheel] = across
        take_circle(contacts, wheel, (gap, turn, slope))


@kernel
def _begin(model, work, wheel):
    """Write what the search needs of the wheel's place into `work.cells`."""
    ground, samples, placement = model.ground, model.samples, work.placement
    search, centres = work.cells, placement.centres
    scale = ground.inverse_resolution
    search.cell = 1.0 / scale
    search.radius = samples.radius * scale
    search.x, search.y = (
        (centres[wheel, 0] - ground.x0) * scale,
        (centres[wheel, 1] - ground.y0) * scale,
    )
    search.z = centres[wheel, 2]
    search.ahead_x, search.ahead_y = placement.forward[0], placement.forward[1]
    search.cosine, search.sine = placement.up[2], placement.R[2, 1]
    search.tangent = search.sine / search.cosine
    search.half_width = samples.half_width * scale * search.cosine
    search.found = search.crossings = 0
    contacts, search.rim = work.contacts, 0
    if not contacts.inside[wheel] and contacts.across[wheel] != 0.0:
        search.rim = 1 if contacts.across[wheel] > 0.0 else -1
    search.contact_s = contacts.sine[wheel] * search.radius
    search.contact_q = contacts.cosine[wheel] * search.radius
    search.best = -work.contacts.gap[wheel] * scale + NOTICED * search.radius


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
    low_s, high_s = (
        -_find_reach(search, rear, tilt, scale),
        _find_reach(search, front, tilt, scale),
    )
    if not low_s < high_s:
        return ContactStatus.IN_CONTACT
    # One cell more on all sides: edges reach out of the footprint.
    low_s, high_s, low_t, high_t = low_s - 1.0, high_s + 1.0, low_t - 1.0, high_t + 1.0
    reach_up = max(low_s * ey, high_s * ey) + max(low_t * ex, high_t * ex)
    reach_down = min(low_s * ey, high_s * ey) + min(low_t * ex, high_t * ex)
    status = ContactStatus.IN_CONTACT
    first = max(int64(np.ceil(search.y + reach_down)), 0)
    last = min(int64(np.floor(search.y + reach_up)), ground.rows - 1)
    slant_x = 1.0 / ex if abs(ex) > 1e-9 else 0.0
    slant_y = 1.0 / ey if abs(ey) > 1e-9 else 0.0
    flat = 1.0 / (R * R)
    for i in range(first, last + 1):
        dy = i - search.y
        low_x, high_x = -np.inf, np.inf
        if slant_x != 0.0:
            one, other = (low_s - dy * ey) * slant_x, (high_s - dy * ey) * slant_x
            low_x, high_x = min(one, other), max(one, other)
        elif not low_s <= dy * ey <= high_s:
            continue
        if slant_y != 0.0:
            one, other = (dy * ex - low_t) * slant_y, (dy * ex - high_t) * slant_y
            low_x, high_x = max(low_x, min(one, other)), min(high_x, max(one, other))
        elif not low_t <= dy * ex <= high_t:
            continue
        start = max(int64(np.ceil(search.x + low_x)), 0)
        end = min(int64(np.floor(search.x + high_x)), ground.columns - 1)
        for j in range(start, end + 1):
            dx = j - search.x
            s, t = dx * ex + dy * ey, dy * ex - dx * ey
            base = (elevation_of(ground, i, j) - search.z) * scale - tangent * t
            if base + _bound_dome(s, R, flat) * inverse > search.best:
                _look_around(ground, search, (i, j), (s, t, base))
            elif base != base and abs(s) < R and _is_below(search, s, t):
                status = ContactStatus.UNKNOWN_GROUND
    return status


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
def _find_reach(search, top, tilt, scale):
    """Return the largest s at which ground of height `top` [m] may touch the wheel."""
    if not top < np.inf:
        return search.radius
    least = (search.best - (top - search.z) * scale - tilt) * search.cosine
    if least >= search.radius:
        return 0.0
    return np.sqrt(search.radius**2 - max(least, 0.0) ** 2)


@kernel
def _is_below(search, s, t):
    """Return whether the point (s, t) is below the wheel; |s| must be below R."""
    lean = search.sine * np.sqrt(search.radius * search.radius - s * s)
    return abs(t - lean) <= search.half_width


@kernel
def _take(search, s, t, base):
    """Keep a point if it is the best so far; `base` is its intrusion without the wheel's dome."""
    dome = np.sqrt(max(search.radius * search.radius - s * s, 0.0)) / search.cosine
    if base + dome > search.best:
        search.best, search.best_s, search.best_t = base + dome, s, t
        search.found = 1


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
    if intrusion > search.best and q > 0.0 and _is_below(search, s, t):
        _take(search, s, t, base)
    steep, curl, gentle_s = q < MIN_COSINE * R, 0.5 * inverse / R, GENTLE * R
    lean = search.sine * q
    is_below = abs(t - lean) <= search.half_width
    rim_bend = 0.0 if steep else RIM_BEND * R * R / (q * q * q) * inverse
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
        if not is_cell_on_map(ground, j + dj, i + di):
            continue
        rise = (elevation_of(ground, i + di, j + dj) - here) * scale - search.tangent * along_t
        # The end that comes nearer, by the wheel's parabola, owns the edge.
        crosses = is_below != (abs(t + along_t - lean) <= search.half_width)
        if crosses and steep:
            _cross_rim(search, (s, t, base), (along_s, along_t, rise))
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
                _cross_rim(search, (s, t, base), (along_s, along_t, rise))
            if not most > search.best:
                continue
        _look_along_edge(search, (s, t, base), (along_s, along_t, rise))
    _look_into_cells(ground, search, i, j)


@kernel
def _look_along_edge(search, start, along):
    """Search an edge where the wheel is as steep as the edge, or where it crosses a rim.

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
    if abs(best_s) < R and _is_below(search, best_s, best_t):
        if share > 0.0:
            _take(search, best_s, best_t, base + share * rise)
        return


@kernel
def _cross_rim(search, start, along):
    """Note where an edge crosses a rim, if the rim may come near there.

    `start` and `along` are as for `_look_along_edge`.
    """
    s, t, base = start
    along_s, along_t, rise = along
    R, inverse = search.radius, 1.0 / search.cosine
    if not abs(along_t) > LEVEL:
        return
    side = 1.0 if t + 0.5 * along_t > search.sine * R * 0.5 else -1.0
    q, share = R, 0.5
    for _ in range(RIM_STEPS):
        at = s + share * along_s
        q = np.sqrt(max(R * R - at * at, 0.0))
        share = (side * search.half_width + search.sine * q - t) / along_t
    if not (share >= 0.0 and share <= 1.0 and q > 0.0):
        return
    at = s + share * along_s
    intrusion = base + share * rise + q * inverse
    bend = RIM_BEND * R * R / max(q, 0.2 * R) ** 3 * inverse
    if not intrusion + bend > search.best:
        return
    if side == search.rim:
        # From a contact on a plane the gap grows with the rise of the wheel.
        lift = R - (at * search.contact_s + q * search.contact_q) / R
        if search.best - intrusion >= BESIDE_SHARE * lift:
            return
    k = search.crossings % CROSSINGS
    search.crossing_s[k], search.crossing_rim[k] = at, int64(side)
    search.crossings += 1


@kernel
def _look_into_cells(ground, search, i, j):
    """Search the four cells around vertex (i, j) where they are twisted so that it may pay.

    A cell is searched at the vertex that comes nearest, by the wheel's parabola.
    """
    ex, ey, scale = search.ahead_x, search.ahead_y, ground.inverse_resolution
    here = elevation_of(ground, i, j)
    x, y = j - search.x, i - search.y
    s, curl = x * ex + y * ey, 0.5 / (search.radius * search.cosine)
    gentle = abs(s) < GENTLE * search.radius
    for cell in range(4):
        row, column = i - cell // 2, j - cell % 2
        if row < 0 or column < 0 or row > ground.rows - 2 or column > ground.columns - 2:
            continue
        di, dj = 1 - 2 * (cell // 2), 1 - 2 * (cell % 2)
        beside = (elevation_of(ground, i, j + dj) - here) * scale
        above = (elevation_of(ground, i + di, j) - here) * scale
        across = (elevation_of(ground, i + di, j + dj) - here) * scale
        twist = (across - beside - above) * (di * dj)
        # Along the axle the ground bends by -2 twist ex ey; the gain over the edges is a quarter.
        if not twist * ex * ey * 0.5 > NOTICED * search.radius:
            continue
        s_beside, s_above = s + dj * ex, s + di * ey
        s_across = s_beside + di * ey
        beside += search.tangent * dj * ey
        above -= search.tangent * di * ex
        across += search.tangent * (dj * ey - di * ex)
        bend = curl * s * s
        if gentle and (
            beside - curl * s_beside * s_beside > -bend
            or above - curl * s_above * s_above > -bend
            or across - curl * s_across * s_across > -bend
        ):
            continue
        a = elevation_of(ground, row, column)
        b = (elevation_of(ground, row, column + 1) - a) * scale
        c = (elevation_of(ground, row + 1, column) - a) * scale
        _look_into_cell(search, (row, column), ((a - search.z) * scale, b, c, twist))


@kernel
def _climb_line(search, line, rise):
    """Return the place, 0 to 1, of the largest intrusion along a line across a cell.

    `line` is s at its start and the change of s along it, `rise` the change of the intrusion
    without the wheel's dome.
    """
    s, along_s = line
    if not abs(along_s) > LEVEL:
        return 1.0 if rise > 0.0 else 0.0
    steep = rise * search.cosine / along_s
    place = (search.radius * steep / np.sqrt(1.0 + steep * steep) - s) / along_s
    return min(max(place, 0.0), 1.0)


@kernel
def _look_into_cell(search, corner, shape):
    """Find the stationary intrusion in a cell by Newton's method, and keep it if it is inside.

    Args:
        search: CELL_SEARCH.
        corner: Row and column of the cell.
        shape: (a, b, c, d) of the ground a + b u + c v + d u v above the wheel's centre.
    """
    ex, ey, R = search.ahead_x, search.ahead_y, search.radius
    tangent, inverse = search.tangent, 1.0 / search.cosine
    a, b, c, d = shape
    dx, dy = corner[1] - search.x, corner[0] - search.y
    u, v = 0.5, 0.5
    for step in range(INTERIOR_STEPS):
        s = (dx + u) * ex + (dy + v) * ey
        s = min(max(s, -STEEPEST * R), STEEPEST * R)
        q = np.sqrt(R * R - s * s)
        fall = s / q * inverse
        bend = R * R / (q * q * q) * inverse
        slope_u = b + d * v - fall * ex + tangent * ey
        slope_v = c + d * u - fall * ey - tangent * ex
        cross = d - bend * ex * ey
        determinant = bend * bend * ex * ex * ey * ey - cross * cross
        if not determinant > 0.0:
            if abs(s) < GENTLE * R:
                return
            # Across the cell the ground is straight in both directions: climb along each in turn.
            u = _climb_line(search, (dx * ex + (dy + v) * ey, ex), b + d * v + tangent * ey)
            v = _climb_line(search, ((dx + u) * ex + dy * ey, ey), c + d * u - tangent * ex)
            continue
        step_u = (-bend * ey * ey * slope_u - cross * slope_v) / determinant
        step_v = (-bend * ex * ex * slope_v - cross * slope_u) / determinant
        if step == 0 and abs(s) < GENTLE * R:
            t = (dy + v) * ex - (dx + u) * ey
            here = a + b * u + c * v + d * u * v - tangent * t + q * inverse
            if here - PROMISE * (slope_u * step_u + slope_v * step_v) < search.best:
                return
        u = min(max(u - step_u, -0.5), 1.5)
        v = min(max(v - step_v, -0.5), 1.5)
        if abs(step_u) + abs(step_v) < 1e-4:
            break
    if not (u >= 0.0 and u <= 1.0 and v >= 0.0 and v <= 1.0):
        return
    s, t = (dx + u) * ex + (dy + v) * ey, (dy + v) * ex - (dx + u) * ey
    if not abs(s) < R:
        return
    if _is_below(search, s, t):
        _take(search, s, t, a + b * u + c * v + d * u * v - tangent * t)
