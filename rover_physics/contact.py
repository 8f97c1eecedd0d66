"""A rigid cylindrical wheel on the terrain: its vertical gap, where it touches and in what frame.

The lower half of the cylinder is sampled in the wheel's own, cambered plane: on circles across its
width and angles along each circle. The smallest vertical gap between sample and terrain is the gap
of the wheel; it is refined along the circle by the root of its derivative. Contact angles count
from the lowest point of the circle, positive towards the front, so a wheel climbing has positive
angles.
"""

from typing import Any

import numpy as np

from rover_physics.ground import (
    find_roof,
    height_at_cell,
    height_inside,
    is_cell_on_map,
    look_up,
)
from rover_physics.kernels import kernel
from rover_physics.records import new_record, record_type
from rover_physics.rover import Rover

TOUCHING, OFF_MAP, UNKNOWN_GROUND = 0, 1, 2
COARSE, QUICK, NEAR, FULL, AGAIN, EXACT = np.arange(6)
"""Scopes of `find_touch`. Not plain integers, or each value would be compiled apart."""
REFINEMENTS = 9
GAP_PRECISION = 1e-5
"""How far the gap of a circle may be from its smallest, in wheel radii."""
TURN_TOLERANCE = 3e-3
"""Error of the contact angle [rad] at which the search along the circle stops."""
CIRCLE_REACH = 2e-2
"""How far above the nearest circle, in wheel radii, another one is looked at more closely."""
EXACT_REACH = 0.5
"""The same for samples of an exact search: beside a face much can lie between two samples."""
BESIDE_REACH = 5e-3
"""How far above the nearest circle, in wheel radii, another is looked at between its samples."""
BESIDE_SHARE = 0.8
"""Share of the circle's own rise from which on the ground counts as no plane."""
FAR_ROW = -9
"""Row of a sample that there is none of."""
COMPLIANCE = 2e-3
"""Depth, in wheel radii, to which real wheels and ground give way: circles with gaps closer than
that share the load. On a plane a wheel thus touches in its middle, not on an edge at random."""


MOST_ANGLES, MOST_CIRCLES = 49, 9
WHEEL_SAMPLES = record_type(
    ("radius", float),  # wheel radius [m]
    ("reach", float),  # farthest a sample can be from the wheel's centre in the plane [m]
    ("rows", np.int64),  # number k of contact angles
    ("circles", np.int64),  # number m of circles
    ("sines", float, (MOST_ANGLES,)),  # (k,) sines of the contact angles, ascending
    ("cosines", float, (MOST_ANGLES,)),  # (k,) their cosines
    ("spacing_sine", float),  # sine of the angle between neighbouring samples
    ("spacing_cosine", float),  # cosine of the angle between neighbouring samples
    ("beside_sine", float),  # sine of half that angle
    ("beside_cosine", float),  # cosine of half that angle
    ("laterals", float, (MOST_CIRCLES,)),  # (m,) distances from the middle plane [m], ascending
)
"""Where the cylinder of a wheel is sampled: at k angles of m circles."""

TOUCH = record_type(
    ("gap", float, (6,)),  # smallest vertical gap, negative inside the ground [m]
    ("sine", float, (6,)),  # sine of the contact angle
    ("cosine", float, (6,)),  # cosine of the contact angle
    ("point", float, (6, 3)),  # touching point [m], map frame
    ("normal", float, (6, 3)),  # normal that governs how the gap changes, z = 1, map frame
    ("held_height", float, (6,)),  # height [m] at which a wheel that climbs a face is held, or NaN
    ("held_angle", float, (6,)),  # contact angle with the face of a held wheel [rad]
    ("nearest", np.int64, (6,)),  # index of the circle that touches
    ("circle_gap", float, (6, MOST_CIRCLES)),  # smallest gap on each circle [m]
    ("circle_sine", float, (6, MOST_CIRCLES)),  # sine of the angle where it is
    ("circle_cosine", float, (6, MOST_CIRCLES)),  # cosine of the angle where it is
    ("noted_gap", float, (6,)),  # smallest sampled gap of the last scan [m]
    ("noted_circle", np.int64, (6,)),  # the circle of that
    ("first_gap", float, (6, MOST_CIRCLES)),  # smallest sampled gap of each circle then [m]
    ("first_row", np.int64, (6, MOST_CIRCLES)),  # the row of that
    ("second_gap", float, (6, MOST_CIRCLES)),  # smallest sampled gap away from that [m]
    ("second_row", np.int64, (6, MOST_CIRCLES)),  # the row of that
)
"""Where the six wheels touch; written by `find_touch` and `find_contact`."""


def sample_wheel(rover: Rover, resolution: float) -> Any:
    """Choose samples no farther apart than the cells of a terrain of `resolution` [m]."""
    wheel = rover.wheel
    half_angles = int(np.clip(np.ceil(0.5 * np.pi * wheel.radius / resolution), 10, 24))
    half_laterals = int(np.clip(np.ceil(0.5 * wheel.width / resolution), 1, 4))
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 2 * half_angles + 1)
    samples = new_record(
        WHEEL_SAMPLES,
        radius=wheel.radius,
        reach=np.hypot(wheel.radius, 0.5 * wheel.width),
        rows=angles.size,
        circles=2 * half_laterals + 1,
        spacing_sine=np.sin(angles[1] - angles[0]),
        spacing_cosine=np.cos(angles[1] - angles[0]),
        beside_sine=np.sin(0.5 * (angles[1] - angles[0])),
        beside_cosine=np.cos(0.5 * (angles[1] - angles[0])),
    )
    samples.sines[: angles.size], samples.cosines[: angles.size] = np.sin(angles), np.cos(angles)
    half = 0.5 * wheel.width
    samples.laterals[: samples.circles] = np.linspace(-half, half, samples.circles)
    return samples


def new_touch() -> Any:
    """Return an empty TOUCH, no wheel held."""
    return new_record(TOUCH, held_height=np.nan, held_angle=np.nan)


@kernel
def find_touch(grid, samples, placement, wheel, scope, touch):
    """Find where `wheel` is nearest to the ground and write it into row `wheel` of `touch`.

    `scope` says how thoroughly: COARSE looks at every other sample of the middle circle, QUICK
    at all samples and closer at the nearest, NEAR only around the direction found last, FULL also
    at all samples and closer at each other circle that comes near to that, AGAIN only at those
    that FULL found near, EXACT closer at each local minimum of each circle. FULL and AGAIN come
    after QUICK or NEAR at the same placement, AGAIN after FULL at a placement that differs
    little. Returns TOUCHING, or OFF_MAP or UNKNOWN_GROUND where any sample lies there; such
    samples are passed over, and the gap is NaN where there is no other.
    """
    status = TOUCHING
    if touch.held_height[wheel] == touch.held_height[wheel]:
        _hold(placement, wheel, touch)
        return status
    if scope != NEAR and scope != AGAIN:
        status = _scan(grid, samples, placement, wheel, scope, touch)
        if touch.noted_gap[wheel] == np.inf:
            touch.gap[wheel] = np.nan
            return status
        if scope in (COARSE, QUICK):
            _take_sample(samples, wheel, touch)
    if scope in (QUICK, NEAR):
        _refine_circle(grid, samples, placement, wheel, touch.nearest[wheel], touch)
    elif scope in (FULL, AGAIN):
        _refine_others(grid, samples, placement, wheel, touch)
    _write_touch(grid, samples, placement, wheel, scope != COARSE, touch)
    return status


@kernel
def _take_sample(samples, wheel, touch):
    """Take the nearest sample for the place where the wheel touches."""
    m = touch.noted_circle[wheel]
    k = touch.first_row[wheel, m]
    touch.nearest[wheel] = m
    touch.circle_gap[wheel, m] = touch.noted_gap[wheel]
    touch.circle_sine[wheel, m] = samples.sines[k]
    touch.circle_cosine[wheel, m] = samples.cosines[k]


@kernel
def _write_touch(grid, samples, placement, wheel, with_normal, touch):
    """Write gap, point and where asked for the normal of a wheel on its nearest circle."""
    m = touch.nearest[wheel]
    touch.gap[wheel] = touch.circle_gap[wheel, m]
    s, c = touch.circle_sine[wheel, m], touch.circle_cosine[wheel, m]
    _write_point(samples, placement, wheel, s, c, samples.laterals[m], touch)
    if with_normal:
        height, slope_x, slope_y = look_up(grid, touch.point[wheel, 0], touch.point[wheel, 1])
        _write_normal(placement, wheel, s, c, slope_x, slope_y, touch)


@kernel
def _hold(placement, wheel, touch):
    """Write the touch of a wheel whose centre is held at a height, whatever the ground."""
    touch.gap[wheel] = placement.centres[wheel, 2] - touch.held_height[wheel]
    for i in range(3):
        touch.point[wheel, i] = placement.centres[wheel, i]
        touch.normal[wheel, i] = 0.0
    touch.normal[wheel, 2] = 1.0


@kernel
def _scan(grid, samples, placement, wheel, scope, touch):
    """Sample the rim; write the nearest samples into `touch` and return the worst status."""
    first, last, stride = 0, samples.circles - 1, 1
    if scope == COARSE:
        first = last = last // 2
        stride = 2
    for m in range(samples.circles):
        touch.first_row[wheel, m] = touch.second_row[wheel, m] = FAR_ROW
        touch.first_gap[wheel, m] = touch.second_gap[wheel, m] = np.inf
    if scope != EXACT:
        scale = grid.inverse_resolution
        centre_x = (placement.centres[wheel, 0] - grid.x0) * scale
        centre_y = (placement.centres[wheel, 1] - grid.y0) * scale
        roof = find_roof(grid, centre_x, centre_y, samples.reach * scale)
        if roof < np.inf:
            reach = CIRCLE_REACH * samples.radius if scope == FULL else 0.0
            _scan_inside(
                grid, samples, placement, wheel, roof, reach,
                first, last, stride, touch,
            )  # fmt: skip
            return TOUCHING
    return _scan_carefully(
        grid, samples, placement, wheel, scope == EXACT,
        first, last, stride, touch,
    )  # fmt: skip


@kernel
def _scan_inside(
    grid, samples, placement, wheel, roof, reach, first, last, stride, touch
):
    """Sample a rim that is well over known ground, none of it higher than `roof` [m].

    Rows of samples at one angle are visited from the lowest upwards, until even the roof is
    farther below than the nearest sample by `reach`. What the loop reads is in local variables:
    the compiler must take it that anything written may lie anywhere.
    """
    R, forward, up, centres = placement.R, placement.forward, placement.up, placement.centres
    elevation, scale, radius = grid.elevation, grid.inverse_resolution, samples.radius
    laterals = samples.laterals
    rows, middle = (samples.rows - 1) // stride + 1, samples.rows // 2
    ahead_x, ahead_y = scale * radius * forward[0], scale * radius * forward[1]
    down_x, down_y, down_z = scale * radius * up[0], scale * radius * up[1], radius * up[2]
    across = laterals[first]
    x = (centres[wheel, 0] - grid.x0 + across * R[0, 1]) * scale
    y = (centres[wheel, 1] - grid.y0 + across * R[1, 1]) * scale
    z = centres[wheel, 2] + across * R[2, 1]
    width = 0.0
    if last > first:
        width = (laterals[last] - across) / (last - first)
    step_x, step_y, step_z = width * R[0, 1] * scale, width * R[1, 1] * scale, width * R[2, 1]
    rim = abs(laterals[samples.circles - 1] * R[2, 1])
    floor = roof + rim - centres[wheel, 2]
    best, best_m = np.inf, first
    for visit in range(rows):
        k = middle + stride * ((visit + 1) // 2) * (1 - 2 * (visit % 2))
        s, c = samples.sines[k], samples.cosines[k]
        if -c * down_z - floor > best + reach:
            break
        gx = x + s * ahead_x - c * down_x
        gy = y + s * ahead_y - c * down_y
        gz = z - c * down_z
        for m in range(first, last + 1):
            gap = gz - height_inside(elevation, gx, gy)
            gx += step_x
            gy += step_y
            gz += step_z
            if gap < best + reach:
                _note_sample(wheel, m, k, stride, gap, touch)
                if gap < best:
                    best, best_m = gap, m
    touch.noted_gap[wheel], touch.noted_circle[wheel] = best, best_m


@kernel
def _note_sample(wheel, m, k, stride, gap, touch):
    """Note a near sample of row k on circle m: the nearest, or the nearest away from that."""
    if gap < touch.first_gap[wheel, m]:
        if abs(k - touch.first_row[wheel, m]) > stride:
            touch.second_gap[wheel, m] = touch.first_gap[wheel, m]
            touch.second_row[wheel, m] = touch.first_row[wheel, m]
        touch.first_gap[wheel, m], touch.first_row[wheel, m] = gap, k
    elif gap < touch.second_gap[wheel, m] and abs(k - touch.first_row[wheel, m]) > stride:
        touch.second_gap[wheel, m], touch.second_row[wheel, m] = gap, k


@kernel
def _scan_carefully(
    grid, samples, placement, wheel, exact, first, last, stride, touch
):
    """Sample a rim that may be over unknown ground, beyond the map or beside a face.

    Where `exact`, each sample that may be near is refined at once. Returns the worst status.
    """
    R, forward, up, centres = placement.R, placement.forward, placement.up, placement.centres
    elevation, scale, radius = grid.elevation, grid.inverse_resolution, samples.radius
    status, best, best_m = TOUCHING, np.inf, first
    if exact:
        touch.circle_gap[wheel, :] = np.inf
    middle = samples.rows // 2
    for visit in range((samples.rows - 1) // stride + 1):
        k = middle + stride * ((visit + 1) // 2) * (1 - 2 * (visit % 2))
        s, c = samples.sines[k], samples.cosines[k]
        for m in range(first, last + 1):
            across = samples.laterals[m]
            x = centres[wheel, 0] + across * R[0, 1] + radius * (s * forward[0] - c * up[0])
            y = centres[wheel, 1] + across * R[1, 1] + radius * (s * forward[1] - c * up[1])
            gx, gy = (x - grid.x0) * scale, (y - grid.y0) * scale
            if not is_cell_on_map(elevation, gx, gy):
                status = OFF_MAP
                continue
            gap = centres[wheel, 2] + across * R[2, 1] - radius * c * up[2]
            gap -= height_at_cell(elevation, gx, gy)
            if gap != gap:
                if status == TOUCHING:
                    status = UNKNOWN_GROUND
                continue
            _note_sample(wheel, m, k, stride, gap, touch)
            if exact and gap < best + EXACT_REACH * radius:
                gap = _refine_from(grid, samples, placement, wheel, m, s, c, touch)
            if gap < best:
                best, best_m = gap, m
    touch.noted_gap[wheel], touch.noted_circle[wheel] = best, best_m
    if exact:
        touch.nearest[wheel] = best_m
    return status


@kernel
def _refine_others(grid, samples, placement, wheel, touch):
    """Look closer at the circles with samples that come near to the smallest gap."""
    reach = touch.noted_gap[wheel] + CIRCLE_REACH * samples.radius
    nearest = touch.nearest[wheel]
    s0, c0 = touch.circle_sine[wheel, nearest], touch.circle_cosine[wheel, nearest]
    for m in range(samples.circles):
        if m != nearest:
            touch.circle_gap[wheel, m] = np.inf
        if touch.first_gap[wheel, m] <= reach:
            k = touch.first_row[wheel, m]
            s, c = samples.sines[k], samples.cosines[k]
            lower = m == nearest and touch.first_gap[wheel, m] < touch.circle_gap[wheel, m]
            if abs(s * c0 - c * s0) < samples.spacing_sine and not lower:
                s, c = s0, c0
            if m != nearest or s != s0:
                _refine_from(grid, samples, placement, wheel, m, s, c, touch)
        if touch.second_gap[wheel, m] <= reach:
            k = touch.second_row[wheel, m]
            s, c = samples.sines[k], samples.cosines[k]
            _refine_from(grid, samples, placement, wheel, m, s, c, touch)
        if touch.circle_gap[wheel, m] < touch.circle_gap[wheel, touch.nearest[wheel]]:
            touch.nearest[wheel] = m
    reach = touch.circle_gap[wheel, touch.nearest[wheel]] + BESIDE_REACH * samples.radius
    for m in range(samples.circles):
        if touch.circle_gap[wheel, m] <= reach:
            _look_beside(grid, samples, placement, wheel, m, touch)
            if touch.circle_gap[wheel, m] < touch.circle_gap[wheel, touch.nearest[wheel]]:
                touch.nearest[wheel] = m


@kernel
def _look_beside(grid, samples, placement, wheel, m, touch):
    """Search circle m from between the samples, too, where the ground comes nearer there.

    Over a plane the gap grows away from the smallest with the rise of the circle; where it grows
    less, a wheel that bridges a hollow may come nearer to the hollow's other side.
    """
    R, forward, up = placement.R, placement.forward, placement.up
    centres, radius, across = placement.centres, samples.radius, samples.laterals[m]
    gap, s0, c0 = (
        touch.circle_gap[wheel, m], touch.circle_sine[wheel, m], touch.circle_cosine[wheel, m]
    )  # fmt: skip
    limit = gap + BESIDE_SHARE * radius * (1.0 - samples.beside_cosine)
    for side in range(-1, 2, 2):
        turn = side * samples.beside_sine
        s, c = s0 * samples.beside_cosine + c0 * turn, c0 * samples.beside_cosine - s0 * turn
        if c < 0.0:
            continue
        x = centres[wheel, 0] + across * R[0, 1] + radius * (s * forward[0] - c * up[0])
        y = centres[wheel, 1] + across * R[1, 1] + radius * (s * forward[1] - c * up[1])
        z = centres[wheel, 2] + across * R[2, 1] - radius * c * up[2]
        if z - look_up(grid, x, y)[0] < limit:
            _refine_from(grid, samples, placement, wheel, m, s, c, touch)


@kernel
def _refine_circle(grid, samples, placement, wheel, m, touch):
    """Search circle m anew from where it was nearest."""
    s, c = touch.circle_sine[wheel, m], touch.circle_cosine[wheel, m]
    touch.circle_gap[wheel, m] = np.inf
    _refine_from(grid, samples, placement, wheel, m, s, c, touch)
    if touch.circle_gap[wheel, m] == np.inf:
        touch.circle_gap[wheel, m] = np.nan


@kernel
def _refine_from(grid, samples, placement, wheel, m, s, c, touch):
    """Search circle m near (s, c), keep what is nearer than before, and return the gap found."""
    gap, s, c = search_circle(grid, samples, placement, wheel, samples.laterals[m], s, c)
    if gap < touch.circle_gap[wheel, m]:
        touch.circle_gap[wheel, m] = gap
        touch.circle_sine[wheel, m], touch.circle_cosine[wheel, m] = s, c
    return gap


@kernel
def search_circle(grid, samples, placement, wheel, across, s, c):
    """Return the smallest gap [m] of a circle near the angle of (s, c), and where: sine, cosine.

    On a plane the circle touches in the direction of the plane's normal, so the first trials look
    in the direction of the normal found last. On an edge that leads to and fro: then the next
    trial is where the tangents of the gap from both sides meet, which is also where the gap can't
    be smaller. Infinite over unknown ground.
    """
    R, centres, radius = placement.R, placement.centres, samples.radius
    x = centres[wheel, 0] + across * R[0, 1]
    y = centres[wheel, 1] + across * R[1, 1]
    z = centres[wheel, 2] + across * R[2, 1]
    ahead_x, ahead_y = placement.forward[0], placement.forward[1]
    up_x, up_y, up_z = placement.up[0], placement.up[1], placement.up[2]
    best, best_s, best_c = np.inf, s, c
    turn_s, turn_c = samples.spacing_sine, samples.spacing_cosine
    back_s, back_c = s * turn_c - c * turn_s, c * turn_c + s * turn_s
    ahead_s, ahead_c = s * turn_c + c * turn_s, c * turn_c - s * turn_s
    if back_c < 0.0:
        back_s, back_c = -1.0, 0.0
    if ahead_c < 0.0:
        ahead_s, ahead_c = 1.0, 0.0
    back_gap, ahead_gap, back_rate, ahead_rate = np.inf, np.inf, 0.0, 0.0
    for trial in range(REFINEMENTS):
        height, slope_x, slope_y = look_up(
            grid, x + radius * (s * ahead_x - c * up_x), y + radius * (s * ahead_y - c * up_y)
        )
        gap = z - radius * c * up_z - height
        rise = slope_x * ahead_x + slope_y * ahead_y
        fall = up_z - slope_x * up_x - slope_y * up_y
        turn = s * fall - c * rise
        length_squared = rise * rise + fall * fall
        converged = not turn * turn > TURN_TOLERANCE * TURN_TOLERANCE * length_squared
        if gap < best:
            best, best_s, best_c = gap, s, c
            if converged:
                length = np.sqrt(length_squared)
                best += radius * (s * rise + c * fall - length)
                best_s, best_c = rise / length, fall / length
        if converged:
            break
        if turn > 0.0:
            ahead_s, ahead_c, ahead_gap, ahead_rate = s, c, gap, radius * turn
        else:
            back_s, back_c, back_gap, back_rate = s, c, gap, radius * turn
        share = 0.5
        if back_gap < np.inf and ahead_gap < np.inf:
            between = ahead_s * back_c - ahead_c * back_s
            share = (ahead_gap - back_gap - ahead_rate * between) / (
                (back_rate - ahead_rate) * between
            )
            if best - (back_gap + back_rate * share * between) < GAP_PRECISION * radius:
                break
        if trial < 2:
            inverse = 1.0 / np.sqrt(length_squared)
            s, c = rise * inverse, fall * inverse
        if trial > 1 or not (s * back_c > c * back_s and s * ahead_c < c * ahead_s):
            share = min(max(share, 0.05), 0.95)
            s, c = back_s + share * (ahead_s - back_s), back_c + share * (ahead_c - back_c)
            inverse = 1.0 / np.sqrt(s * s + c * c)
            s, c = s * inverse, c * inverse
    return best, best_s, best_c


@kernel
def _write_point(samples, placement, wheel, s, c, lateral, touch):
    """Write the point of the cylinder at the angle of sine s and cosine c and at `lateral`."""
    R, forward, up, centres = placement.R, placement.forward, placement.up, placement.centres
    touch.sine[wheel], touch.cosine[wheel] = s, c
    for i in range(3):
        radial = samples.radius * (s * forward[i] - c * up[i])
        touch.point[wheel, i] = centres[wheel, i] + lateral * R[i, 1] + radial


@kernel
def _write_normal(placement, wheel, s, c, slope_x, slope_y, touch):
    """Write the wheel's radial direction with the terrain's slope along the axis, scaled to z = 1.

    The part of the terrain's normal along the circle is left out: it vanishes where wheel and
    ground are tangent, and where the wheel rests on an edge the wheel's own radius is the
    normal.
    """
    R, forward, up, normal = placement.R, placement.forward, placement.up, touch.normal
    radial_x = -s * forward[0] + c * up[0]
    radial_y = -s * forward[1] + c * up[1]
    radial_z = c * up[2]
    along_radius = radial_z - slope_x * radial_x - slope_y * radial_y
    along_axis = R[2, 1] - slope_x * R[0, 1] - slope_y * R[1, 1]
    z = max(along_radius * radial_z + along_axis * R[2, 1], 0.02 * along_radius)
    normal[wheel, 0] = (along_radius * radial_x + along_axis * R[0, 1]) / z
    normal[wheel, 1] = (along_radius * radial_y + along_axis * R[1, 1]) / z
    normal[wheel, 2] = 1.0


@kernel
def find_contact(samples, placement, wheel, touch):
    """Replace the touch of `wheel` by the mean contact over the circles that share the load.

    Each circle counts by how far its own touching point stays below the lowest plus COMPLIANCE
    radii. The touch has to come from a FULL or EXACT `find_touch`.
    """
    if touch.held_height[wheel] == touch.held_height[wheel]:
        s, c = np.sin(touch.held_angle[wheel]), np.cos(touch.held_angle[wheel])
        _write_point(samples, placement, wheel, s, c, 0.0, touch)
        return
    allowance = COMPLIANCE * samples.radius
    total, sine_sum, cosine_sum, lateral_sum = 0.0, 0.0, 0.0, 0.0
    for m in range(samples.circles):
        weight = 1.0 - (touch.circle_gap[wheel, m] - touch.gap[wheel]) / allowance
        if weight > 0.0:
            total += weight
            sine_sum += weight * touch.circle_sine[wheel, m]
            cosine_sum += weight * touch.circle_cosine[wheel, m]
            lateral_sum += weight * samples.laterals[m]
    length = np.sqrt(sine_sum * sine_sum + cosine_sum * cosine_sum)
    s, c = sine_sum / length, cosine_sum / length
    _write_point(samples, placement, wheel, s, c, lateral_sum / total, touch)
