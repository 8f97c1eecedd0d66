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
from rover_physics.terrain.ground import elevation_of, is_cell_on_map, look_up_cell

BEND = 0.19
"""Intrusion of an edge above that of its ends, over the curvature of the wheel: 1/8 for a
parabola, with a margin for a circle."""
STEEP = 0.64
"""(s / R)^2 beyond which the wheel's curvature is too large for that estimate."""
INTERIOR_STEPS = 8
"""Largest number of steps of the search inside a cell."""
FLAT_RATE = 3e-3
"""Change of the intrusion along the heading at which that search stops."""
LEAST_CHANGE = 0.3
"""Lower bound of the derivative in that search, where the ground bends almost like the wheel."""
BEYOND = 0.3
"""Distance from a crossing, to both sides, at which a rim is looked at [cells]."""
STEEPEST = 0.9999
"""Share of the radius up to which the wheel's slope is finite enough for Newton's method."""
BESIDE_SHARE = 0.8
"""Share of the rise of the wheel: where the gap grows less, the ground is not a plane, and the rim
may touch elsewhere."""
RIM_STEPS = 2
"""Steps for the place where an edge crosses a rim."""
RIM_BEND = 0.14
"""The same for a rim that crosses a cell in parallel to a side; aslant, it is up to twice that."""
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
        for beyond in (-BEYOND, BEYOND):
            rim, s = search.crossing_rim[k], search.crossing_s[k] + beyond
            if abs(s) < search.radius and not _is_covered(model.ground, search, rim, s):
                _search_rim(model, work, wheel, rim, s)
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
def _is_covered(ground, search, rim, s):
    """Return whether a rim, -1 right or 1 left, is as far from the ground as over a plane.

    `s` is a place on the rim; the plane is that of the last peak of this rim.
    """
    R, side = search.radius, (rim + 1) // 2
    if search.peak[side] == -np.inf:
        return False
    q = np.sqrt(R * R - s * s)
    t = rim * search.half_width + search.sine * q
    x = search.x + s * search.ahead_x - t * search.ahead_y
    y = search.y + s * search.ahead_y + t * search.ahead_x
    height = (look_up_cell(ground, x, y)[0] - search.z) / search.cell
    intrusion = height + q / search.cosine - search.tangent * t
    # From a contact on a plane the gap grows with the rise of the wheel.
    rise = R - (s * search.peak_s[side] + q * search.peak_q[side]) / R
    return search.peak[side] - intrusion >= BESIDE_SHARE * rise


@kernel
def _search_rim(model, work, wheel, rim, s):
    """Search a rim, -1 right or 1 left, from s [cells], and take what is found if it is nearer."""
    contacts, search, samples = work.contacts, work.cells, model.samples
    across = rim * samples.half_width
    sine = s / search.radius
    turn = sine, np.sqrt(1.0 - sine * sine)
    gap, turn, slope = search_circle(model, work, (wheel, across), turn)
    if not gap < np.inf:
        return
    _note_peak(search, (rim + 1) // 2, gap, turn)
    if gap < contacts.gap[wheel] - NOTICED * samples.radius:
        keep_contact(contacts, wheel)
        contacts.across[wheel] = across
        take_circle(contacts, wheel, (gap, turn, slope))


@kernel
def _note_peak(search, side, gap, turn):
    """Note the peak of a rim, 0 right or 1 left, by its gap [m] and angle (sine, cosine)."""
    search.peak[side] = -gap / search.cell
    search.peak_s[side], search.peak_q[side] = turn[0] * search.radius, turn[1] * search.radius


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
    contacts = work.contacts
    search.peak[0] = search.peak[1] = -np.inf
    if not contacts.inside[wheel] and contacts.across[wheel] != 0.0:
        turn = contacts.sine[wheel], contacts.cosine[wheel]
        side = 1 if contacts.across[wheel] > 0.0 else 0
        _note_peak(search, side, contacts.gap[wheel], turn)
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
    side_on = max(search.ahead_x * search.ahead_x, search.ahead_y * search.ahead_y)
    bend = RIM_BEND * R * R / (max(q, 0.2 * R) ** 3 * side_on) * inverse
    if not intrusion + bend > search.best:
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
        dx, dy = column - search.x, row - search.y
        corner = dx * ex + dy * ey, dy * ex - dx * ey
        _look_into_cell(search, corner, ((a - search.z) * scale, b, c, twist))


@kernel
def _look_into_cell(search, corner, shape):
    """Search a twisted cell for a peak of the intrusion in its inside.

    Across the wheel the ground bends down, so for each s there is a best t in closed form. What is
    left is a quadratic function of s plus the wheel's dome; its largest value is bracketed.

    Args:
        search: CELL_SEARCH.
        corner: s and t of the cell's corner [cells].
        shape: (a, b, c, d) of the ground a + b u + c v + d u v above the wheel's centre, u and v
            along the cell's sides from the corner [cells].
    """
    ex, ey, R, inverse = search.ahead_x, search.ahead_y, search.radius, 1.0 / search.cosine
    s0, t0 = corner
    a, b, c, d = shape
    sag, skew = d * ex * ey, d * (ex * ex - ey * ey)
    slope_s, slope_t = b * ex + c * ey, c * ex - b * ey - search.tangent
    half = 0.5 / sag
    bend = 0.5 * d * d * half
    rise = slope_s + slope_t * skew * half
    base = a - search.tangent * t0 + 0.5 * slope_t * slope_t * half
    level = base - rise * s0 + bend * s0 * s0
    rise -= 2.0 * bend * s0
    # The wheel bends at least as at its bottom.
    rest = inverse / R - 2.0 * bend
    if rest > 0.0 and level + R * inverse + 0.5 * rise * rise / rest <= search.best:
        return
    low = max(s0 + min(ex, 0.0) + min(ey, 0.0), -STEEPEST * R)
    high = min(s0 + max(ex, 0.0) + max(ey, 0.0), STEEPEST * R)
    if not low < high:
        return
    if rest > 0.0:
        _look_on_line(search, (s0, t0), shape, (rise, bend, low, high))
        return
    # Only where the wheel bends more than the ground there are peaks: on its steep sides.
    q = (0.5 * R * R * inverse / bend) ** (1.0 / 3.0)
    inflection = np.sqrt(max(R * R - q * q, 0.0))
    if high > inflection:
        _look_on_line(search, (s0, t0), shape, (rise, bend, max(low, inflection), high))
    if low < -inflection:
        _look_on_line(search, (s0, t0), shape, (rise, bend, low, min(high, -inflection)))


@kernel
def _look_on_line(search, corner, shape, line):
    """Find the peak on the line of best t in a cell, and keep it if it is in the cell.

    Args:
        search: CELL_SEARCH.
        corner: As for `_look_into_cell`.
        shape: As for `_look_into_cell`.
        line: Slope and half the second derivative of the ground along the line, and the least and
            largest s.
    """
    ex, ey, R, inverse = search.ahead_x, search.ahead_y, search.radius, 1.0 / search.cosine
    s0, t0 = corner
    a, b, c, d = shape
    rise, bend, low, high = line
    low_rate = rise + 2.0 * bend * low - low / np.sqrt(R * R - low * low) * inverse
    high_rate = rise + 2.0 * bend * high - high / np.sqrt(R * R - high * high) * inverse
    if not (low_rate > 0.0 and high_rate < 0.0):
        return
    # The unknown is the wheel's slope s / q, which makes steep contacts well-behaved.
    gain, cosine = 2.0 * bend * search.cosine, search.cosine
    s = 0.5 * (low + high)
    slope = s / np.sqrt(R * R - s * s)
    for _ in range(INTERIOR_STEPS):
        inverse_length = 1.0 / np.sqrt(1.0 + slope * slope)
        s = R * slope * inverse_length
        error = rise * cosine + gain * s - slope
        if abs(error) < FLAT_RATE:
            break
        change = 1.0 - gain * R * inverse_length * inverse_length * inverse_length
        slope += error / max(change, LEAST_CHANGE)
    half = 0.5 / (d * ex * ey)
    slope_t, skew = c * ex - b * ey - search.tangent, d * (ex * ex - ey * ey)
    along = s - s0
    aside = (slope_t + skew * along) * half
    u, v = ex * along - ey * aside, ey * along + ex * aside
    if not (u >= 0.0 and u <= 1.0 and v >= 0.0 and v <= 1.0):
        return
    if _is_below(search, s, t0 + aside):
        ground = a + b * u + c * v + d * u * v
        _take(search, s, t0 + aside, ground - search.tangent * (t0 + aside))
