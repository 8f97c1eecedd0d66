"""A rigid cylindrical wheel on the terrain: its vertical gap, where it touches and in what frame.

The lower half of the cylinder is sampled in the wheel's own, cambered plane: on circles across its
width and angles along each circle. The smallest vertical gap between sample and terrain is the gap
of the wheel; it is refined along the circle by the root of its derivative. Contact angles count
from the lowest point of the circle, positive towards the front, so a wheel climbing has positive
angles.
"""

from typing import Any

import numpy as np

from rover_physics.ground import height_at_cell, is_cell_on_map, look_up
from rover_physics.kernels import kernel
from rover_physics.records import new_record, record_type
from rover_physics.rover import Rover

TOUCHING, OFF_MAP, UNKNOWN_GROUND = 0, 1, 2
COARSE, QUICK, NEAR, FULL, EXACT = np.arange(5)
"""Scopes of `find_touch`. Not plain integers, or each value would be compiled apart."""
REFINEMENTS = 9
GAP_PRECISION = 1e-5
"""How far the gap of a circle may be from its smallest, in wheel radii."""
TURN_TOLERANCE = 1e-4
"""Error of the contact angle [rad] at which the search along the circle stops."""
CIRCLE_REACH = 1.5e-2
"""How far above the nearest circle, in wheel radii, another one is looked at more closely."""
EXACT_REACH = 0.5
"""The same for samples of an exact search: beside a face much can lie between two samples."""
PRUNING_MARGIN = 2e-2
"""Rows are passed over that stay farther than this, in wheel radii, above the nearest sample."""
COMPLIANCE = 2e-3
"""Depth, in wheel radii, to which real wheels and ground give way: circles with gaps closer than
that share the load. On a plane a wheel thus touches in its middle, not on an edge at random."""


MOST_ANGLES, MOST_CIRCLES = 49, 9
WHEEL_SAMPLES = record_type(
    ("radius", float),  # wheel radius [m]
    ("rows", np.int64),  # number k of contact angles
    ("circles", np.int64),  # number m of circles
    ("sines", float, (MOST_ANGLES,)),  # (k,) sines of the contact angles, ascending
    ("cosines", float, (MOST_ANGLES,)),  # (k,) their cosines
    ("spacing_sine", float),  # sine of the angle between neighbouring samples
    ("spacing_cosine", float),  # cosine of the angle between neighbouring samples
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
    ("first_row", np.int64, (MOST_CIRCLES,)),  # row of the smallest sample of the last scan
    ("second_gap", float, (MOST_CIRCLES,)),  # its smallest sample away from that [m]
    ("second_row", np.int64, (MOST_CIRCLES,)),  # the row of that
)
"""Where the six wheels touch; written by `find_touch` and `find_contact`."""


def sample_wheel(rover: Rover, resolution: float) -> Any:
    """Choose samples no farther apart than the cells of a terrain of `resolution` [m]."""
    wheel = rover.wheel
    half_angles = int(np.clip(np.ceil(0.5 * np.pi * wheel.radius / resolution), 8, 24))
    half_laterals = int(np.clip(np.ceil(0.5 * wheel.width / resolution), 1, 4))
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 2 * half_angles + 1)
    samples = new_record(
        WHEEL_SAMPLES,
        radius=wheel.radius,
        rows=angles.size,
        circles=2 * half_laterals + 1,
        spacing_sine=np.sin(angles[1] - angles[0]),
        spacing_cosine=np.cos(angles[1] - angles[0]),
    )
    samples.sines[: angles.size], samples.cosines[: angles.size] = np.sin(angles), np.cos(angles)
    half = 0.5 * wheel.width
    samples.laterals[: samples.circles] = np.linspace(-half, half, samples.circles)
    return samples


def new_touch() -> Any:
    """Return an empty TOUCH, no wheel held."""
    return new_record(TOUCH, held_height=np.nan, held_angle=np.nan)


@kernel
def find_touch(ground, samples, placement, wheel, scope, touch):
    """Find where `wheel` is nearest to the ground and write it into row `wheel` of `touch`.

    `scope` says how thoroughly: COARSE looks at every other sample of the middle circle, QUICK
    at all samples and closer at the nearest, NEAR only around the direction found last, FULL
    closer at each circle, EXACT closer at each local minimum of each circle. Returns TOUCHING,
    or OFF_MAP or UNKNOWN_GROUND where any sample lies there; such samples are passed over, and
    the gap is NaN where there is no other.
    """
    status = TOUCHING
    if touch.held_height[wheel] == touch.held_height[wheel]:
        _hold(placement, wheel, touch)
        return status
    if scope == NEAR:
        s, c = touch.sine[wheel], touch.cosine[wheel]
        _refine(ground, samples, placement, wheel, touch.nearest[wheel], s, c, touch)
    else:
        status = _scan(ground, samples, placement, wheel, scope, touch)
        if touch.circle_gap[wheel, touch.nearest[wheel]] == np.inf:
            touch.gap[wheel] = np.nan
            return status
        if scope != EXACT:
            _refine_circles(ground, samples, placement, wheel, scope == FULL, touch)
    m = touch.nearest[wheel]
    touch.gap[wheel] = touch.circle_gap[wheel, m]
    s, c = touch.circle_sine[wheel, m], touch.circle_cosine[wheel, m]
    _write_point(samples, placement, wheel, s, c, samples.laterals[m], touch)
    height, slope_x, slope_y = look_up(ground, touch.point[wheel, 0], touch.point[wheel, 1])
    _write_normal(placement, wheel, s, c, slope_x, slope_y, touch)
    return status


@kernel
def _hold(placement, wheel, touch):
    """Write the touch of a wheel whose centre is held at a height, whatever the ground."""
    touch.gap[wheel] = placement.centres[wheel, 2] - touch.held_height[wheel]
    for i in range(3):
        touch.point[wheel, i] = placement.centres[wheel, i]
        touch.normal[wheel, i] = 0.0
    touch.normal[wheel, 2] = 1.0


@kernel
def _refine_circles(ground, samples, placement, wheel, all_circles, touch):
    """Look closer at the nearest sample of the nearest circle, or of all that may be nearest."""
    best = touch.nearest[wheel]
    reach = touch.circle_gap[wheel, best] + CIRCLE_REACH * samples.radius
    s, c = touch.circle_sine[wheel, best], touch.circle_cosine[wheel, best]
    _refine(ground, samples, placement, wheel, best, s, c, touch)
    if not all_circles:
        return
    best_s, best_c = touch.circle_sine[wheel, best], touch.circle_cosine[wheel, best]
    for m in range(samples.circles):
        if m != best and touch.circle_gap[wheel, m] <= reach:
            s, c = touch.circle_sine[wheel, m], touch.circle_cosine[wheel, m]
            if abs(s * best_c - c * best_s) < samples.spacing_sine:
                s, c = best_s, best_c
            _refine(ground, samples, placement, wheel, m, s, c, touch)
        if touch.second_gap[m] <= reach:
            k = touch.second_row[m]
            s, c = samples.sines[k], samples.cosines[k]
            _refine(ground, samples, placement, wheel, m, s, c, touch)
        if touch.circle_gap[wheel, m] < touch.circle_gap[wheel, touch.nearest[wheel]]:
            touch.nearest[wheel] = m


@kernel
def _scan(ground, samples, placement, wheel, scope, touch):
    """Write the nearest sample of each circle into `touch`; return the status of the worst sample.

    Rows of samples at one angle are passed over where even the highest ground around stays farther
    below them than the nearest sample by PRUNING_MARGIN; all higher rows are where that holds for
    the highest ground around the wheel.
    """
    R, forward, up, centres = placement.R, placement.forward, placement.up, placement.centres
    elevation, ceiling, scale = ground.elevation, ground.ceiling, ground.inverse_resolution
    sines, cosines, laterals, radius = (
        samples.sines, samples.cosines, samples.laterals, samples.radius
    )  # fmt: skip
    circle_gap, circle_sine, circle_cosine = (
        touch.circle_gap, touch.circle_sine, touch.circle_cosine
    )  # fmt: skip
    first_m, last_m, stride = 0, samples.circles - 1, 1
    if scope == COARSE:
        first_m = last_m = last_m // 2
        stride = 2
    centre_x = (centres[wheel, 0] - ground.x0) * scale
    centre_y = (centres[wheel, 1] - ground.y0) * scale
    centre_z = centres[wheel, 2]
    axis_x, axis_y, axis_z = R[0, 1] * scale, R[1, 1] * scale, R[2, 1]
    rim = abs(axis_z) * laterals[samples.circles - 1]
    margin = np.inf if scope == EXACT else PRUNING_MARGIN * radius
    first_row, second_gap, second_row = touch.first_row, touch.second_gap, touch.second_row
    for m in range(samples.circles):
        circle_gap[wheel, m] = np.inf
        second_gap[m] = np.inf
        first_row[m] = -2
    roof = np.inf
    if is_cell_on_map(elevation, centre_x, centre_y):
        roof = ground.wheel_ceiling[int(centre_y + 0.5), int(centre_x + 0.5)]
    best, best_m, status = np.inf, first_m, TOUCHING
    rows = (samples.rows - 1) // stride + 1
    for visit in range(rows):
        k = stride * (rows // 2 + ((visit + 1) // 2) * (1 - 2 * (visit % 2)))
        row_z = centre_z - radius * cosines[k] * up[2]
        if row_z - rim - roof > best + margin:
            break
        row_x = centre_x + scale * radius * (sines[k] * forward[0] - cosines[k] * up[0])
        row_y = centre_y + scale * radius * (sines[k] * forward[1] - cosines[k] * up[1])
        if is_cell_on_map(elevation, row_x, row_y):
            highest = ceiling[int(row_y + 0.5), int(row_x + 0.5)]
            if row_z - rim - highest > best + margin:
                continue
        for m in range(first_m, last_m + 1):
            gx, gy = row_x + laterals[m] * axis_x, row_y + laterals[m] * axis_y
            if not is_cell_on_map(elevation, gx, gy):
                status = OFF_MAP
                continue
            gap = row_z + laterals[m] * axis_z - height_at_cell(elevation, gx, gy)
            if gap != gap:
                if status == TOUCHING:
                    status = UNKNOWN_GROUND
            elif scope == EXACT:
                if gap < best + EXACT_REACH * radius:
                    _refine(ground, samples, placement, wheel, m, sines[k], cosines[k], touch)
                    gap = touch.circle_gap[wheel, m]
            elif gap < circle_gap[wheel, m]:
                if abs(k - first_row[m]) > stride:
                    second_gap[m], second_row[m] = circle_gap[wheel, m], first_row[m]
                first_row[m] = k
                circle_gap[wheel, m] = gap
                circle_sine[wheel, m], circle_cosine[wheel, m] = sines[k], cosines[k]
            elif gap < second_gap[m] and abs(k - first_row[m]) > stride:
                second_gap[m], second_row[m] = gap, k
            if gap < best:
                best, best_m = gap, m
    touch.nearest[wheel] = best_m
    return status


@kernel
def _refine(ground, samples, placement, wheel, m, s, c, touch):
    """Find the angle on circle m, near (s, c), where the gap is smallest; write it into `touch`.

    On a plane the circle touches in the direction of the plane's normal, so the first trials look
    in the direction of the normal found last. On an edge that leads to and fro: then the next
    trial is where the tangents of the gap from both sides meet, which is also where the gap can't
    be smaller. What `touch` holds for the circle is kept where it is lower, unless it is the start
    (s, c) itself.
    """
    R, forward, up, centres = placement.R, placement.forward, placement.up, placement.centres
    lateral, radius = samples.laterals[m], samples.radius
    x = centres[wheel, 0] + lateral * R[0, 1]
    y = centres[wheel, 1] + lateral * R[1, 1]
    z = centres[wheel, 2] + lateral * R[2, 1]
    best_gap = touch.circle_gap[wheel, m]
    if s == touch.circle_sine[wheel, m] and c == touch.circle_cosine[wheel, m]:
        best_gap = np.inf
    turn_s, turn_c = samples.spacing_sine, samples.spacing_cosine
    back_s, back_c = s * turn_c - c * turn_s, c * turn_c + s * turn_s
    ahead_s, ahead_c = s * turn_c + c * turn_s, c * turn_c - s * turn_s
    if back_c < 0.0:
        back_s, back_c = -1.0, 0.0
    if ahead_c < 0.0:
        ahead_s, ahead_c = 1.0, 0.0
    back_gap, ahead_gap, back_rate, ahead_rate = np.nan, np.nan, np.nan, np.nan
    for trial in range(REFINEMENTS):
        height, slope_x, slope_y = look_up(
            ground,
            x + radius * (s * forward[0] - c * up[0]),
            y + radius * (s * forward[1] - c * up[1]),
        )
        gap = z - radius * c * up[2] - height
        if gap < best_gap:
            best_gap = gap
            touch.circle_gap[wheel, m] = gap
            touch.circle_sine[wheel, m], touch.circle_cosine[wheel, m] = s, c
        rise = slope_x * forward[0] + slope_y * forward[1]
        fall = up[2] - slope_x * up[0] - slope_y * up[1]
        turn = s * fall - c * rise
        length = np.sqrt(rise * rise + fall * fall)
        if not abs(turn) > TURN_TOLERANCE * length:
            if gap == best_gap:
                touch.circle_sine[wheel, m] = rise / length
                touch.circle_cosine[wheel, m] = fall / length
            break
        if turn > 0.0:
            ahead_s, ahead_c, ahead_gap, ahead_rate = s, c, gap, radius * turn
        else:
            back_s, back_c, back_gap, back_rate = s, c, gap, radius * turn
        between = ahead_s * back_c - ahead_c * back_s
        share = (ahead_gap - back_gap - ahead_rate * between) / (
            (back_rate - ahead_rate) * between
        )
        if best_gap - (back_gap + back_rate * share * between) < GAP_PRECISION * radius:
            break
        s, c = rise / length, fall / length
        inside = s * back_c > c * back_s and s * ahead_c < c * ahead_s
        if trial > 1 or not inside:
            share = min(max(share, 0.05), 0.95) if share == share else 0.5
            s, c = back_s + share * (ahead_s - back_s), back_c + share * (ahead_c - back_c)
            length = np.sqrt(s * s + c * c)
            s, c = s / length, c / length


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
